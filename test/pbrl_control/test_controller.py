"""The body controller: limits whatever comes, rest when in doubt, and the object moves as asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_control.controller import BodyController
from pbrl_control.kinematics import APPROACH, GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.planar import rotation
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import BodyCommand, BodyState, Hold, PlanarTwist

DT = 0.01
SETTINGS = ControllerSettings()
HELD = {"left": Hold("table", np.array([-0.355, 0.40]), 0.1)}
QUIET = {side: np.zeros(6) for side in SIDES}


@pytest.fixture
def controller(kinematics: RobotKinematics) -> BodyController:
    return BodyController(kinematics, SETTINGS)


def integrate(posture: Posture, command: BodyCommand, dt: float = DT) -> Posture:
    return replace(posture, **{side: posture.arm(side) + dt * command.arm(side) for side in SIDES})


def settle(controller: BodyController, posture: Posture, twists: dict, holds: dict, ticks: int = 300) -> tuple:
    for _ in range(ticks):
        command = controller.tick(BodyState(posture), twists, holds, QUIET, DT)
        posture = integrate(posture, command)
    return command, posture


def world_twist(kinematics: RobotKinematics, posture: Posture, command: BodyCommand, side: str) -> np.ndarray:
    """Return the planar twist (3,) of a gripper over the floor, in base axes."""
    gripper = kinematics.grippers(posture)[side]
    arm = gripper.jacobian @ command.arm(side)
    x, y = gripper.planar[:2]
    v, w = command.base_v, command.base_w
    return np.array([arm[0] + v - w * y, arm[1] + w * x, arm[5] + w])


def test_a_held_object_moves_as_asked(kinematics: RobotKinematics, controller: BodyController) -> None:
    nominal = np.array(SETTINGS.nominal)
    start = Posture(2.732, 0.0, nominal, -nominal)
    command, posture = settle(controller, start, {"table": PlanarTwist(0.06, -0.02, 0.03)}, HELD, 100)
    moved = world_twist(kinematics, posture, command, "left")
    yaw = kinematics.grippers(posture)["left"].planar[2] + HELD["left"].yaw
    contact = HELD["left"].contact
    wanted = rotation(yaw) @ [0.06 - 0.03 * contact[1], -0.02 + 0.03 * contact[0]]
    np.testing.assert_allclose(moved[2], 0.03, atol=2e-3)
    np.testing.assert_allclose(moved[:2], wanted, atol=5e-3)


def test_the_base_does_what_it_can(controller: BodyController, push_posture: Posture) -> None:
    command, _ = settle(controller, push_posture, {"left_ft": PlanarTwist(vx=0.1)}, {}, 400)
    assert command.base_v == pytest.approx(0.1, abs=0.02)


def test_force_from_the_object_is_yielded_to(
    kinematics: RobotKinematics, controller: BodyController, push_posture: Posture
) -> None:
    weight = np.array([0.3, -0.2, -17.3, 1.5, 0.0, 0.0])  # gripper weight and bias
    for _ in range(100):
        controller.tick(BodyState(push_posture), {"left_ft": PlanarTwist()}, {}, {"left": weight}, DT)
    rest, posture = BodyCommand(), push_posture
    gripper = kinematics.grippers(push_posture)["left"]
    for force in (np.zeros(3), np.array([0.0, 40.0, 0.0])):  # on the plates, to the left, base axes
        felt = weight.copy()
        felt[:3] += gripper.pose.rotation.T @ force
        felt[3:] += gripper.pose.rotation.T @ np.cross(gripper.pose.rotation @ APPROACH["left"] * GRIP, force)
        for _ in range(20):
            rest = controller.tick(BodyState(posture), {"table": PlanarTwist()}, HELD, {"left": felt}, DT)
        moved = world_twist(kinematics, posture, rest, "left")
        if not force.any():
            np.testing.assert_allclose(moved, 0.0, atol=0.01)
    assert moved[1] > 0.02


def test_what_was_expected_is_not_yielded_to(kinematics: RobotKinematics, push_posture: Posture) -> None:
    gripper = kinematics.grippers(push_posture)["left"]
    on_object = np.array([12.0, -20.0, 0.0])  # what the grip has to apply, object axes
    yaw = gripper.planar[2] + HELD["left"].yaw
    felt = -np.array([*(rotation(yaw) @ on_object[:2]), 0.0])
    lever = gripper.pose.rotation @ APPROACH["left"] * GRIP
    raw = np.concatenate([gripper.pose.rotation.T @ felt, gripper.pose.rotation.T @ np.cross(lever, felt)])
    rest = {}
    for name, expected in (("known", on_object), ("unknown", None)):
        fresh = BodyController(kinematics, SETTINGS)
        holds = {"left": replace(HELD["left"], expected=expected)}
        for _ in range(40):
            rest[name] = fresh.tick(BodyState(push_posture), {"table": PlanarTwist()}, holds, {"left": raw}, DT)
    moved = {name: world_twist(kinematics, push_posture, rest[name], "left") for name in rest}
    assert np.abs(moved["known"]).max() < 2e-3
    assert np.abs(moved["unknown"][:2]).max() > 0.01


def test_nothing_asked_is_rest(controller: BodyController, push_posture: Posture) -> None:
    settle(controller, push_posture, {"table": PlanarTwist(0.2)}, HELD, 50)
    command = controller.tick(BodyState(push_posture), {}, HELD, QUIET, DT)
    assert at_rest(command)
    assert command.report == ""


def at_rest(command: BodyCommand) -> bool:
    return not (command.base_v or command.base_w or command.left.any() or command.right.any())


GO = {"table": PlanarTwist(0.1)}
ODD = {
    "NaN twist": ({"table": PlanarTwist(float("nan"))}, HELD, DT, "twist for 'table': expected numbers"),
    "infinite twist": ({"table": PlanarTwist(omega=float("inf"))}, HELD, DT, "expected numbers"),
    "not held": ({"chair": PlanarTwist(0.1)}, HELD, DT, "'chair': expected something held"),
    "other than held": ({"right_ft": PlanarTwist(0.1)}, HELD, DT, "expected one for the held 'table'"),
    "NaN contact": (GO, {"left": Hold("table", np.array([np.nan, 0.0]))}, DT, "grasp: expected finite"),
    "NaN expected": (GO, {"left": replace(HELD["left"], expected=np.full(3, np.nan))}, DT, "grasp: expected finite"),
    "no period": (GO, HELD, 0.0, "control period"),
    "back in time": (GO, HELD, -0.01, "control period"),
    "late tick": (GO, HELD, 3.0, "control period"),
    "NaN period": (GO, HELD, float("nan"), "control period"),
}


@pytest.mark.parametrize("case", ODD)
def test_what_cannot_be_trusted_is_rest_and_reported(
    controller: BodyController, push_posture: Posture, case: str
) -> None:
    twists, holds, dt, report = ODD[case]
    settle(controller, push_posture, {"table": PlanarTwist(0.2)}, HELD, 50)
    command = controller.tick(BodyState(push_posture), twists, holds, QUIET, dt)
    assert at_rest(command)
    assert report in command.report
    assert "\n" not in command.report


def test_joints_that_are_no_numbers_are_rest_and_reported(controller: BodyController, push_posture: Posture) -> None:
    lost = replace(push_posture, left=np.full(7, np.nan))
    command = controller.tick(BodyState(lost), GO, HELD, QUIET, DT)
    assert at_rest(command)
    assert "joint positions" in command.report


def random_inputs(rng: np.random.Generator) -> tuple[dict, dict, dict, float]:
    """Draw what a hostile world sends: steps, huge values, NaN, dropped and late commands, broken sensors."""
    odd = [0.0, 1e-3, 0.3, -0.3, 5.0, -1e6, np.nan, np.inf]
    value = lambda: float(rng.choice(odd, p=[0.1, 0.1, 0.3, 0.3, 0.1, 0.06, 0.02, 0.02]))  # noqa: E731
    twist = PlanarTwist(value(), value(), value(), value())
    holds = {side: Hold("table", rng.normal(size=2), rng.normal()) for side in SIDES if rng.random() < 0.5}
    targets = ["table"] if holds else ["left_ft", "right_ft", "base"]
    twists = {} if rng.random() < 0.1 else {target: twist for target in targets if holds or rng.random() < 0.6}
    wrenches = {side: rng.normal(size=6) * 10.0 ** rng.integers(-1, 6) for side in SIDES if rng.random() < 0.9}
    if rng.random() < 0.05:
        wrenches["left"] = np.full(6, np.nan)
    return twists, holds, wrenches, float(rng.choice([0.002, 0.005, 0.01, 0.02, 0.09]))


def test_limits_hold_under_random_commands(
    kinematics: RobotKinematics, controller: BodyController, push_posture: Posture, rng: np.random.Generator
) -> None:
    posture, base, arms = push_posture, np.zeros(2), {side: np.zeros(7) for side in SIDES}
    settings, command = SETTINGS, BodyCommand()
    for _ in range(150):
        inputs = random_inputs(rng)
        for _ in range(rng.integers(1, 30)):
            twists, holds, wrenches, dt = inputs
            posture = integrate(posture, command, dt)  # what was sent lasted until now
            for side in SIDES:
                limits = kinematics.limits(side)
                assert (posture.arm(side) <= limits.upper).all()
                assert (posture.arm(side) >= limits.lower).all()
            command = controller.tick(BodyState(posture), twists, holds, wrenches, dt)
            now = np.array([command.base_v, command.base_w])
            assert np.isfinite(now).all()
            assert (np.abs(now) <= [settings.base.speed, settings.base.yaw_rate]).all()
            stopped = not now.any()
            bound = np.array([settings.base.acceleration, settings.base.yaw_acceleration]) * dt + 1e-12
            assert stopped or (np.abs(now - base) <= bound).all()
            for side in SIDES:
                limits, velocity = kinematics.limits(side), command.arm(side)
                assert np.isfinite(velocity).all()
                assert (np.abs(velocity) <= limits.velocity).all()
                change = np.abs(velocity - arms[side]).max()
                assert not velocity.any() or change <= settings.arm.acceleration * dt + 1e-9
                arms[side] = velocity
            base = now


def test_an_idle_arm_goes_to_its_stowed_posture(
    kinematics: RobotKinematics, controller: BodyController, push_posture: Posture
) -> None:
    _, posture = settle(controller, push_posture, {"left_ft": PlanarTwist()}, {}, 800)
    np.testing.assert_allclose(posture.right, -np.array(SETTINGS.stowed), atol=0.01)
    assert kinematics.grippers(posture)["right"].height > 1.0


def test_the_base_is_driven_alone(controller: BodyController, push_posture: Posture) -> None:
    command, posture = settle(controller, push_posture, {"base": PlanarTwist(0.15, 0.0, 0.1)}, {}, 100)
    assert (command.base_v, command.base_w) == pytest.approx((0.15, 0.1))
    np.testing.assert_array_equal(posture.left, push_posture.left)
