"""Arm inverse kinematics: the twist is met, limits scale it, plates come level, singularities stay tame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_control.arm_ik import damped_inverse, fitting_scale, level_twist, solve_arm, velocity_bounds
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.settings import ArmSettings

SETTINGS = ArmSettings()


@pytest.mark.parametrize("side", SIDES)
def test_twist_is_met_far_from_singularities(kinematics: RobotKinematics, push_posture: Posture, side: str) -> None:
    gripper, limits = kinematics.grippers(push_posture)[side], kinematics.limits(side)
    joints = push_posture.arm(side)
    twist = np.array([0.03, -0.05, 0.02, 0.01, -0.02, 0.1])
    solution = solve_arm(gripper, joints, twist, 0.9 * joints, limits, SETTINGS)
    np.testing.assert_allclose(gripper.jacobian @ solution.velocity, twist, atol=1e-9)
    assert solution.scale == 1.0
    assert solution.singular > SETTINGS.singular_threshold


def test_a_fast_twist_keeps_its_direction(kinematics: RobotKinematics, push_posture: Posture) -> None:
    gripper, limits = kinematics.grippers(push_posture)["left"], kinematics.limits("left")
    twist = np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    solution = solve_arm(gripper, push_posture.left, twist, push_posture.left, limits, SETTINGS)
    low, high = velocity_bounds(push_posture.left, limits, SETTINGS)
    assert 0.0 < solution.scale < 0.5
    assert (solution.limited <= high + 1e-12).all()
    assert (solution.limited >= low - 1e-12).all()
    np.testing.assert_allclose(gripper.jacobian @ solution.limited, solution.scale * twist, atol=1e-9)


def test_velocities_stay_bounded_at_a_singularity(kinematics: RobotKinematics) -> None:
    stretched = Posture(2.6, 0.0)  # arms straight out: elbow and wrist singular
    gripper = kinematics.grippers(stretched)["left"]
    inverse, smallest = damped_inverse(gripper.jacobian, SETTINGS.singular_threshold, SETTINGS.damping)
    assert smallest < 1e-9
    assert np.abs(inverse).max() < 1.0 / SETTINGS.damping


def test_damping_is_the_plain_inverse_above_the_threshold(rng: np.random.Generator) -> None:
    jacobian = rng.normal(size=(6, 7))
    inverse, smallest = damped_inverse(jacobian, 1e-6, 0.1)
    assert smallest > 1e-6
    np.testing.assert_allclose(inverse, np.linalg.pinv(jacobian), atol=1e-8)


def test_a_joint_at_its_stop_only_moves_away(kinematics: RobotKinematics) -> None:
    limits = kinematics.limits("left")
    low, high = velocity_bounds(limits.upper.copy(), limits, SETTINGS)
    assert (high == 0.0).all()
    assert (low < 0.0).all()
    assert fitting_scale(np.full(7, 0.1), low, high) == 0.0
    assert fitting_scale(np.full(7, -0.1), low, high) == 1.0


@pytest.mark.parametrize("side", SIDES)
def test_tilted_plates_come_level_and_keep_their_place(
    kinematics: RobotKinematics, push_posture: Posture, side: str
) -> None:
    tilted = push_posture.arm(side) + np.array([0.03, 0.02, -0.05, 0.04, 0.06, -0.03, 0.08])
    posture = replace(push_posture, **{side: tilted})
    start = kinematics.grippers(posture)[side]
    for _ in range(300):
        gripper = kinematics.grippers(posture)[side]
        twist = level_twist(gripper, np.zeros(3), 0.0, SETTINGS)
        solution = solve_arm(gripper, posture.arm(side), twist, tilted, kinematics.limits(side), SETTINGS)
        posture = replace(posture, **{side: posture.arm(side) + 0.01 * solution.limited})
    end = kinematics.grippers(posture)[side]
    assert end.pose.rotation[2, 2] > 1.0 - 1e-6
    assert start.pose.rotation[2, 2] < 1.0 - 1e-4
    np.testing.assert_allclose([*end.planar[:2], end.height], [*start.planar[:2], start.height], atol=2e-3)
