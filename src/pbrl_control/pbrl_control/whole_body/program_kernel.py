"""Compiled: the whole-body program of one tick, laid out as matrices.

Unknowns (17,): base forward and yaw, seven joint rates of the left arm, seven of the right, and the share s of the
asked twist that is done now, times that twist's length.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

UNKNOWNS = 17
SHARE = 16
"""Column of the share."""
ROWS = 6
"""Rows of inequalities beside the bounds: workspace x, y of either gripper, then the force at either."""
FREE = 1e6
"""A bound that binds nothing."""


@njit(cache=True, error_model="numpy")
def lay_program(
    jacobians: Array,
    planar: Array,
    active: NDArray[np.bool_],
    asked: Array,
    added: Array,
    base_wish: Array,
    arm_wish: Array,
    against: Array,
    room: Array,
    box: Array,
    weights: Array,
    low: Array,
    high: Array,
    hessian: Array,
    linear: Array,
    rows: Array,
    least: Array,
    most: Array,
) -> float:
    """Write min 1/2 x H x + f x with least <= (x, A x) <= most; return the length of the asked twist.

    Args:
        jacobians: (2, 6, 7) of the middle of the plates, axes of the base.
        planar: (2, 3) place and yaw of the plates in the base [m, rad].
        active: (2,) which gripper has a task.
        asked: (2, 6) twist to be had over the floor, as far as limits allow: (vx, vy, vz, roll, pitch, yaw) rates.
        added: (2, 6) twist to be had in any case: compliance, level plates, height.
        base_wish: (2,) where steering would go.
        arm_wish: (14,) joint rates towards nominal or stowed postures.
        against: (2, 2) unit vector against the horizontal force that a gripper feels; zero where there is none.
        room: (2,) speed that it may have along that [m/s].
        box: (2, 4) least and greatest x, then y, of the plates in the base [m].
        weights: (7,) of share, base forward, base yaw, joints that work, joints that idle; angular length [m];
            rate [1/s] at which a border may be approached.
        low: (16,) of the unknowns.
        high: (16,).
        hessian: (17, 17) out.
        linear: (17,) out.
        rows: (6, 17) out.
        least: (23,) out.
        most: (23,) out.
    """
    share, forward, yaw, working, idle, length, approach = weights
    hessian[:] = 0.0
    linear[:] = 0.0
    rows[:] = 0.0
    least[UNKNOWNS:] = -FREE
    most[UNKNOWNS:] = FREE
    reach = 0.0
    for side in range(2):
        if active[side]:
            for k in range(6):
                scale = 1.0 if k < 3 else length
                reach += (scale * asked[side, k]) ** 2
    reach = np.sqrt(reach)
    row = np.empty(UNKNOWNS)
    for side in range(2):
        first = 2 + 7 * side
        weight = working if active[side] else idle
        for k in range(first, first + 7):
            hessian[k, k] += weight
            linear[k] -= weight * arm_wish[k - 2]
        if not active[side]:
            continue
        x, y = planar[side, 0], planar[side, 1]
        for k in range(6):
            scale = 1.0 if k < 3 else length
            row[:] = 0.0
            for j in range(7):
                row[first + j] = scale * jacobians[side, k, j]
            if k == 0:
                row[0], row[1] = scale, -scale * y
            elif k == 1:
                row[1] = scale * x
            elif k == 5:
                row[1] = scale
            row[SHARE] = -scale * asked[side, k] / reach if reach > 0.0 else 0.0
            _add_square(hessian, linear, row, scale * added[side, k])
        for k in range(2):
            for j in range(7):
                rows[2 * side + k, first + j] = jacobians[side, k, j]
            place = planar[side, k]
            # Outside of the box nothing goes further out; coming back is the wish of base and arms.
            least[UNKNOWNS + 2 * side + k] = min(approach * (box[side, 2 * k] - place), 0.0)
            most[UNKNOWNS + 2 * side + k] = max(approach * (box[side, 2 * k + 1] - place), 0.0)
        nx, ny = against[side]
        for j in range(7):
            rows[4 + side, first + j] = nx * jacobians[side, 0, j] + ny * jacobians[side, 1, j]
        rows[4 + side, 0] = nx
        rows[4 + side, 1] = ny * x - nx * y
        most[UNKNOWNS + 4 + side] = room[side]
    hessian[0, 0] += forward
    hessian[1, 1] += yaw
    linear[0] -= forward * base_wish[0]
    linear[1] -= yaw * base_wish[1]
    hessian[SHARE, SHARE] += share
    linear[SHARE] -= share * reach
    least[:SHARE] = low
    most[:SHARE] = high
    least[SHARE], most[SHARE] = 0.0, reach
    return reach


@njit(**LEAF)
def _add_square(hessian: Array, linear: Array, row: Array, target: float) -> None:
    """Add (row x - target)^2 / 2."""
    for i in range(UNKNOWNS):
        if row[i] != 0.0:
            linear[i] -= target * row[i]
            for j in range(UNKNOWNS):
                hessian[i, j] += row[i] * row[j]
