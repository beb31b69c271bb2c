"""Compile what a tick needs before there is anything to control: a first tick must not take seconds."""

from __future__ import annotations

import numpy as np

from pbrl_control.kinematics import SIDES, FramePose, GripperState, JointLimits
from pbrl_control.limits import BodyGate
from pbrl_control.settings import ControllerSettings
from pbrl_control.whole_body.program import WholeBodyProgram
from pbrl_control.whole_body.steering import steering_of
from pbrl_control.whole_body.task import Task


def compile_kernels(settings: ControllerSettings) -> None:
    """Run each compiled part once, on a robot that does not exist; what was compiled before is read from disk."""
    limits = JointLimits(np.full(7, -1.0), np.full(7, 1.0), np.ones(7))
    gripper = GripperState(FramePose(np.zeros(3), np.eye(3)), np.array([0.7, 0.0, 0.0]), 0.7, np.eye(6, 7))
    low, high = BodyGate(settings.base, settings.arm, dict.fromkeys(SIDES, limits)).range(np.zeros(14), 0.01)
    task = Task(np.full(3, 0.01), 0.0, np.zeros(6))
    grippers, tasks = dict.fromkeys(SIDES, gripper), dict.fromkeys(SIDES, task)
    WholeBodyProgram(settings).solve(grippers, tasks, np.zeros(2), np.zeros(14), low, high)
    steering_of(settings.base).wish(gripper.planar, task.wanted, gripper.planar)
