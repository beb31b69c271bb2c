"""P-values joined: of tests that are independent, of what is believed beforehand, of a library's odds."""

from __future__ import annotations

import math

UNBELIEVABLE = 1e-3
"""A conflict with what is believed beforehand counts from here on; above, the other tests' p-value stays as it is."""
LIBRARY_SHARE = 0.1
"""What the library's odds have of the level of the test, beside the test's own."""


def least_of_two(one: float, other: float) -> float:
    """Return the p-value of the lesser of two independent ones (Sidak)."""
    return min(one, other) * (2.0 - min(one, other))


def unless_unbelievable(p_value: float, conflict: float) -> float:
    """Return a p-value, or the chance of a conflict with what is believed where that is unbelievably small.

    What is believed is wider than what happens: chances of conflicts are no even p-values, but mostly near one.
    """
    return min(p_value, conflict) if conflict < UNBELIEVABLE else p_value


def with_library(p_value: float, log_odds: float) -> float:
    """Return a p-value that the library has a say in.

    A test against wrenches spreads its power; a law that is known has all of it in one place. By Markov's inequality
    the odds of the library are a test too: under no mismatch they exceed 1 / a with chance a at most. Joined as Sidak's
    are, with weights: what comes out is as even as what goes in, up to a fortieth, and has no lump at one.

    Args:
        p_value: of the test against wrenches.
        log_odds: of any effect of the library against none, at even prior odds.
    """
    by_library = math.exp(-max(log_odds, 0.0)) if log_odds < 700.0 else 0.0
    least = min(p_value, by_library / LIBRARY_SHARE, 1.0)
    return least * (1.0 + LIBRARY_SHARE * (1.0 - least))
