"""How a moving object is brought to rest by what holds it: the last part of a plan, and no part of the search."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.planar import Array, rotation
from pbrl_planner.kinodynamic.dynamics import PushDynamics


def brake(dynamics: PushDynamics, state: Array) -> tuple[Array, Array] | None:
    """Return wrenches (n, 3), held for a control step each, and the state (6,) of rest that they lead to.

    Args:
        dynamics: of the held object.
        state: (6,) to start from.

    Returns:
        None where something is in the way, or rest takes longer than the settings allow.
    """
    settings = dynamics.settings
    here = np.array(state, dtype=float)
    wrenches: list[Array] = []
    while rest_speed(dynamics, here) > settings.rest_speed:
        if len(wrenches) >= settings.brake_steps:
            return None
        wrenches.append(braking_wrench(dynamics, here))
        after = dynamics.step(here, wrenches[-1])
        if after is None:
            return None
        here = after.copy()
    return np.array(wrenches).reshape(-1, 3), here


def rest_speed(dynamics: PushDynamics, state: Array) -> float:
    """Return sqrt(2 E / m) of a state's kinetic energy E [m/s]."""
    return math.hypot(state[3], state[4], dynamics.gyration * state[5])


def braking_wrench(dynamics: PushDynamics, state: Array) -> Array:
    """Return the wrench (3,) at the held point that leaves the least kinetic energy after one control step.

    Friction, which helps, is left out; what it did shows in the next step. With the components A that the robot
    can exert, the mass matrix M and the control step T, it is -(A' M^-1 A)^-1 A' v / T, all of it shortened where a
    limit is met.
    """
    twist = np.append(rotation(float(state[2])).T @ state[3:5], state[5])
    exerted = dynamics.exerted
    yielding = exerted.T @ (exerted / dynamics.inertia[:, None])
    control = -np.linalg.solve(yielding, exerted.T @ twist) / dynamics.settings.control_step
    wrench = np.zeros(3)
    wrench[dynamics.axes] = control / max(1.0, float(np.max(np.abs(control) / dynamics.limits)))
    return wrench
