"""Compiled: one control held for a while, through the world model, with the outlines placed on the way.

Arrays in, caller's buffers out: no allocation, no callables, no checks.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.kernel import cos_sin, integrate

Array = NDArray[np.float64]


@njit(**LEAF)
def advance(
    parameters: Array,
    inertia_per_mass: float,
    com: Array,
    contact: Array,
    corners: Array,
    state: Array,
    wrench: Array,
    dt: float,
    speed: float,
    yaw_rate: float,
    wrenches: Array,
    states: Array,
    placed: Array,
    box: Array,
) -> bool:
    """Hold a wrench for the n steps of the buffers and place the outlines after each.

    Args:
        parameters: (12,) row of `KERNEL_COLUMNS`.
        inertia_per_mass: [m^2].
        com: (2,) centre of mass in the object's frame [m].
        contact: (2,) where the wrench acts, in the object's frame [m].
        corners: (c, 2) in the object's frame [m].
        state: (6,) of the centre of mass in `world`.
        wrench: (3,) force in the object's axes and torque about the contact [N, N, N m].
        dt: [s].
        speed: most of the contact [m/s].
        yaw_rate: most [rad/s].
        wrenches: (n, 3) room to work in.
        states: (n + 1, 6) out: of the centre of mass, the first as given; the last one's yaw is in [-pi, pi], which
            makes what follows the same however it is cut into pieces.
        placed: (n, c, 2) out: the corners in `world` after each step.
        box: (4,) out: lowest x and y, highest x and y of all those.

    Returns:
        Whether the limits of speed were kept; where they were not, `placed` and `box` are not whole.
    """
    steps = len(wrenches)
    lever_x, lever_y = contact[0] - com[0], contact[1] - com[1]
    torque = wrench[2] + lever_x * wrench[1] - lever_y * wrench[0]
    for t in range(steps):
        wrenches[t, 0], wrenches[t, 1], wrenches[t, 2] = wrench[0], wrench[1], torque
    integrate(parameters, state, wrenches, steps, inertia_per_mass, com[0], com[1], 0.0, 0.0, dt, True, states)
    box[0], box[1], box[2], box[3] = math.inf, math.inf, -math.inf, -math.inf
    for t in range(1, steps + 1):
        c, s = cos_sin(states[t, 2])
        omega = states[t, 5]
        vx = states[t, 3] - omega * (s * lever_x + c * lever_y)
        vy = states[t, 4] + omega * (c * lever_x - s * lever_y)
        # Written so that NaN is refused as well.
        if not (vx * vx + vy * vy <= speed * speed and abs(omega) <= yaw_rate):
            return False
        for k in range(len(corners)):
            away_x, away_y = corners[k, 0] - com[0], corners[k, 1] - com[1]
            x = states[t, 0] + c * away_x - s * away_y
            y = states[t, 1] + s * away_x + c * away_y
            placed[t - 1, k, 0], placed[t - 1, k, 1] = x, y
            box[0], box[1] = min(box[0], x), min(box[1], y)
            box[2], box[3] = max(box[2], x), max(box[3], y)
    states[steps, 2] -= 2.0 * math.pi * math.floor((states[steps, 2] + math.pi) / (2.0 * math.pi))
    return True
