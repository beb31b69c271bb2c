"""Force compliance: which way it yields, what it forgets, what it ignores."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.admittance import Admittance, AxisCompliance, WrenchBias, grip_wrench
from pbrl_control.kinematics import APPROACH, GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.planar import rotation
from pbrl_control.settings import ComplianceAxis, ComplianceSettings

SETTINGS = ComplianceSettings()
FAST = 10.0
"""More than any of these moves."""


@pytest.mark.parametrize("axis", range(4))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pushed_back_it_yields(axis: int, sign: float) -> None:
    wrench = np.zeros(4)
    wrench[axis] = sign * 20.0
    twist, lift = Admittance(SETTINGS, np.zeros(3), 0.7).step(wrench, 0.01)
    velocity = np.append(twist, lift)
    assert velocity[axis] * sign > 0.0
    assert not np.delete(velocity, axis).any()


def test_it_comes_back_to_where_it_was() -> None:
    axis, x = AxisCompliance(ComplianceAxis(damping=750.0, centring=1.0), FAST), 0.0
    for k in range(2000):
        x += 0.01 * axis.step(30.0 if k < 300 else 0.0, 0.01)
        if k == 299:
            assert x > 0.03
    assert abs(x) < 1e-4


def test_what_is_forgotten_is_not_come_back_from() -> None:
    axis, x = AxisCompliance(ComplianceAxis(damping=750.0, centring=0.5, forget=1.0), FAST), 0.0
    for k in range(3000):
        x += 0.01 * axis.step(30.0 if k < 1000 else 0.0, 0.01)
    given = 30.0 / 750.0 * 10.0 / 1.5  # steady speed F / (damping (1 + centring forget))
    assert x == pytest.approx(given, rel=0.1)


def test_a_steady_force_ends_where_its_stiffness_says() -> None:
    axis, x = AxisCompliance(ComplianceAxis(damping=750.0, centring=1.0), FAST), 0.0
    for _ in range(2000):
        x += 0.01 * axis.step(30.0, 0.01)
    assert x == pytest.approx(30.0 / 750.0, rel=1e-3)


def test_the_slow_part_softens_steady_forces_by_its_factor() -> None:
    settings = ComplianceAxis(damping=500.0, yielding=0.25, leak=1.0)
    axis = AxisCompliance(settings, FAST)
    first = axis.step(10.0, 0.001)
    for _ in range(20000):
        last = axis.step(10.0, 0.001)
    assert first == pytest.approx(10.0 / 500.0, rel=0.01)
    assert last == pytest.approx(first * (1.0 + 1.0 / 0.25), rel=0.02)


def test_lateral_gives_way_more_than_longitudinal() -> None:
    admittance = Admittance(SETTINGS, np.zeros(3), 0.7)
    for _ in range(300):
        twist, _ = admittance.step(np.array([10.0, 10.0, 0.0, 0.0]), 0.01)
    assert twist[1] > 5.0 * twist[0] > 0.0


def test_what_compliance_adds_is_bounded() -> None:
    twist, lift = Admittance(SETTINGS, np.zeros(3), 0.7).step(np.full(4, 1e9), 0.01)
    assert np.abs([*twist[:2], lift]).max() <= SETTINGS.speed
    assert abs(twist[2]) <= SETTINGS.yaw_rate


def test_bias_is_what_was_felt_before(rng: np.random.Generator) -> None:
    bias, truth = WrenchBias(0.3), np.array([1.0, -2.0, -17.0, 0.1, 1.6, 0.0])
    for _ in range(300):
        bias.update(truth + 0.1 * rng.normal(size=6), 0.01)
    bias.update(np.full(6, np.nan), 0.01)
    np.testing.assert_allclose(bias.remove(truth + np.array([10, 0, 0, 0, 0, 1])), [10, 0, 0, 0, 0, 1], atol=0.1)
    assert not bias.remove(np.full(6, np.inf)).any()


@pytest.mark.parametrize("side", SIDES)
def test_grip_wrench_undoes_the_sensor(kinematics: RobotKinematics, push_posture: Posture, side: str) -> None:
    gripper = kinematics.grippers(push_posture)[side]
    along, left, tau, up = 12.0, -7.0, 1.5, 3.0
    force = np.array([*(rotation(gripper.planar[2]) @ [along, left]), up])
    lever = gripper.pose.rotation @ APPROACH[side] * GRIP
    torque = np.array([0.0, 0.0, tau]) + np.cross(lever, force)
    at_sensor = np.concatenate((gripper.pose.rotation.T @ force, gripper.pose.rotation.T @ torque))
    np.testing.assert_allclose(grip_wrench(side, gripper, at_sensor), [along, left, tau, up], atol=1e-9)
