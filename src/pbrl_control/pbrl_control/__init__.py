"""Whole-body Jacobian control of what the robot holds, and what moves objects with it: models, trajectories, ways.

What stands on learned models, grasp search and route planning is imported when it is first asked for: a controller
does without it, and starts sooner.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from pbrl_control.body_jacobian import body_jacobian, body_velocity
from pbrl_control.controller import BodyController
from pbrl_control.errors import ControlError
from pbrl_control.kinematics import Posture, RobotKinematics
from pbrl_control.localizer import BaseLocalizer
from pbrl_control.loop import ControlLoop, LoopCommand
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, GripperRequest, Phase, PushCommand, PushExecutive
from pbrl_control.push_plan import PushPlan, load_plan
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.types import BodyCommand, BodyState, Hold, PlanarTwist
from pbrl_control.watchdog import Watchdog

LATER = {
    "pbrl_control.constraints.belief": ("ClassBelief",),
    "pbrl_control.constraints.classes": ("ModelClass", "classify"),
    "pbrl_control.constraints.object_model": ("ObjectModel", "SwivelCasters"),
    "pbrl_control.constraints.twist": ("achievable_twist",),
    "pbrl_control.constraints.wrench": ("expected_grip_wrench",),
    "pbrl_control.grasping": ("GraspCandidate", "sample_grasps"),
    "pbrl_control.navigation": ("FloorMap", "MotionChecker", "PathTracker", "plan_route"),
    "pbrl_control.trajectories.course": ("TrajectoryCourse",),
    "pbrl_control.trajectories.follower": ("TrajectoryFollower",),
    "pbrl_control.trajectories.trajectory": ("MotionLimits", "ObjectTrajectory", "Trajectory"),
    "pbrl_control.trajectories.trajectory_plan": ("TrajectoryPlan", "load_trajectory"),
}
"""What is imported when it is first asked for, by module."""

if TYPE_CHECKING:
    from pbrl_control.constraints.belief import ClassBelief
    from pbrl_control.constraints.classes import ModelClass, classify
    from pbrl_control.constraints.object_model import ObjectModel, SwivelCasters
    from pbrl_control.constraints.twist import achievable_twist
    from pbrl_control.constraints.wrench import expected_grip_wrench
    from pbrl_control.grasping import GraspCandidate, sample_grasps
    from pbrl_control.navigation import FloorMap, MotionChecker, PathTracker, plan_route
    from pbrl_control.trajectories.course import TrajectoryCourse
    from pbrl_control.trajectories.follower import TrajectoryFollower
    from pbrl_control.trajectories.trajectory import MotionLimits, ObjectTrajectory, Trajectory
    from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan, load_trajectory
else:

    def __getattr__(name: str) -> object:
        """Import what is asked for (PEP 562)."""
        for module, names in LATER.items():
            if name in names:
                return getattr(importlib.import_module(module), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "BaseLocalizer",
    "BodyCommand",
    "BodyController",
    "BodyShape",
    "BodyState",
    "ClassBelief",
    "ControlError",
    "ControlLoop",
    "ControllerSettings",
    "FloorMap",
    "GraspCandidate",
    "Grip",
    "GripperAnswer",
    "GripperRequest",
    "Hold",
    "LoopCommand",
    "ModelClass",
    "MotionChecker",
    "MotionLimits",
    "ObjectModel",
    "ObjectTrajectory",
    "PathTracker",
    "Percept",
    "Phase",
    "PlanarTwist",
    "Posture",
    "PushCommand",
    "PushExecutive",
    "PushPlan",
    "RobotKinematics",
    "SwivelCasters",
    "Tag",
    "Trajectory",
    "TrajectoryCourse",
    "TrajectoryFollower",
    "TrajectoryPlan",
    "Watchdog",
    "achievable_twist",
    "body_jacobian",
    "body_velocity",
    "classify",
    "expected_grip_wrench",
    "load_plan",
    "load_section",
    "load_trajectory",
    "plan_route",
    "sample_grasps",
]
