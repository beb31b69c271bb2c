"""Compile what a tick needs before there is anything to control: a first tick must not take seconds."""

from __future__ import annotations

import numpy as np

from pbrl_control.controller import BodyController
from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS, SIDES, Posture, RobotKinematics
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import BodyState, Hold, PlanarTwist

PERIOD = 0.005
"""Of the ticks that nobody sees [s]."""


def compile_kernels(settings: ControllerSettings) -> None:
    """Have a robot that does not exist hold something; what was compiled before is read from disk."""
    controller = BodyController(RobotKinematics(_made_up_robot()), settings)
    state = BodyState(Posture(0.1, 0.1, np.full(7, 0.1), np.full(7, -0.1)))
    holds = {side: Hold("thing", np.zeros(2)) for side in SIDES}
    wrenches = {side: np.zeros(6) for side in SIDES}
    for _ in range(2):  # the first plans how to steer, the second goes on
        controller.tick(state, {"thing": PlanarTwist(0.01, 0.01, 0.01)}, holds, wrenches, PERIOD)


def _made_up_robot() -> str:
    """Return a URDF with the joints and frames that control needs, each joint 0.1 m from the one before."""
    parts, last = ['<robot name="made_up"><link name="base"/>'], "base"
    for name in BODY_JOINTS:
        parts.append(_joint(name, last))
        last = f"{name}_link"
    for side in SIDES:
        before = last
        for name in ARM_JOINTS[side]:
            parts.append(_joint(name, before))
            before = f"{name}_link"
        parts.append(f'<link name="{side}_ft"/><joint name="{side}_wrist" type="fixed">')
        parts.append(f'<parent link="{before}"/><child link="{side}_ft"/></joint>')
    return "".join([*parts, "</robot>"])


def _joint(name: str, parent: str) -> str:
    return (
        f'<link name="{name}_link"/><joint name="{name}" type="revolute"><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>'
        f'<parent link="{parent}"/><child link="{name}_link"/><limit lower="-2" upper="2" velocity="1" effort="1"/>'
        "</joint>"
    )
