"""One wheel of a ground parted in two: where a body has two, the one that was fitted stands between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHARE = 0.6
"""Of the draws that are placed so; the others keep the first wheel where it was fitted."""
APART = 0.4
"""How far apart the two are, as a standard deviation in half diagonals of the footprint."""
LEAST = 0.02
"""Share of the fitted wheel's friction along an axis that each of the two has at least."""


def with_splits(rng: np.random.Generator, draws: Array, columns: tuple[str, ...], size: float) -> Array:
    """Part the fitted wheel in most of the draws (n, K): their friction together is what it had, about its place.

    Of the two axes each wheel has its own share: two casters that roll across each other look like one that does not
    roll. One in two first wheels heads as was fitted, the others and all second ones anywhere.

    Args:
        rng: which share each has, how far apart they are, where they head.
        draws: with the wheel as it was fitted; frictions as their logarithms.
        columns: names of the K columns.
        size: half the diagonal of the footprint [m].
    """
    out, count = draws.copy(), int(SHARE * len(draws))
    shares = rng.uniform(LEAST, 1.0 - LEAST, (2, count))
    middle = shares.mean(axis=0) if "mu_y" in columns else shares[0]
    for axis, share in zip(("x", "y"), shares, strict=True):
        apart = APART * size * rng.standard_normal(count)
        first = columns.index(f"wheel_{axis}")
        out[:count, columns.index(f"wheel2_{axis}")] = out[:count, first] - middle * apart
        out[:count, first] += (1.0 - middle) * apart
        if f"mu_{axis}" in columns:
            out[:count, columns.index(f"mu_{axis}")] += np.log(share)
        if f"wheel2_mu_{axis}" in columns:  # of the two axes, one kind of wheel has but one friction
            whole = draws[:count, columns.index(f"mu_{axis}" if f"mu_{axis}" in columns else "mu_x")]
            out[:count, columns.index(f"wheel2_mu_{axis}")] = whole + np.log(1.0 - share)
    if "wheel_theta" in columns:
        anywhere = rng.uniform(-np.pi / 2.0, np.pi / 2.0, count)
        fitted = out[:count, columns.index("wheel_theta")]
        out[:count, columns.index("wheel_theta")] = np.where(rng.random(count) < 0.5, fitted, anywhere)
    return out
