"""A wanted trajectory as an object's physics lets it happen, and the grip forces that takes."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.constraints.wrench import expected_grip_wrench
from pbrl_control.planar import Array, turn
from pbrl_control.trajectories.trajectory import SampledTrajectory, Trajectory, move
from pbrl_control.types import PlanarTwist

STEP = 0.01  # [s] between samples of what is achieved
FORCE_STEP = 0.05  # [s] between moments at which forces are computed


def achievable_trajectory(
    trajectory: Trajectory, model: ObjectModel, settings: ConstraintSettings = DEFAULTS
) -> SampledTrajectory:
    """Return what becomes of a trajectory when its velocity is projected onto the constraints at each moment.

    The wanted velocity, in world axes, meets the object where the constraints have brought it by then: pushed straight
    on with a corner locked it turns about the corner (thesis 6.3.1: simulate the outcome, then execute that).

    Args:
        trajectory: the wanted one.
        model: the object's physics.
        settings: what counts as a constraint.

    Raises:
        ControlError: as of `achievable_twist`.
    """
    count = max(math.ceil(trajectory.duration / STEP), 1) + 1
    pose, twists = trajectory.at(0.0).pose, np.zeros((count, 3))
    start, before = pose, np.zeros(3)
    for k in range(1, count):
        there = move(pose, before * STEP)
        setpoint = trajectory.at(k * STEP)
        wanted = turn(setpoint.twist, setpoint.pose[2] - there[2])
        allowed = achievable_twist(model, PlanarTwist(*map(float, wanted)), there, settings).twist.array()
        pose = move(pose, (before + allowed) * (STEP / 2.0))
        twists[k] = before = allowed
    return SampledTrajectory(start, twists, STEP)


def peak_grip_force(
    trajectory: Trajectory, model: ObjectModel, contacts: Array, settings: ConstraintSettings = DEFAULTS
) -> float:
    """Return the largest horizontal force that any grip has to exert along a trajectory [N] (thesis 6.4).

    Which way casters stand at the start nobody knows: those of a model that has some are taken to stand across.

    Args:
        trajectory: one that the constraints allow.
        model: the object's physics.
        contacts: (n, 2) where the grips hold it, in the object's frame [m].
        settings: for sharing the wrench among grips.

    Raises:
        ControlError: as of `expected_grip_wrench`.
    """
    largest = 0.0
    for time in np.arange(0.5 * FORCE_STEP, trajectory.duration, FORCE_STEP):
        point = trajectory.at(float(time))
        wrench = expected_grip_wrench(model, point.pose, point.twist, point.rate, contacts, settings, across=True)
        largest = max(largest, float(np.hypot(wrench[:, 0], wrench[:, 1]).max()))
    return largest
