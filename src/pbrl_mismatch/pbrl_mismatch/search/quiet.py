"""Coordinates of which the data say next to nothing, held while a climb goes on in all others.

Friction that holds a wheel is felt only where it is too little. Up to that edge the data say nothing of it, and belief
alone would draw it down: a step in everything goes over the edge, however good it is in all else. A damping that makes
it short enough makes it short in everything, and a climb along a smooth slope of hundreds of nats stood still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

QUIET = 10.0
"""Data that tell less of a coordinate than so many times what was believed of it are quiet."""
FIRM = 1e8
"""What is held is held by so many times what was believed of it."""
WORTH = 1.0
"""It is let go where a step without it gains less [nat]: no more than it may gain itself."""


def of_little(matrix: Array, precision: Array) -> Mask:
    """Return (P, K) which coordinates the data say next to nothing of.

    Args:
        matrix: (P, K, K) curvature of the data's misfit.
        precision: (K,) of the prior, one over its variance.
    """
    return np.asarray(np.diagonal(matrix, axis1=1, axis2=2) < QUIET * precision, dtype=np.bool_)


class Holding:
    """Which of a climb's starts hold what is quiet: from a step that failed on, for as long as it is worth it.

    Args:
        count: of starts.
        precision: (K,) of the prior, one over its variance.
    """

    def __init__(self, count: int, precision: Array) -> None:
        self._precision = precision
        self._held, self._spent = np.zeros((2, count), dtype=np.bool_)

    def added(self, rows: Index, quiet: Mask) -> Array:
        """Return what is added to the curvatures (n, K, K) of some starts, whose quiet coordinates are (n, K)."""
        held = quiet & self._held[rows, None]
        return np.asarray(held[:, :, None] * (FIRM * np.diag(self._precision)), dtype=np.float64)

    def failed(self, rows: Index, quiet: Mask) -> Index:
        """Hold what is quiet (n, K) of starts whose step has failed; return those that are to take a shorter one."""
        # Where all is quiet nothing would be left to climb.
        some = quiet.any(axis=1) & ~quiet.all(axis=1)
        shorter = self._held[rows] | self._spent[rows] | ~some
        self._held[rows[~shorter]] = True
        return rows[shorter]

    def stepped(self, rows: Index, gained: Array) -> None:
        """Let go of what is held where a step has gained next to nothing, until one in everything gains again."""
        held = self._held[rows]
        self._held[rows] = held & (gained > WORTH)
        self._spent[rows] = held & (gained <= WORTH)
