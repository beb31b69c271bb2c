"""Forward kinematics against the robot's test vectors, Jacobians against finite differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import APPROACH, ARM_JOINTS, BODY_JOINTS, GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.planar import wrap

K2 = [1.0091, -1.0637, -0.0389, -1.8836, 0.2605, 1.2431, -0.0465]
K3 = [1.0668, -1.1286, -0.0096, -2.0422, 0.1238, 1.4877, -0.0624]
K4 = ([1.4, -1.0, 0.2, -0.8, 0.3, -0.8, 0.5], [-1.102, 0.589, 0.0, 1.339, 0.141, 0.959, -1.0])
ZERO = [0.0] * 7
# waist, torso, left, right; then for each side: xyz and quaternion x y z w of `<side>_ft`, xyz of the tip.
VECTORS = {
    "K0": (
        (0.0, 0.0, ZERO, ZERO),
        ((-1.1315, 1.0878, -0.0153), (0, -0.7833, 0, 0.6216), (-1.1315, 1.3048, -0.0153)),
        ((-1.1315, -1.0858, -0.0153), (0, -0.7833, 0, 0.6216), (-1.1315, -1.3028, -0.0153)),
    ),
    "K1": (
        (2.532, 0.0, ZERO, ZERO),
        ((-0.1418, 1.0878, 0.8111), (0, 0.3579, 0, 0.9338), (-0.1418, 1.3048, 0.8111)),
        ((-0.1418, -1.0858, 0.8111), (0, 0.3579, 0, 0.9338), (-0.1418, -1.3028, 0.8111)),
    ),
    "K2": (
        (2.532, 0.0, K2, [-q for q in K2]),
        ((0.3864, 0.1454, 0.8953), (0.0129, 0.0081, -0.7517, 0.6593), (0.6015, 0.1170, 0.8963)),
        ((0.3864, -0.1434, 0.8953), (-0.0129, 0.0081, 0.7517, 0.6593), (0.6015, -0.1150, 0.8963)),
    ),
    "K3": (
        (2.732, 0.0, K3, [-q for q in K3]),
        ((0.4488, 0.1251, 0.7648), (0.0299, 0.0230, -0.7446, 0.6664), (0.6645, 0.1011, 0.7660)),
        ((0.4488, -0.1231, 0.7648), (-0.0299, 0.0230, 0.7446, 0.6664), (0.6645, -0.0991, 0.7660)),
    ),
    "K4": (
        (2.400, 0.300, *K4),
        ((0.2010, 0.2380, 1.3563), (-0.0518, 0.4178, 0.9059, 0.0448), (0.1740, 0.0976, 1.5196)),
        ((0.1488, -0.3252, 1.1214), (0.1932, 0.0151, 0.9429, 0.2708), (0.2584, -0.1401, 1.0925)),
    ),
}


@pytest.mark.parametrize("name", VECTORS)
def test_grippers_are_where_the_test_vectors_say(kinematics: RobotKinematics, name: str) -> None:
    (waist, torso, left, right), *expected = VECTORS[name]
    posture = Posture(waist, torso, np.array(left), np.array(right))
    for side, (position, quaternion, tip) in zip(SIDES, expected, strict=True):
        pose = kinematics.frame(posture, f"{side}_ft")
        np.testing.assert_allclose(pose.position, position, atol=1e-3)
        wanted = np.array(quaternion) / np.linalg.norm(quaternion)
        angle = 2.0 * np.arccos(min(1.0, abs(float(pose.quaternion() @ wanted))))
        assert angle < 1e-3
        np.testing.assert_allclose(kinematics.tip(posture, side), tip, atol=1e-3)


def step(posture: Posture, side: str, joint: int, by: float) -> Posture:
    arm = posture.arm(side).copy()
    arm[joint] += by
    return replace(posture, **{side: arm})


def test_gripper_jacobian_is_the_derivative_of_forward_kinematics(kinematics: RobotKinematics, draw_posture) -> None:
    h = 1e-6
    for _ in range(100):
        posture = draw_posture()
        grippers = kinematics.grippers(posture)
        for side in SIDES:
            columns = []
            for joint in range(7):
                ahead, behind = (kinematics.frame(step(posture, side, joint, by), f"{side}_ft") for by in (h, -h))
                middles = [pose.position + GRIP * pose.rotation @ APPROACH[side] for pose in (ahead, behind)]
                turned = (ahead.rotation - behind.rotation) / (2 * h) @ grippers[side].pose.rotation.T
                columns.append([*(middles[0] - middles[1]) / (2 * h), turned[2, 1], turned[0, 2], turned[1, 0]])
            np.testing.assert_allclose(grippers[side].jacobian, np.array(columns).T, atol=1e-6)


def test_planar_pose_of_mirrored_arms_is_mirrored(kinematics: RobotKinematics, push_posture: Posture) -> None:
    grippers = kinematics.grippers(push_posture)
    left, right = grippers["left"], grippers["right"]
    np.testing.assert_allclose(left.planar * [1, -1, -1], right.planar, atol=3e-3)  # 1 mm off: the URDF's own
    assert left.height == pytest.approx(0.7657, abs=1e-3)
    assert abs(wrap(left.planar[2] + 0.111)) < 2e-3


def test_a_joint_state_without_a_joint_is_refused_by_name() -> None:
    names = [*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"]]
    assert Posture.from_joint_states([*names, "lwheel"], [0.1] * 17).left[6] == 0.1
    with pytest.raises(ControlError, match="RJ7 missing"):
        Posture.from_joint_states(names[:-1], [0.0] * 15)


def test_a_description_that_is_not_one_is_refused(tmp_path: Path, root: Path) -> None:
    with pytest.raises(ControlError, match="expected URDF text"):
        RobotKinematics("not a robot")
    with pytest.raises(ControlError, match="readable URDF file"):
        RobotKinematics.from_file(tmp_path / "none.urdf")
    text = (root / "urdf/krang/krang.urdf").read_text()
    with pytest.raises(ControlError, match="frame 'left_ft'"):
        RobotKinematics(text.replace("left_ft", "left_wrist"))
    with pytest.raises(ControlError, match="joint 'LJ3'"):
        RobotKinematics(text.replace('"LJ3"', '"left_elbow"'))
