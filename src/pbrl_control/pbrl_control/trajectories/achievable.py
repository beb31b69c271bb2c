"""A wanted trajectory as an object's physics lets it happen, and the grip forces that takes."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, Freedom
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import projection
from pbrl_control.constraints.wrench import expected_grip_wrench
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, turn
from pbrl_control.trajectories.trajectory import SampledTrajectory, Trajectory, move

STEP = 0.01  # [s] between samples of what is achieved
FORCE_STEP = 0.05  # [s] between moments at which forces are computed
ALIKE = 10  # digits of twist and rate after which two moments need the same force


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
    setpoints = [trajectory.at(k * STEP) for k in range(1, count)]
    wanted = np.array([point.twist for point in setpoints])
    if not np.isfinite(wanted).all():
        raise ControlError(f"wanted twist: expected finite numbers, got {wanted[~np.isfinite(wanted).all(axis=1)][0]}")
    start, twists = trajectory.at(0.0).pose, np.zeros((count, 3))
    ahead = np.array([point.pose[2] for point in setpoints])
    if model.parameters.has_hinge and model.parameters.hinge_radius > 0.0:
        twists[1:] = _on_a_bar(model, settings, start, ahead, wanted)
    else:
        twists[1:] = _anywhere(projection(model, Freedom.of(model, start, settings)), float(start[2]), ahead, wanted)
    return SampledTrajectory(start, twists, STEP)


def _anywhere(allowed: Array, heading: float, ahead: Array, wanted: Array) -> Array:
    """Return the allowed twists (n, 3) where the map to them is the same wherever the object is.

    Args:
        allowed: (3, 3), see `projection`.
        heading: of the object at the start [rad].
        ahead: (n,) headings of the setpoints [rad].
        wanted: (n, 3) their twists.
    """
    row_x, row_y, row_turn = allowed.tolist()
    found, before = np.empty_like(wanted), 0.0
    # Floats, not arrays: all this is done in the tick in which a trajectory begins.
    for k, (yaw, (vx, vy, omega)) in enumerate(zip(ahead.tolist(), wanted.tolist(), strict=True)):
        off = yaw - (heading + before * STEP)
        c, s = math.cos(off), math.sin(off)
        x, y = c * vx - s * vy, s * vx + c * vy
        turning = row_turn[0] * x + row_turn[1] * y + row_turn[2] * omega
        found[k, 0] = row_x[0] * x + row_x[1] * y + row_x[2] * omega
        found[k, 1] = row_y[0] * x + row_y[1] * y + row_y[2] * omega
        found[k, 2] = turning
        heading, before = heading + (before + turning) * (STEP / 2.0), turning
    return found


def _on_a_bar(model: ObjectModel, settings: ConstraintSettings, start: Array, ahead: Array, wanted: Array) -> Array:
    """Return the same for an object on a hinge at a distance: what is allowed depends on where it is."""
    found, pose, before = np.empty_like(wanted), start, np.zeros(3)
    for k, (yaw, twist) in enumerate(zip(ahead, wanted, strict=True)):
        there = move(pose, before * STEP)
        allowed = projection(model, Freedom.of(model, there, settings)) @ turn(twist, float(yaw - there[2]))
        pose, before = move(pose, (before + allowed) * (STEP / 2.0)), allowed
        found[k] = allowed
    return found


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
    points = [trajectory.at(float(time)) for time in np.arange(0.5 * FORCE_STEP, trajectory.duration, FORCE_STEP)]
    if not (model.parameters.has_hinge and model.parameters.hinge_radius > 0.0):
        # Where the object is says nothing then, and most of the way is at one steady twist.
        points = list(
            {np.concatenate((each.twist, each.rate)).round(ALIKE).tobytes(): each for each in points}.values()
        )
    largest = 0.0
    for point in points:
        wrench = expected_grip_wrench(model, point.pose, point.twist, point.rate, contacts, settings, across=True)
        largest = max(largest, float(np.hypot(wrench[:, 0], wrench[:, 1]).max()))
    return largest
