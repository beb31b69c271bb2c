"""Compiled: sweeps of value iteration over a sparse list of actions."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@njit(**LEAF)
def sweep_until(
    starts: Indices,
    ends: Indices,
    probabilities: Array,
    rewards: Array,
    goal: int,
    gamma: float,
    tolerance: float,
    sweeps: int,
    values: Array,
    q: Array,
) -> int:
    """Improve values in place until they stand; return how many sweeps that took, or -1 where they do not.

    Q_a = R_a + gamma (T_a V(end) + (1 - T_a) V(start)), and V(s) = max(0, max over actions a of s of Q_a): a robot may
    always leave it. The goal is absorbing. Values start from below, so they only grow.

    Args:
        starts: (k,) region of each action.
        ends: (k,) that it leads to.
        probabilities: (k,) with which.
        rewards: (k,) of trying.
        goal: region.
        gamma: discount.
        tolerance: change at which values stand.
        sweeps: at most.
        values: (n,) of the regions, changed.
        q: (k,) out.
    """
    for sweep in range(sweeps):
        change = 0.0
        for k in range(starts.shape[0]):
            here = starts[k]
            ahead = probabilities[k] * values[ends[k]] + (1.0 - probabilities[k]) * values[here]
            q[k] = rewards[k] + gamma * ahead
            if here != goal and q[k] > values[here]:
                change = max(change, q[k] - values[here])
                values[here] = q[k]
        if change <= tolerance:
            for k in range(starts.shape[0]):
                ahead = probabilities[k] * values[ends[k]] + (1.0 - probabilities[k]) * values[starts[k]]
                q[k] = rewards[k] + gamma * ahead
            return sweep + 1
    return -1
