"""The whole-body program: tasks are met where limits leave room, slowed where not, and nothing passes a bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.limits import BodyGate
from pbrl_control.settings import ControllerSettings
from pbrl_control.whole_body.program import Solution, WholeBodyProgram
from pbrl_control.whole_body.pseudo_inverse import PseudoInverse
from pbrl_control.whole_body.task import Task

SETTINGS = ControllerSettings()
STILL = np.zeros(6)
NOMINAL = np.array(SETTINGS.nominal)
MIDDLE = Posture(2.732, 0.0, NOMINAL, -NOMINAL)
WIDE = np.full(16, 5.0)


def over_floor(kinematics: RobotKinematics, posture: Posture, velocity: np.ndarray, side: str) -> np.ndarray:
    """Return the twist (6,) of a gripper over the floor, in base axes."""
    gripper, k = kinematics.grippers(posture)[side], SIDES.index(side)
    twist = gripper.jacobian @ velocity[2 + 7 * k : 9 + 7 * k]
    (v, w), (x, y) = velocity[:2], gripper.planar[:2]
    return twist + np.array([v - w * y, w * x, 0.0, 0.0, 0.0, w])


def solve(kinematics: RobotKinematics, tasks: dict[str, Task], **kwargs) -> Solution:
    wishes = {"base_wish": np.zeros(2), "arm_wish": np.zeros(14), "low": -WIDE, "high": WIDE, **kwargs}
    posture = wishes.pop("posture", MIDDLE)
    found = WholeBodyProgram(SETTINGS).solve(kinematics.grippers(posture), tasks, **wishes)
    assert found is not None
    return found


def test_far_from_limits_both_grippers_move_as_asked(kinematics: RobotKinematics, rng: np.random.Generator) -> None:
    for _ in range(20):
        tasks = {side: Task(0.1 * rng.normal(size=3), 0.02, 0.02 * rng.normal(size=6)) for side in SIDES}
        found = solve(kinematics, tasks, base_wish=0.1 * rng.normal(size=2), arm_wish=0.05 * rng.normal(size=14))
        assert found.share > 0.95
        for side in SIDES:
            twist = over_floor(kinematics, MIDDLE, found.velocity, side)
            task = replace(tasks[side], wanted=found.share * tasks[side].wanted, lift=found.share * tasks[side].lift)
            np.testing.assert_allclose(twist, task.twist, atol=5e-4)


def test_the_base_goes_where_steering_would(kinematics: RobotKinematics) -> None:
    wish = np.array([0.11, -0.07])
    found = solve(kinematics, {"left": Task(np.array([0.05, 0.02, 0.1]), 0.0, STILL)}, base_wish=wish)
    np.testing.assert_allclose(found.velocity[:2], wish, atol=2e-3)


def test_at_a_limit_the_object_goes_slower_and_not_elsewhere(kinematics: RobotKinematics) -> None:
    asked = np.array([0.0, 1.5, 0.0])
    high = np.concatenate(([0.0, 0.0], np.full(14, 0.4)))
    found = solve(kinematics, {"left": Task(asked, 0.0, STILL)}, low=-high, high=high)
    twist = over_floor(kinematics, MIDDLE, found.velocity, "left")
    assert 0.05 < found.share < 0.5
    assert (np.abs(found.velocity) <= high + 1e-9).all()
    off = np.delete(twist, 1)
    assert np.abs(off).max() < 0.05 * twist[1]


def test_arms_that_carry_one_thing_slow_down_together(kinematics: RobotKinematics) -> None:
    asked = np.array([0.3, 0.0, 0.0])
    high = np.concatenate(([0.0, 0.0], np.full(7, 0.05), np.full(7, 1.0)))
    found = solve(kinematics, {side: Task(asked, 0.0, STILL) for side in SIDES}, low=-high, high=high)
    left, right = (over_floor(kinematics, MIDDLE, found.velocity, side) for side in SIDES)
    assert found.share < 0.5
    np.testing.assert_allclose(left, right, atol=0.02)


def test_what_is_added_is_done_whatever_the_share(kinematics: RobotKinematics) -> None:
    added = np.array([-0.02, 0.01, 0.0, 0.0, 0.0, 0.03])
    high = np.concatenate(([0.0, 0.0], np.full(14, 0.25)))
    found = solve(kinematics, {"left": Task(np.array([0.0, 3.0, 0.0]), 0.0, added)}, low=-high, high=high)
    twist = over_floor(kinematics, MIDDLE, found.velocity, "left")
    assert found.share < 0.1
    np.testing.assert_allclose(twist - added - found.share * np.array([0, 3.0, 0, 0, 0, 0]), 0.0, atol=0.03)


def test_a_gripper_at_the_border_of_its_workspace_goes_no_further(kinematics: RobotKinematics) -> None:
    far = np.array([0.914, -1.751, -0.069, -0.3, -0.035, 0.45, 0.102])
    posture = Posture(2.732, 0.0, far, -far)
    x = kinematics.grippers(posture)["left"].planar[0]
    program = SETTINGS.program.model_copy(update={"reach_x": (0.45, float(x) - 0.01)})
    ways = WholeBodyProgram(SETTINGS.model_copy(update={"program": program}))
    still = np.concatenate(([0.0, 0.0], np.full(14, 2.0)))
    task = {"left": Task(np.array([0.1, 0.0, 0.0]), 0.0, STILL)}
    found = ways.solve(kinematics.grippers(posture), task, np.zeros(2), np.zeros(14), -still, still)
    assert found is not None
    assert found.share < 0.02
    back = {"left": Task(np.array([-0.1, 0.0, 0.0]), 0.0, STILL)}
    found = ways.solve(kinematics.grippers(posture), back, np.zeros(2), np.zeros(14), -still, still)
    assert found is not None
    assert found.share > 0.8


def test_against_a_force_past_its_limit_nothing_goes_on(kinematics: RobotKinematics) -> None:
    pressed = Task(np.array([0.2, 0.0, 0.0]), 0.0, STILL, against=np.array([1.0, 0.0]), room=0.0)
    found = solve(kinematics, {"left": pressed}, base_wish=np.array([0.2, 0.0]))
    assert over_floor(kinematics, MIDDLE, found.velocity, "left")[0] < 1e-6
    away = Task(np.array([-0.2, 0.0, 0.0]), 0.0, STILL, against=np.array([1.0, 0.0]), room=0.0)
    assert solve(kinematics, {"left": away}).share > 0.99


def test_a_singular_arm_stays_within_its_bounds(kinematics: RobotKinematics) -> None:
    stretched = Posture(2.6, 0.0)  # arms straight out: elbow and wrist singular
    found = solve(kinematics, {side: Task(np.full(3, 0.2), 0.1, np.full(6, 0.1)) for side in SIDES}, posture=stretched)
    assert np.isfinite(found.velocity).all()
    assert np.abs(found.velocity).max() <= 5.0 + 1e-9


def test_the_thesiss_way_and_the_program_agree_where_nothing_binds(kinematics: RobotKinematics) -> None:
    tasks = {"left": Task(np.array([0.04, -0.02, 0.03]), 0.0, STILL)}
    wish = np.array([0.04, 0.0])
    ways = (WholeBodyProgram(SETTINGS), PseudoInverse(SETTINGS))
    grippers = kinematics.grippers(MIDDLE)
    for way in ways:
        found = way.solve(grippers, tasks, wish, np.zeros(14), -WIDE, WIDE)
        assert found is not None
        twist = over_floor(kinematics, MIDDLE, found.velocity, "left")
        np.testing.assert_allclose(twist, tasks["left"].twist, atol=2e-3)


def test_a_joint_can_always_brake_in_time(kinematics: RobotKinematics, rng: np.random.Generator) -> None:
    limits = {side: kinematics.limits(side) for side in SIDES}
    gate = BodyGate(SETTINGS.base, SETTINGS.arm, limits)
    lower, upper = (np.concatenate([getattr(limits[side], end) for side in SIDES]) for end in ("lower", "upper"))
    joints, dt = np.concatenate((NOMINAL, -NOMINAL)), 0.005
    wish = np.sign(rng.normal(size=16)) * 10.0
    for tick in range(6000):
        if tick % 700 == 0:
            wish = np.sign(rng.normal(size=16)) * 10.0
        low, high = gate.range(joints, dt)
        before = gate.last.copy()
        sent = gate.commit(wish, low, high)
        assert (np.abs(sent[2:] - before[2:]) <= SETTINGS.arm.acceleration * dt + 1e-12).all()
        joints = joints + dt * sent[2:]
        assert (joints < upper).all()
        assert (joints > lower).all()
