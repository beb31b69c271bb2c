"""A course that ends early, and why; letting go; what is counted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from office_of_fakes import SETTINGS, tag

from pbrl_control.course import CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.percept import Grip, Percept
from pbrl_control.push import GripperAnswer
from pbrl_control.trajectories.monitor import AbortMonitor
from pbrl_control.trajectories.trajectory_plan import AbortLimits
from pbrl_control.types import Hold, PlanarTwist
from pbrl_namo.executive import ExecutiveSettings
from pbrl_namo.executive.account import FAILURES, Account, Change, Tries
from pbrl_namo.executive.course import ClearingCourse, cause_of
from pbrl_namo.executive.releasing import Release
from pbrl_namo.executive.table import TABLE, Event, State

HOLD = Hold("table_a", np.zeros(2))
ONWARDS = CourseStep(PlanarTwist(0.1), "onwards")


class Course:
    """Does what it is told: goes on, finishes, or gives up."""

    def __init__(self, *steps: CourseStep | str) -> None:
        self.steps = list(steps)

    def step(self, *_: object) -> CourseStep:
        step = self.steps.pop(0) if len(self.steps) > 1 else self.steps[0]
        if isinstance(step, str):
            raise ControlError(step)
        return step


def followed(course: ClearingCourse, seconds: float, forces: dict[str, float] | None = None) -> list[CourseStep]:
    return [course.step(now, 0.1, Percept(), HOLD, forces or {}) for now in np.arange(0.0, seconds, 0.1)]


def test_an_opening_ends_the_course_early_and_at_rest() -> None:
    looked: list[float] = []

    def opened(now: float, _: Percept) -> bool:
        looked.append(now)
        return now > 1.4

    course = ClearingCourse(Course(ONWARDS), opened, 0.5)
    steps = followed(course, 3.0)
    assert course.end == (Event.OPENED, "there is an opening")
    assert looked == pytest.approx([0.5, 1.0, 1.5])
    assert all(step.twist.moves() for step in steps[:15])
    assert not any(step.twist.moves() or step.finished for step in steps[15:]), "it is held, at rest, until told"


def test_at_its_end_it_looks_once_more() -> None:
    done = CourseStep(PlanarTwist(), "done", finished=True)
    for opened, event in ((True, Event.OPENED), (False, Event.MOVED)):
        course = ClearingCourse(Course(ONWARDS, done), lambda *_, opened=opened: opened, 60.0)
        followed(course, 1.0)
        assert course.end is not None
        assert course.end[0] == event
    blind = ClearingCourse(Course(ONWARDS, done), None, 0.1)
    followed(blind, 1.0)
    assert blind.end is not None
    assert blind.end[0] == Event.MOVED


def test_what_is_felt_is_kept() -> None:
    course = ClearingCourse(Course(ONWARDS), None, 0.5)
    assert math.isnan(course.felt)
    followed(course, 0.5, {"left": 3.0, "right": 7.0})
    followed(course, 0.1, {"left": 2.0})
    assert (course.felt, course.most_felt) == (2.0, 7.0)


def reasons() -> dict[str, Event]:
    """Every reason that a trajectory's monitor has, from the monitor itself."""
    found: dict[str, Event] = {}
    limits = AbortLimits(force_time=0.0)

    def told(event: Event, check: str, *arguments: object) -> None:
        monitor = AbortMonitor(limits, 40.0, 10.0, 5.0)
        with pytest.raises(ControlError) as error:
            for _ in range(2):
                getattr(monitor, check)(*arguments)
                arguments = (arguments[0] + 10.0, *arguments[1:])  # type: ignore[operator]
        found[str(error.value)] = event

    far = tag(0.0, np.zeros(3), 0.0)
    told(Event.UNEXPECTED_FORCE, "check_force", 0.0, {"left": 80.0})
    told(Event.STALLED, "check_progress", 0.0, 0.0, "")
    told(Event.TIMED_OUT, "check_time", 6.0, 0.5)
    told(Event.TAG_LOST, "check_tag", 2.0, None, 0.0)
    told(Event.TAG_LOST, "check_tag", 2.0, far, 0.0)
    return found


def test_every_reason_of_the_monitor_is_understood() -> None:
    found = reasons()
    assert len(found) == 5
    for sentence, event in found.items():
        assert cause_of(sentence) == event
        assert cause_of(f"giving up: {sentence}") == event


SENTENCES = {
    "left grip force: expected at most 150 N, got 170 N": Event.UNEXPECTED_FORCE,
    "tag 'stall_a' was lost: last seen 1.2 s ago": Event.TAG_LOST,
    "tag 'time-out: ': expected a pose, got NaN or infinity": Event.TAG_LOST,
    "left gripper lost 'stall: unexpected force at ' 1.0 s into push": Event.GRIP_LOST,
    "right grip on 'table': expected it to stay within 0.03 m of where it closed": Event.GRIP_SLIPPED,
    "static object: moving it takes 900 N at least": None,
    "command: expected a finite twist": None,
    "": None,
}


@pytest.mark.parametrize("sentence", SENTENCES)
def test_names_of_things_fool_nobody(sentence: str) -> None:
    assert cause_of(sentence) == SENTENCES[sentence]


def held(*sides: str) -> Percept:
    return Percept(grips={side: Grip("table_a", np.zeros(2)) for side in sides})


def let_go(percepts: list[Percept], sides: tuple[str, ...] = ()) -> tuple[Event | None, str, list[str], float]:
    """Return how a release has ended, its sentence, who was asked to open, and how far grippers were backed off."""
    release, asked, back = Release(SETTINGS.release, sides), [], 0.0
    for k in range(2000):
        percept = percepts[min(k, len(percepts) - 1)]
        step = release.step(0.02 * k, percept)
        asked += [request.side for request in step.requests]
        back += 0.02 * sum(twist.vx for twist in step.twists.values())
        assert "base" not in step.twists or not any(twist.moves() for twist in step.twists.values())
        if step.event is not None:
            return step.event, step.status, asked, back
    return None, "", asked, back


def test_what_is_held_is_let_go_after_a_rest() -> None:
    event, _, asked, back = let_go(40 * [held("left", "right")] + [Percept()])
    assert event == Event.RELEASED
    assert sorted(set(asked)) == ["left", "right"]
    assert back == pytest.approx(-2 * SETTINGS.release.retreat, abs=0.01)


def test_who_holds_nothing_backs_off_all_the_same_where_a_grasp_was_tried() -> None:
    assert let_go([Percept()], ("left",))[3] == pytest.approx(-SETTINGS.release.retreat, abs=0.01)
    assert let_go([Percept()]) == (Event.RELEASED, "grippers are open", [], 0.0)


def test_a_gripper_that_stays_closed_is_asked_again_and_then_told_of() -> None:
    event, sentence, asked, back = let_go([held("left")])
    assert event == Event.STUCK
    assert "expected open grippers within 2 s, got left holds 'table_a'; open them by hand" in sentence
    assert len(asked) > 2
    assert back == 0.0


def test_why_a_gripper_stays_closed_is_passed_on() -> None:
    release = Release(SETTINGS.release)
    release.answer(GripperAnswer("release", "left", False, "no\nair"))
    steps = [release.step(0.1 * k, held("left")) for k in range(60)]
    assert "left says 'no air'" in next(step.status for step in steps if step.event == Event.STUCK)


def test_a_gripper_that_closes_again_is_opened_again() -> None:
    event, _, asked, _ = let_go(
        30 * [held("left")] + 5 * [Percept()] + 20 * [held("left")] + [Percept()],
    )
    assert event == Event.RELEASED
    assert len(asked) >= 2


def test_tries_add_up_and_openings_forgive() -> None:
    tries = Tries(2)
    tries.failed("a", "stuck")
    tries.missed("a", np.zeros(2))
    assert tries.given_up == {}
    tries.failed("a", "stuck again")
    assert tries.given_up == {"a": "a is left alone after 2 tries: stuck; then stuck again"}
    assert len(tries.stands("a")) == 1
    tries.opened("a")
    assert tries.given_up == {}
    assert tries.counts == {}
    assert tries.stands("a") == ()


def test_the_account_counts_what_figure_45_counts() -> None:
    account = Account()
    account.pass_time(State.PLANNING, 2.0)
    account.pass_time(State.PAUSED, 50.0)
    account.pass_time(State.DONE, 50.0)
    for before, event, after in (
        (State.PLANNING, Event.PLANNED, State.GET_GRASP_POINT),
        (State.CLEAR, Event.STALLED, State.UPDATE_MODEL),
        (State.UPDATE_MODEL, Event.UNEXPLAINED, State.ASK_MISMATCH),
        (State.ASK_MISMATCH, Event.REPAIRED, State.RELEASE),
        (State.CLEAR, Event.OPENED, State.RELEASE),
        (State.PLANNING, Event.NOTHING_TO_DO, State.DRIVE_TO_GOAL),
    ):
        account.note(Change(0.0, before, event, after, ""))
    rows = account.rows()
    assert (rows["calls to the planner"], rows["calls to UpdateModel"], rows["surprises"]) == (2.0, 1.0, 1.0)
    assert (rows["repaired models"], rows["openings"]) == (1.0, 1.0)
    assert rows["overall runtime [s]"] == 2.0


def test_settings_of_a_second_attempt_are_refused() -> None:
    with pytest.raises(ValueError, match=r"fetch.attempts: expected 1"):
        ExecutiveSettings.model_validate({"fetch": {"attempts": 2}})


def test_a_step_of_several_is_no_failed_try() -> None:
    assert Event.STEPPED not in FAILURES
    assert Event.MOVED in FAILURES
    assert TABLE[State.CLEAR, Event.STEPPED] == TABLE[State.CLEAR, Event.MOVED] == State.RELEASE
