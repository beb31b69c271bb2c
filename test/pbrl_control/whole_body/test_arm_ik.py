"""One arm by damped least squares: the twist is met, limits scale it, singularities stay tame."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.settings import PseudoInverseSettings
from pbrl_control.whole_body.arm_ik import damped_inverse, fitting_scale, solve_arm

SETTINGS = PseudoInverseSettings()
DAMPED = {"threshold": SETTINGS.singular_threshold, "damping": SETTINGS.damping}
FAST = np.full(7, 0.4)


@pytest.mark.parametrize("side", SIDES)
def test_twist_is_met_far_from_singularities(kinematics: RobotKinematics, push_posture: Posture, side: str) -> None:
    jacobian = kinematics.grippers(push_posture)[side].jacobian
    twist = np.array([0.03, -0.05, 0.02, 0.01, -0.02, 0.1])
    solution = solve_arm(jacobian, twist, -0.05 * push_posture.arm(side), -FAST, FAST, **DAMPED)
    np.testing.assert_allclose(jacobian @ solution.velocity, twist, atol=1e-9)
    assert solution.scale == 1.0
    assert solution.singular > SETTINGS.singular_threshold


def test_a_fast_twist_keeps_its_direction(kinematics: RobotKinematics, push_posture: Posture) -> None:
    jacobian = kinematics.grippers(push_posture)["left"].jacobian
    twist = np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    solution = solve_arm(jacobian, twist, np.zeros(7), -FAST, FAST, **DAMPED)
    assert 0.0 < solution.scale < 0.5
    assert np.abs(solution.limited).max() <= FAST[0] + 1e-12
    np.testing.assert_allclose(jacobian @ solution.limited, solution.scale * twist, atol=1e-9)


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


def test_what_is_at_its_bound_only_moves_away() -> None:
    low, high = np.full(7, -0.3), np.zeros(7)
    assert fitting_scale(np.full(7, 0.1), low, high) == 0.0
    assert fitting_scale(np.full(7, -0.1), low, high) == 1.0
