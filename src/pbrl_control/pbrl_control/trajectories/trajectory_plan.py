"""Trajectory files: what to grasp, along which poses or twists to move it. YAML in `config/params/trajectories/`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pbrl_control.errors import ControlError
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.installed import load_named
from pbrl_control.planar import Array, compose
from pbrl_control.settings import NotNegative, Planar, Positive, Section
from pbrl_control.trajectories.trajectory import MotionLimits, ObjectTrajectory


class TwistSegment(Section):
    """A twist, held for a time.

    Attributes:
        twist: vx, vy [m/s], omega [rad/s] of the object's origin in its axes.
        duration: [s]; ramps come on top and cover no more ground.
    """

    twist: Planar
    duration: Positive


class FollowSettings(Section):
    """How a trajectory is followed.

    Attributes:
        gain: [1/s] error of the seen pose to velocity.
        integral: [1/s^2] summed error to velocity: what the grips give way to a steady resistance is made up for.
        feedback_speed: [m/s] most that either adds.
        feedback_yaw_rate: [rad/s] most that either adds.
        smoothing: [s] time constant over which seen errors are averaged.
        slack: [m] behind the setpoint at which the setpoint waits; from half of it on it goes slower.
        yaw_slack: [rad] likewise.
        acceleration: [m/s^2] most that the commanded twist changes.
        yaw_acceleration: [rad/s^2] likewise.
        tolerance: [m] from the last pose within which it has arrived.
        yaw_tolerance: [rad] likewise.
        settle: [s] at least for feedback alone at the end.
        settle_timeout: [s] at most.
    """

    gain: NotNegative = 1.0
    integral: NotNegative = 0.2
    feedback_speed: Positive = 0.06
    feedback_yaw_rate: Positive = 0.12
    smoothing: Positive = 0.15
    slack: Positive = 0.06
    yaw_slack: Positive = 0.12
    acceleration: Positive = 0.3
    yaw_acceleration: Positive = 0.5
    tolerance: Positive = 0.008
    yaw_tolerance: Positive = 0.01
    settle: NotNegative = 0.5
    settle_timeout: Positive = 8.0


class AbortLimits(Section):
    """What ends a trajectory early (thesis 6.4).

    Attributes:
        force_ratio: horizontal force at any grip over the largest that the model expects.
        force_floor: [N] never taken for unexpected: casters that swivel round, which no model of one wheel knows of,
            made 39 N on a free table where 15 N were expected.
        force: [N] at any grip while there is no model.
        force_time: [s] for which it is exceeded.
        stall_time: [s] without progress while motion is commanded.
        stall_progress: [s] of the trajectory that count as progress.
        time_ratio: time-out over the trajectory's own duration; settling comes on top.
        tag_age: [s] without a tag of the object.
    """

    force_ratio: Annotated[float, Field(ge=1.0, allow_inf_nan=False)] = 1.5
    force_floor: NotNegative = 40.0
    force: Positive = 150.0
    force_time: NotNegative = 0.2
    stall_time: Positive = 3.0
    stall_progress: Positive = 0.1
    time_ratio: Annotated[float, Field(ge=1.0, allow_inf_nan=False)] = 3.0
    tag_age: Positive = 1.0


class TrajectoryPlan(GraspPlan):
    """One trajectory of one object, from drive-up to release.

    Attributes:
        frame: of the waypoints: "start": the object's pose when it sets out; "world".
        waypoints: x, y [m], theta [rad]; it stops at each.
        segments: twists one after the other, from rest to rest each; in place of waypoints.
        motion: limits on it.
        follow: gains.
        abort: what ends the following early.
    """

    frame: Literal["start", "world"] = "start"
    waypoints: tuple[Planar, ...] = ()
    segments: tuple[TwistSegment, ...] = ()
    motion: MotionLimits = MotionLimits()
    follow: FollowSettings = FollowSettings()
    abort: AbortLimits = AbortLimits()

    @model_validator(mode="after")
    def _either_waypoints_or_segments(self) -> Self:
        if bool(self.waypoints) == bool(self.segments):
            raise ValueError("expected either waypoints or segments, got " + ("both" if self.waypoints else "neither"))
        if self.segments and self.frame == "world":
            raise ValueError("expected frame: start with segments, which are in the object's axes, got world")
        try:
            self.trajectory(np.zeros(3))
        except ControlError as error:
            raise ValueError(str(error)) from error
        return self

    def trajectory(self, start: Array) -> ObjectTrajectory:
        """Make the trajectory from where the object is now, pose (3,) in `world` [m, rad].

        Raises:
            ControlError: the pose is not finite.
        """
        if self.segments:
            twists = np.array([segment.twist for segment in self.segments])
            durations = np.array([segment.duration for segment in self.segments])
            return ObjectTrajectory.of_twists(start, twists, durations, self.motion)
        points = [np.array(point) for point in self.waypoints]
        if self.frame == "start":
            points = [compose(np.asarray(start, dtype=float), point) for point in points]
        return ObjectTrajectory.through(start, points, self.motion)


def load_trajectory(name_or_path: str | Path) -> TrajectoryPlan:
    """Read a plan: a path, or the name of a file in `config/params/trajectories/` of the installed workspace.

    Raises:
        ControlError: there is no such plan, or it is not as it should be.
    """
    return load_named(name_or_path, "trajectories", TrajectoryPlan, "trajectory")
