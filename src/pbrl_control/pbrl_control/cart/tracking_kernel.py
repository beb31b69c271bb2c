"""Compiled: a plan's pose at a time, and the nearest command that limits allow."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(cache=True)
def sample(times: Array, poses: Array, at: Array, found: Array) -> None:
    """Write the poses (k, 4) of a plan at times (k,), straight between its own (n, 4) at (n,), its ends beyond."""
    for k in range(len(at)):
        after = np.searchsorted(times, at[k])
        if after == 0:
            found[k] = poses[0]
        elif after == len(times):
            found[k] = poses[-1]
        else:
            share = (at[k] - times[after - 1]) / (times[after] - times[after - 1])
            for j in range(4):
                found[k, j] = poses[after - 1, j] + share * (poses[after, j] - poses[after - 1, j])


@njit(**LEAF)
def limit_rates(
    wish: Array,
    last: Array,
    speeds: Array,
    accelerations: Array,
    brakings: Array,
    low: float,
    high: float,
    dt: float,
    articulation: float,
    found: Array,
) -> None:
    """Write the rates (4,) nearest to a wish that may be commanded; see `RateLimits.nearest`.

    Args:
        wish: (4,) finite.
        last: (4,) commanded before.
        speeds: (3,) greatest.
        accelerations: (3,) greatest.
        brakings: (3,) greatest of what gets smaller.
        low: least articulation [rad].
        high: greatest [rad].
        dt: since the last command [s].
        articulation: where the cart is [rad].
        found: (4,) out.
    """
    size = math.hypot(wish[0], wish[1])
    share = speeds[0] / size if size > speeds[0] else 1.0
    vx, vy = share * wish[0], share * wish[1]
    slower = math.hypot(vx, vy) < math.hypot(last[0], last[1])
    most = dt * (brakings[0] if slower else accelerations[0])
    dx, dy = vx - last[0], vy - last[1]
    size = math.hypot(dx, dy)
    share = most / size if size > most else 1.0
    found[0], found[1] = last[0] + share * dx, last[1] + share * dy
    for k in range(2, 4):
        rate = min(max(wish[k], -speeds[k - 1]), speeds[k - 1])
        if k == 3:
            left = high - articulation if rate > 0.0 else articulation - low
            slow = brakings[2] * max(dt, 1e-3)
            bound = math.sqrt(slow * slow + 2.0 * brakings[2] * left) - slow if left > 0.0 else 0.0
            rate = min(max(rate, -bound), bound)
        most = dt * (brakings[k - 1] if abs(rate) < abs(last[k]) else accelerations[k - 1])
        found[k] = last[k] + min(max(rate - last[k], -most), most)
