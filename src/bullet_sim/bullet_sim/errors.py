"""Errors of bullet_sim. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class SimError(Exception):
    """What a simulator refuses: a bad scene, an unknown body, an impossible grasp request."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Name the known words, the likeliest one first: the end of an error message about a misspelt `name`.

    Args:
        name: what was written.
        known: what would have been understood.
    """
    words = sorted(known)
    close = get_close_matches(name, words, n=1, cutoff=0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    return f"known: {', '.join(words)}" if words else "there are none"
