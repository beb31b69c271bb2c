"""States of a pushed object as OMPL keeps them, and what is near: pose, velocity, yaw rate, all counted as metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from ompl import base as ob

from pbrl_control.planar import Array
from pbrl_planner.kinodynamic.dynamics import PushDynamics


def state_space(dynamics: PushDynamics) -> ob.CompoundStateSpace:
    """Return the space over the whole room: SE(2), the plane of velocities, the line of yaw rates.

    A turn counts as the way at the object's radius of gyration, a velocity as the way in the metric's time.
    """
    settings, problem = dynamics.settings, dynamics.problem
    x0, y0, x1, y1 = problem.floor.room.bounds
    lever = float(np.hypot(*(problem.contact - problem.model.com)))
    fastest = settings.speed + lever * settings.yaw_rate  # of the centre of mass, where the held point keeps its limit
    pose, velocity, rate = ob.SE2StateSpace(), ob.RealVectorStateSpace(2), ob.RealVectorStateSpace(1)
    pose.setBounds(bounds([(x0, x1), (y0, y1)]))
    pose.setSubspaceWeight(1, dynamics.gyration)
    velocity.setBounds(bounds([(-fastest, fastest)] * 2))
    rate.setBounds(bounds([(-settings.yaw_rate, settings.yaw_rate)]))
    space = ob.CompoundStateSpace()
    space.addSubspace(pose, 1.0)
    space.addSubspace(velocity, settings.velocity_time)
    space.addSubspace(rate, settings.velocity_time * dynamics.gyration)
    return space


def bounds(ranges: Sequence[tuple[float, float]]) -> ob.RealVectorBounds:
    """Return OMPL's bounds of (low, high) of each axis."""
    found = ob.RealVectorBounds(len(ranges))
    for axis, (low, high) in enumerate(ranges):
        found.setLow(axis, float(low))
        found.setHigh(axis, float(high))
    return found


def read_state(state: ob.State, into: Array) -> None:
    """Copy OMPL's state into an array (6,)."""
    pose, velocity = state[0], state[1]
    into[0], into[1], into[2] = pose.getX(), pose.getY(), pose.getYaw()
    into[3], into[4], into[5] = velocity[0], velocity[1], state[2][0]


def write_state(state: ob.State, values: Array) -> None:
    """Copy an array (6,) into OMPL's state."""
    x, y, theta, vx, vy, omega = values.tolist()
    pose, velocity = state[0], state[1]
    pose.setX(x)
    pose.setY(y)
    pose.setYaw(theta)
    velocity[0], velocity[1] = vx, vy
    state[2][0] = omega
