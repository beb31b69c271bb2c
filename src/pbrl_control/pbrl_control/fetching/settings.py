"""Patience, tolerances and the grip test of a fetch."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.localizer import LocalizerSettings
from pbrl_control.navigation.settings import TrackerSettings
from pbrl_control.settings import Finite, Positive, Section


class GripTestSettings(Section):
    """A slight pull and back, which shows whether a closed grip holds anything.

    Attributes:
        still: [s] at rest before the pull, and at its far end: sensors and tags are averaged there.
        distance: [m] of the pull.
        duration: [s] of the pull, and of the way back.
        least_force: [N] that each grip has to feel, see `GripReading.force`. In Bullet hands that held nothing felt
            0.2 N, hands that held a table on casters 3 N at least and 12 N as a rule.
        most_slip: share of the pull that a gripper may move on the edge.
        course_slip: [m] that a grip may move on the edge during the course that follows.
        slip_time: [s] for which it does.
    """

    still: Positive = 0.6
    distance: Annotated[float, Field(gt=0.0, le=0.05)] = 0.02
    duration: Positive = 1.2
    least_force: Positive = 1.0
    most_slip: Annotated[float, Field(gt=0.0, le=1.0)] = 0.6
    course_slip: Positive = 0.03
    slip_time: Positive = 0.5


class FetchSettings(Section):
    """How an object is driven to.

    Attributes:
        grasps: how grasps are sampled, and what is asked of them.
        tracker: gains and patience on the way.
        localizer: how odometry and tags become a pose.
        grip_test: what confirms a grip.
        look: [s] that the robot stands and looks before it plans.
        look_timeout: [s] until everything that planning needs has been seen.
        stow_timeout: [s].
        stow_tolerance: [rad] of each joint of a stowed arm.
        waist, torso: [rad] that the footprints and the arms' home belong to.
        body_tolerance: [rad] of waist and torso.
        drive_timeout: [s] for one way.
        tag_age: [s] without the object's tag at which the base stops.
        patience: [s] that it then waits for it.
        moved: [m] from where the object was when the way was planned, at which it is planned again.
        moved_yaw: [rad] likewise.
        smoothing: [s] time constant over which poses of things that stand are averaged.
        back_off: [m] that the base drives back before arms among furniture are stowed.
        back_off_speed: [m/s].
        headroom: [m] above a body from which a gripper is clear of it.
        attempts: ways and grasps tried before giving up.
        apart: [m] between stands: nearer than this to one where a grasp failed another is tried first.
    """

    grasps: GraspSettings = GraspSettings(time_limit=2.0, dead_ends=3)
    tracker: TrackerSettings = TrackerSettings(  # arms make up for what the base is off
        reached=0.01, aligned=0.012, position_tolerance=0.04, yaw_tolerance=0.035
    )
    localizer: LocalizerSettings = LocalizerSettings()
    grip_test: GripTestSettings = GripTestSettings()
    look: Positive = 1.0
    look_timeout: Positive = 6.0
    stow_timeout: Positive = 20.0
    stow_tolerance: Positive = 0.08
    waist: Finite = 2.732
    torso: Finite = 0.0
    body_tolerance: Positive = 0.1
    drive_timeout: Positive = 120.0
    tag_age: Positive = 1.0
    patience: Positive = 5.0
    moved: Positive = 0.10
    moved_yaw: Positive = 0.15
    smoothing: Positive = 0.4
    back_off: Positive = 0.15
    back_off_speed: Annotated[float, Field(gt=0.0, le=0.2)] = 0.08
    headroom: Positive = 0.10
    attempts: Annotated[int, Field(ge=1, le=10)] = 3
    apart: Positive = 0.25
