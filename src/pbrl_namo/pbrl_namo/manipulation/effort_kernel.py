"""Compiled: time, force and torque of many manipulations in many worlds."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_namo.manipulation.wrench_kernel import WORK, grip_wrenches

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

PEAK, SUM, TIME, FORCE, TORQUE = range(5)
"""Columns of what is found: largest force at a grip and of all grips [N], duration [s], force and torque over time."""


@njit(cache=True, error_model="numpy")
def efforts(
    physics: Array,
    allowed: Array,
    obeys: Flags,
    commands: Indices,
    speeds: Array,
    ways: Array,
    ramps: Array,
    contacts: Array,
    grips: Indices,
    torque_arm: float,
    out: Array,
) -> None:
    """Write what each manipulation takes in each world; NaN where the thing does not obey.

    A manipulation is one motion after another, from rest to rest. A twist is constant in the thing's axes, and so are
    the wrenches once it is at its speed. While it sets out, inertia comes on top, for the time of the ramp.

    Args:
        physics: (w, 16) see `worlds.PHYSICS`.
        allowed: (w, c, 3) what each world leaves of each command, of unit size.
        obeys: (w, c)
        commands: (p, m) which commands each manipulation follows; below zero: none any more.
        speeds: (p, m) by which the command is multiplied.
        ways: (p, m) how far it is followed, in units of the command.
        ramps: (p, m) [s] to get up to speed.
        contacts: (p, 2, 2) of its grips, in the thing's frame [m].
        grips: (p,) how many of those there are.
        torque_arm: [m] see `grip_wrenches`.
        out: (w, p, 5)
    """
    work, found = np.zeros((WORK, 4)), np.zeros((2, 3))
    twist, rate = np.zeros(3), np.zeros(3)
    for w in range(physics.shape[0]):
        for p in range(commands.shape[0]):
            held = contacts[p, : grips[p]]
            peak = most = time = force = torque = 0.0
            for m in range(commands.shape[1]):
                c = commands[p, m]
                if c < 0:
                    break
                if not obeys[w, c]:
                    time = np.nan
                    break
                duration = ways[p, m] / speeds[p, m]
                time += duration + ramps[p, m]
                for phase in range(2):  # setting out, and going on
                    for i in range(3):
                        twist[i] = allowed[w, c, i] * speeds[p, m]
                        rate[i] = twist[i] / ramps[p, m] if phase == 0 else 0.0
                    grip_wrenches(physics[w], twist, rate, held, torque_arm, work, found)
                    lasting = ramps[p, m] if phase == 0 else duration
                    whole = 0.0
                    for n in range(grips[p]):
                        size = np.sqrt(found[n, 0] ** 2 + found[n, 1] ** 2)
                        peak = max(peak, size)
                        whole += size
                        torque += abs(found[n, 2]) * lasting
                    most = max(most, whole)
                    force += whole * lasting
            if np.isnan(time):
                out[w, p, :] = np.nan
            else:
                out[w, p, 0], out[w, p, 1], out[w, p, 2], out[w, p, 3], out[w, p, 4] = peak, most, time, force, torque
