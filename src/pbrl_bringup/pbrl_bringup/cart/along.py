"""Along a plan that is driven: what is left of it, and where on it another may begin."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.lattice import LatticePlan

AHEAD, ENOUGH = 0.3, 1.5
"""Way [m, rad] along a plan after which the next one begins; what is left of it at least for that to be worth it."""


def onward(plan: LatticePlan, aim: Array) -> Array | None:
    """Return the poses (m, 4) of a plan from where it is driven now to a state of the lattice that lies ahead.

    Args:
        plan: that is driven.
        aim: (4,) of it that the controller goes for now.

    Returns:
        None where the plan ends soon.
    """
    here = _nearest(plan.poses, aim)
    left = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(plan.poses[here:], axis=0)).sum(axis=1))))
    ahead = [
        k
        for k in range(here + 1, len(plan.poses))
        if left[k - here] >= AHEAD and (plan.waypoints == plan.poses[k]).all(axis=1).any()
    ]
    if not ahead or left[-1] < ENOUGH:
        return None
    return np.vstack([aim, plan.poses[here + 1 : ahead[0] + 1]])


def rest(poses: Array, aim: Array) -> Array:
    """Return what is left of poses (n, 4) that are driven, from one of them (4,) that the controller goes for."""
    return np.vstack([aim, poses[_nearest(poses, aim) + 1 :]])


def _nearest(poses: Array, aim: Array) -> int:
    off = poses - aim
    off[:, 2] = np.mod(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    return int(np.argmin(np.sum(off**2, axis=1)))
