"""Whole-body Jacobian control of what the robot holds, and the pushes it is used for."""

from pbrl_control.body_jacobian import body_jacobian, body_velocity
from pbrl_control.controller import BodyController
from pbrl_control.errors import ControlError
from pbrl_control.kinematics import Posture, RobotKinematics
from pbrl_control.loop import ControlLoop, LoopCommand
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, GripperRequest, Phase, PushCommand, PushExecutive
from pbrl_control.push_plan import PushPlan, load_plan
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.types import BodyCommand, BodyState, Hold, PlanarTwist
from pbrl_control.watchdog import Watchdog

__all__ = [
    "BodyCommand",
    "BodyController",
    "BodyShape",
    "BodyState",
    "ControlError",
    "ControlLoop",
    "ControllerSettings",
    "Grip",
    "GripperAnswer",
    "GripperRequest",
    "Hold",
    "LoopCommand",
    "Percept",
    "Phase",
    "PlanarTwist",
    "Posture",
    "PushCommand",
    "PushExecutive",
    "PushPlan",
    "RobotKinematics",
    "Tag",
    "Watchdog",
    "body_jacobian",
    "body_velocity",
    "load_plan",
    "load_section",
]
