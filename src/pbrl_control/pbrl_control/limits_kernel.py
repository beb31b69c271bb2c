"""Compiled: which velocities keep speeds, accelerations and joint stops."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(**LEAF)
def velocity_range(
    last: Array,
    joints: Array,
    lower: Array,
    upper: Array,
    ceiling: Array,
    change: Array,
    longest: float,
    dt: float,
    low: Array,
    high: Array,
) -> None:
    """Write the range of body velocities (16,) that may be sent.

    Args:
        last: (16,) sent before.
        joints: (14,) positions [rad].
        lower: (14,) least position.
        upper: (14,) greatest position.
        ceiling: (16,) greatest speeds.
        change: (16,) greatest accelerations.
        longest: time that a command may have to last [s].
        dt: time since the last one [s].
        low: (16,) out.
        high: (16,) out.
    """
    for k in range(16):
        low[k] = max(last[k] - change[k] * dt, -ceiling[k])
        high[k] = min(last[k] + change[k] * dt, ceiling[k])
    for k in range(14):
        up = braked(upper[k] - joints[k], change[k + 2], longest)
        down = braked(joints[k] - lower[k], change[k + 2], longest)
        high[k + 2] = min(high[k + 2], up)
        low[k + 2] = max(low[k + 2], -down)
        # Where the two disagree a joint is nearer to its stop than it could have come by itself: the stop wins.
        low[k + 2] = min(low[k + 2], up)
        high[k + 2] = max(high[k + 2], -down)


@njit(**LEAF)
def braked(way: float, acceleration: float, longest: float) -> float:
    """Return the speed v with v longest + v^2 / (2 acceleration) = way: it can go on and still stop in time."""
    if way <= 0.0:
        return 0.0
    slow = acceleration * longest
    return math.sqrt(slow * slow + 2.0 * acceleration * way) - slow
