"""What is perceived, as control needs it."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.percept import Grip, Percept, Tag, holds_of, object_planar, plates_planar

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
TABLE = Tag(0.0, np.array([1.0, 0.2, 0.75]), np.array([0.0, 0.0, np.sin(0.15), np.cos(0.15)]))


@pytest.mark.parametrize("side", SIDES)
def test_plates_from_the_tag_are_those_of_the_kinematics(
    kinematics: RobotKinematics, push_posture: Posture, side: str
) -> None:
    gripper = kinematics.grippers(push_posture)[side]
    plates, height = plates_planar(side, Tag(0.0, gripper.pose.position, gripper.pose.quaternion()))
    np.testing.assert_allclose(plates, gripper.planar, atol=1e-3)
    assert height == pytest.approx(gripper.height, abs=2e-3)


def test_the_right_gripper_reaches_the_other_way() -> None:
    tag = Tag(0.0, np.zeros(3), LEVEL)
    np.testing.assert_allclose(plates_planar("left", tag)[0], [0.0, GRIP, np.pi / 2], atol=1e-12)
    np.testing.assert_allclose(plates_planar("right", tag)[0], [0.0, -GRIP, -np.pi / 2], atol=1e-12)


def test_a_hold_knows_how_the_object_lies_in_the_grip() -> None:
    tags = {"table": TABLE, "left_gripper": Tag(0.0, np.zeros(3), LEVEL)}
    percept = Percept(None, tags, {}, {"left": Grip("table", np.array([-0.3, 0.1]))})
    hold = holds_of(percept)["left"]
    assert hold.yaw == pytest.approx(0.3 - np.pi / 2)
    assert object_planar(TABLE)[2] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("tags", "side", "complaint"),
    [
        ({}, "left", "expected a tag of 'table'"),
        ({"table": TABLE}, "left", "expected a tag of 'left_gripper'"),
        ({"table": TABLE}, "middle", "expected gripper left or right"),
    ],
)
def test_a_hold_nobody_saw_is_refused(tags: dict, side: str, complaint: str) -> None:
    with pytest.raises(ControlError, match=complaint):
        holds_of(Percept(None, tags, {}, {side: Grip("table", np.zeros(2))}))
