"""A path that is driven, and a better one from a place ahead on it: where that is, and how the two are joined."""

from __future__ import annotations

import numpy as np

from pbrl_control.cart import CartLimits
from pbrl_control.planar import Array

SAME = 0.05
"""[m], [rad] by which two paths may differ and count as one."""


def join_ahead(poses: Array, passed: int, lead: float, limits: CartLimits) -> int | None:
    """Return which pose of a path a better one is to begin at; None: too little of it is left.

    Whoever drives is not there before `lead` has gone by, and as long again is left from there on.

    Args:
        poses: (n, 4) of the path.
        passed: how many of them lie behind.
        lead: [s].
        limits: nobody is faster than this.
    """
    left = poses[max(passed - 1, 0) :]
    moved = np.diff(left, axis=0)
    least = np.column_stack((np.hypot(moved[:, 0], moved[:, 1]), np.abs(moved[:, 2:]))) / limits.speeds
    times = np.concatenate(([0.0], np.cumsum(least.max(axis=1, initial=0.0))))
    at = int(np.searchsorted(times, lead))
    return None if times[-1] < 2.0 * lead else max(passed - 1, 0) + at


def joined(poses: Array, passed: int, join: int, better: Array) -> Array | None:
    """Return a path (k, 4) from about here on: what is left of one up to `join`, and from there a better one.

    Args:
        poses: (n, 4) of the one that is driven.
        passed: how many of them lie behind by now.
        join: where the better one begins.
        better: (m, 4) of it, its first pose that of `join`.

    Returns:
        None where the better one comes too late, or is what is driven anyway.
    """
    begin = max(passed - 1, 0)
    if begin >= join or same_way(poses[join:], better):
        return None
    return np.vstack([poses[begin : join + 1], better[1:]])


def same_way(one: Array, other: Array) -> bool:
    """Say whether two paths (n, 4) and (m, 4) pass the same poses: each has one of the other nearby."""
    return _near(one, other) and _near(other, one)


def _near(one: Array, other: Array) -> bool:
    off = one[:, None] - other[None]
    off[..., 2] = np.mod(off[..., 2] + np.pi, 2.0 * np.pi) - np.pi
    return bool((np.abs(off).max(axis=2).min(axis=1) <= SAME).all())
