"""The executive: looks only when the arm is away, thinks only when asked to, ends in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from desk_cases import three

from pbrl_control.ball_arm import BallArm, Strokes
from pbrl_planner.tabletop import DeskExecutive, Ended, Ending, NextPush, Push, State

URDF = (Path(__file__).resolve().parents[3] / "urdf" / "ball_arm" / "ball_arm.urdf").read_text(encoding="utf-8")
DT = 0.01
POSES = {"eraser": np.zeros(3), "remote": np.array([0.2, 0.1, 0.0]), "scale": np.array([-0.2, 0.1, 0.0])}


class Two:
    """A task of two pushes."""

    def __init__(self, reach: float = 0.1) -> None:
        self.pushes, self.seen = 0, []
        self._path = np.array([[0.0, 0.0], [reach, 0.0]])

    def next(self, poses: Mapping[str, np.ndarray]) -> NextPush | Ended:
        self.seen.append(poses)
        if len(poses) < 3:
            return Ended(Ending.LOST, "one is not seen")
        if self.pushes == 2:
            return Ended(Ending.TIDY, "two were enough")
        self.pushes += 1
        return NextPush(0, Push("+x"), self._path)


class Stage:
    """An arm that does at once what it is told, a camera that looks all the time, and whoever thinks."""

    def __init__(self, task: Two) -> None:
        self.strokes = Strokes(BallArm(URDF, np.array([0.0, -0.45, math.pi / 2])))
        self.executive, self.task = DeskExecutive(self.strokes), task
        self.joints = self.strokes.arm.joints(self.strokes.stowed)
        self.now, self.poses = 0.0, dict(POSES)
        self.looked_at: list[float] = []

    def step(self) -> None:
        self.now += DT
        angles = self.executive.tick(self.now, self.joints)
        if angles is not None:
            self.joints = angles
        before = self.executive.question
        self.executive.see(self.now, self.poses, 3)
        if before is None and self.executive.question is not None:
            self.looked_at.append(self.strokes.arm.ball(self.joints).yaw)
        if self.executive.question is not None:
            self.executive.answer(self.task.next(self.executive.question), self.now, self.joints)

    def run(self, seconds: float = 60.0) -> None:
        self.executive.begin(self.task, self.now, self.joints)
        while self.executive.ended is None:
            self.step()
            assert self.now < seconds, "did not end"


def test_a_task_is_carried_out_and_every_look_is_without_the_arm() -> None:
    stage = Stage(Two())
    stage.run()
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.TIDY
    assert stage.executive.task is None
    assert stage.executive.last_task is stage.task
    assert stage.task.pushes == 2
    np.testing.assert_allclose(stage.looked_at, stage.strokes.stowed.yaw, atol=1e-9)
    assert len(stage.looked_at) == 3


def test_a_hand_in_the_picture_is_waited_for_but_not_for_ever() -> None:
    stage = Stage(Two())
    del stage.poses["scale"]
    stage.run()
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.LOST
    passing = Stage(Two())
    del passing.poses["scale"]
    passing.executive.begin(passing.task, 0.0, passing.joints)
    while passing.executive.state is not State.LOOKING:
        passing.step()
    while passing.executive._misses < 2:
        passing.step()
    passing.poses = dict(POSES)
    while passing.executive.ended is None:
        passing.step()
    assert passing.executive.ended.ending is Ending.TIDY


def test_cancelled_in_mid_push_it_takes_the_arm_away_and_waits() -> None:
    stage = Stage(Two())
    stage.executive.begin(stage.task, 0.0, stage.joints)
    while stage.executive.state is not State.PUSHING:
        stage.step()
    for _ in range(100):
        stage.step()
    stage.executive.cancel(stage.now, stage.joints)
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.CANCELLED
    for _ in range(1000):
        stage.step()
    assert stage.executive.state is State.IDLE
    np.testing.assert_allclose(stage.strokes.arm.ball(stage.joints).yaw, stage.strokes.stowed.yaw, atol=1e-9)
    assert stage.task.pushes == 1


def test_what_the_arm_does_not_reach_ends_it_in_words() -> None:
    stage = Stage(Two(reach=3.0))
    stage.run()
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.UNREACHED
    assert "from its column" in stage.executive.ended.reason


def test_a_camera_that_is_silent_ends_it_and_one_that_hesitates_does_not() -> None:
    stage = Stage(Two())
    stage.executive.begin(stage.task, 0.0, stage.joints)
    while stage.executive.ended is None:
        stage.now += DT
        angles = stage.executive.tick(stage.now, stage.joints)
        stage.joints = stage.joints if angles is None else angles
        assert stage.now < 60.0
    assert stage.executive.ended.ending is Ending.BLIND
    assert stage.executive.state is State.IDLE
    slow = Stage(Two())
    slow.executive.begin(slow.task, 0.0, slow.joints)
    last = 0.0
    while slow.executive.ended is None:
        slow.now += DT
        angles = slow.executive.tick(slow.now, slow.joints)
        slow.joints = slow.joints if angles is None else angles
        if slow.now > last + 4.0:
            last = slow.now
            slow.executive.see(slow.now, slow.poses, 3)
        if slow.executive.question is not None:
            slow.executive.answer(slow.task.next(slow.executive.question), slow.now, slow.joints)
    assert slow.executive.ended.ending is Ending.TIDY


def test_after_standing_still_a_stroke_goes_on_where_it_was_and_the_camera_is_not_blamed() -> None:
    stage = Stage(Two())
    stage.executive.begin(stage.task, 0.0, stage.joints)
    most = 0.0
    while stage.executive.ended is None:
        before = stage.joints
        if stage.executive.state in (State.PUSHING, State.STOWING, State.LOOKING) and round(stage.now / DT) % 100 == 50:
            stage.now += 7.0  # longer than any stroke, and than a camera is waited for
            angles = stage.executive.tick(stage.now, stage.joints)
            stage.joints = stage.joints if angles is None else angles
        stage.step()
        most = max(most, float(np.abs(stage.joints - before).max()))
        assert stage.now < 600.0
    assert stage.executive.ended.ending is Ending.TIDY
    assert stage.now > 30.0, "it stood still several times"
    calm = Stage(Two())
    calm.executive.begin(calm.task, 0.0, calm.joints)
    usual = 0.0
    while calm.executive.ended is None:
        before = calm.joints
        calm.step()
        usual = max(usual, float(np.abs(calm.joints - before).max()))
    assert most < 2.5 * usual, "two ticks may lie between two looks at the arm, seven seconds may not"


def test_halted_in_mid_push_nothing_is_moved_any_more() -> None:
    stage = Stage(Two())
    stage.executive.begin(stage.task, 0.0, stage.joints)
    while stage.executive.state is not State.PUSHING:
        stage.step()
    stage.executive.halt(Ended(Ending.SILENT, "not heard"))
    assert stage.executive.tick(stage.now + DT, stage.joints) is None
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.SILENT
    stage.executive.halt(Ended(Ending.BLIND, "nor seen"))
    assert stage.executive.ended.ending is Ending.SILENT, "a task ends once"
    stage.run(120.0)
    assert stage.executive.ended.ending is Ending.TIDY, "the next one begins where the arm is"


@pytest.mark.parametrize("state", [State.PUSHING, State.LOOKING])
def test_a_clock_that_is_set_back_ends_it_and_the_next_one_is_carried_out(state: State) -> None:
    stage = Stage(Two())
    stage.now = 1000.0
    stage.executive.begin(stage.task, stage.now, stage.joints)
    while stage.executive.state is not state:
        stage.step()
    stage.now = 3.0
    assert stage.executive.tick(stage.now, stage.joints) is None, "nothing is moved any more"
    assert stage.executive.ended is not None
    assert stage.executive.ended.ending is Ending.SET_BACK
    stage.task = Two()
    stage.run(120.0)
    assert stage.executive.ended.ending is Ending.TIDY


def test_an_answer_that_comes_too_late_does_nothing() -> None:
    stage = Stage(Two())
    stage.executive.answer(NextPush(0, Push("+x"), np.zeros((2, 2))), 0.0, stage.joints)
    assert stage.executive.state is State.IDLE
    assert stage.executive.tick(1.0, stage.joints) is None
    assert {each.success for each in Ending} == {True, False}
    assert three().names == tuple(POSES)


@pytest.mark.parametrize("ending", list(Ending))
def test_endings_are_sentences(ending: Ending) -> None:
    assert " " in ending.value
