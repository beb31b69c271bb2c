"""Force compliance: which way it yields, what it forgets, what it ignores."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.admittance import FASTEST, HeldGrip, WrenchBias, axis_law, compliance_laws, grip_wrench
from pbrl_control.admittance_kernel import axis_velocity
from pbrl_control.kinematics import APPROACH, GRIP, SIDES, GripperState, Posture, RobotKinematics
from pbrl_control.planar import cross, rotation, shift, turn
from pbrl_control.settings import ComplianceAxis, ComplianceSettings, ControllerSettings
from pbrl_control.types import Hold, PlanarTwist
from pbrl_control.whole_body.task import levelling

SETTINGS = ComplianceSettings()
FAST = 10.0
"""More than any of these moves."""


class Axis:
    """One axis by itself: its law and what it remembers."""

    def __init__(self, settings: ComplianceAxis, most: float = FAST) -> None:
        self.law, self.memory = axis_law(settings, most), np.zeros(2)

    def step(self, force: float, dt: float) -> float:
        return axis_velocity(self.law, self.memory, force, dt)


def yielded(forces: np.ndarray, ticks: int = 1) -> np.ndarray:
    """Return the velocities (4,) of the soft axes after some ticks of steady forces (4,)."""
    laws, memory = compliance_laws(SETTINGS)[0], np.zeros((4, 2))
    for _ in range(ticks):
        out = [axis_velocity(laws[k], memory[k], float(forces[k]), 0.01) for k in range(4)]
    return np.array(out)


@pytest.mark.parametrize("axis", range(4))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pushed_back_it_yields(axis: int, sign: float) -> None:
    wrench = np.zeros(4)
    wrench[axis] = sign * 20.0
    velocity = yielded(wrench)
    assert velocity[axis] * sign > 0.0
    assert not np.delete(velocity, axis).any()


def test_it_comes_back_to_where_it_was() -> None:
    axis, x = Axis(ComplianceAxis(damping=750.0, centring=1.0)), 0.0
    for k in range(2000):
        x += 0.01 * axis.step(30.0 if k < 300 else 0.0, 0.01)
        if k == 299:
            assert x > 0.03
    assert abs(x) < 1e-4


def test_what_is_forgotten_is_not_come_back_from() -> None:
    axis, x = Axis(ComplianceAxis(damping=750.0, centring=0.5, forget=1.0)), 0.0
    for k in range(3000):
        x += 0.01 * axis.step(30.0 if k < 1000 else 0.0, 0.01)
    given = 30.0 / 750.0 * 10.0 / 1.5  # steady speed F / (damping (1 + centring forget))
    assert x == pytest.approx(given, rel=0.1)


def test_a_steady_force_ends_where_its_stiffness_says() -> None:
    axis, x = Axis(ComplianceAxis(damping=750.0, centring=1.0)), 0.0
    for _ in range(2000):
        x += 0.01 * axis.step(30.0, 0.01)
    assert x == pytest.approx(30.0 / 750.0, rel=1e-3)


def test_the_slow_part_softens_steady_forces_by_its_factor() -> None:
    settings = ComplianceAxis(damping=500.0, yielding=0.25, leak=1.0)
    axis = Axis(settings)
    first = axis.step(10.0, 0.001)
    for _ in range(20000):
        last = axis.step(10.0, 0.001)
    assert first == pytest.approx(10.0 / 500.0, rel=0.01)
    assert last == pytest.approx(first * (1.0 + 1.0 / 0.25), rel=0.02)


def test_lateral_gives_way_more_than_longitudinal() -> None:
    along, left, _, _ = yielded(np.array([10.0, 10.0, 0.0, 0.0]), 300)
    assert left > 5.0 * along > 0.0


def test_what_compliance_adds_is_bounded() -> None:
    along, left, about, up = yielded(np.full(4, 1e9))
    assert np.abs([along, left, up]).max() <= SETTINGS.speed
    assert abs(about) <= SETTINGS.yaw_rate


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


class PlainGrip:
    """What `HeldGrip` does, formula by formula, with the vectors of `planar`."""

    def __init__(self, side: str, settings: ControllerSettings, gripper: GripperState) -> None:
        compliance = settings.compliance
        self.side, self.settings, self.height, self.share = side, settings, gripper.height, 1.0
        along, up = compliance.longitudinal, compliance.vertical
        self.axes = {
            False: (along, compliance.lateral, compliance.yaw, up),
            True: (along, compliance.firm_lateral, compliance.firm_yaw, up),
        }
        self.slow, self.given = ({firm: np.zeros(4) for firm in self.axes} for _ in range(2))

    def task(self, gripper: GripperState, twist: PlanarTwist, hold: Hold, felt: np.ndarray, dt: float) -> tuple:
        yaw, rotation, arm = gripper.planar[2], gripper.pose.rotation, self.settings.arm
        force = rotation @ felt[:3]
        torque = rotation @ felt[3:] - cross(GRIP * rotation @ APPROACH[self.side], force)
        wrench = np.append(turn(np.array([force[0], force[1], torque[2]]), -yaw), force[2])
        beyond = np.hypot(*force[:2]) / self.settings.program.grip_force - 1.0
        rate = -self.settings.program.grip_slow * beyond if beyond > 0.0 else self.settings.program.grip_resume
        self.share = min(max(self.share + rate * dt, 0.0), 1.0)
        firm = hold.expected is not None
        wrench[:3] += turn(hold.expected, hold.yaw) if firm else 0.0
        way = [self.axis(firm, k, float(wrench[k]), dt) for k in range(4)]
        vx, vy, omega = turn(np.array(way[:3]), yaw)
        lift = way[3] + arm.height_gain * (self.height - gripper.height)
        wanted = turn(shift(twist.array(), hold.contact), yaw + hold.yaw)
        added = np.array([vx, vy, lift, *levelling(gripper, arm.level_gain), omega])
        return wanted, added, -force[:2] / np.hypot(*force[:2]), FASTEST * self.share

    def axis(self, firm: bool, k: int, force: float, dt: float) -> float:
        axis, slow, given = self.axes[firm][k], self.slow[firm], self.given[firm]
        most = self.settings.compliance.yaw_rate if k == 2 else self.settings.compliance.speed
        fast = np.sign(force) * max(abs(force) - axis.dead_band, 0.0) / axis.damping
        if axis.yielding is not None:
            slow[k] += dt * (fast / axis.yielding - slow[k] / axis.leak)
        velocity = float(np.clip(fast + slow[k] - axis.centring * given[k], -most, most))
        given[k] += dt * velocity
        if axis.forget is not None:
            given[k] -= dt * (given[k] - dt * velocity) / axis.forget
        return velocity


@pytest.mark.parametrize("side", SIDES)
def test_the_compiled_grip_is_the_plain_formula(
    kinematics: RobotKinematics, draw_posture, rng: np.random.Generator, side: str
) -> None:
    settings, gripper = ControllerSettings(), kinematics.grippers(draw_posture())[side]
    fast, plain = HeldGrip(side, "table", settings, gripper), PlainGrip(side, settings, gripper)
    bias = rng.normal(size=6)
    for k in range(200):
        gripper = kinematics.grippers(draw_posture())[side]
        expected = 20.0 * rng.normal(size=3) if k % 3 else None
        hold = Hold("table", rng.normal(size=2), rng.normal(), expected)
        twist, felt = PlanarTwist(*rng.normal(size=3)), rng.normal(size=6) * rng.choice([3.0, 30.0, 300.0])
        task = fast.task(gripper, twist, hold, felt + bias, bias, 0.01)
        for ours, theirs in zip(
            (task.wanted, task.added, task.against, task.room),
            plain.task(gripper, twist, hold, felt, 0.01),
            strict=True,
        ):
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)


def test_a_sensor_that_says_no_number_is_not_felt(kinematics: RobotKinematics, push_posture: Posture) -> None:
    gripper, still = kinematics.grippers(push_posture)["left"], PlanarTwist()
    grip = HeldGrip("left", "table", ControllerSettings(), gripper)
    broken = np.array([100.0, 0.0, np.nan, 0.0, 0.0, np.inf])
    task = grip.task(gripper, still, Hold("table", np.zeros(2)), broken, np.ones(6), 0.01)
    assert not task.against.any()
    np.testing.assert_allclose(task.added[[0, 1, 2, 5]], 0.0, atol=1e-15)
