"""Compiled comparison of simulated with observed poses: one pass, no temporary arrays."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(**LEAF, nogil=True)
def whiten(poses: Array, observed: Array, noise: Array, out: Array) -> None:
    """Write (poses - observed) / noise, angles the shorter way round.

    Args:
        poses: (P, T, 3) x, y [m], theta [rad].
        observed: (T, 3).
        noise: (3,) standard deviations.
        out: (P, T, 3), written.
    """
    for p in range(poses.shape[0]):
        for t in range(observed.shape[0]):
            out[p, t, 0] = (poses[p, t, 0] - observed[t, 0]) / noise[0]
            out[p, t, 1] = (poses[p, t, 1] - observed[t, 1]) / noise[1]
            angle = poses[p, t, 2] - observed[t, 2]
            if abs(angle) > math.pi:
                angle -= 2.0 * math.pi * round(angle / (2.0 * math.pi))
            out[p, t, 2] = angle / noise[2]


@njit(**LEAF, nogil=True)
def sums_of_squares(poses: Array, observed: Array, noise: Array, out: Array) -> None:
    """Write the sums of squares (P,) of what `whiten` writes."""
    for p in range(poses.shape[0]):
        total = 0.0
        for t in range(observed.shape[0]):
            x = (poses[p, t, 0] - observed[t, 0]) / noise[0]
            y = (poses[p, t, 1] - observed[t, 1]) / noise[1]
            angle = poses[p, t, 2] - observed[t, 2]
            if abs(angle) > math.pi:
                angle -= 2.0 * math.pi * round(angle / (2.0 * math.pi))
            angle /= noise[2]
            total += x * x + y * y + angle * angle
        out[p] = total
