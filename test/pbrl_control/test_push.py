"""The push executive: each transition, as a table; then a whole push in the air."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from pbrl_control.course import Course, CourseStep
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, GripperRequest, Phase, PushCommand, PushExecutive
from pbrl_control.push_plan import PushPlan
from pbrl_control.types import Hold, PlanarTwist

TABLE = BodyShape(np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]]), 0.7775)
FORWARD = np.array([0.0, 0.0, -np.sqrt(0.5), np.sqrt(0.5)])  # left gripper's +y along world x
BACKWARD = FORWARD * [1.0, 1.0, -1.0, 1.0]  # a right one's along -x
PLAN = PushPlan.model_validate(
    {
        "name": "p",
        "object": "table",
        "grips": [{"gripper": "left", "point": [-0.375, 0.4]}],
        "segments": [{"twist": [0.1, 0.0, 0.0], "duration": 0.5}],
        "still": 0.1,
        "settle": 0.1,
        "retreat": 0.02,
    }
)
HELD = {"left": Grip("table", np.array([-0.355, 0.4]))}


def seen(
    now: float, gap: float = 0.0, grips: Mapping[str, Grip] | None = None, up: float = 0.0, **more: object
) -> Percept:
    """Return a percept at `now`: plates `gap` [m] short of where they grasp, `up` [m] too low."""
    table = Tag(now, np.array([1.19, -0.25, 0.7775]), np.array([0.0, 0.0, 0.0, 1.0]))
    x = 1.19 - 0.375 + PLAN.approach.depth - gap - 0.172
    gripper = Tag(now, np.array([x, 0.15, 0.7775 - 0.0125 - up]), FORWARD)
    values = {
        "tags": {"table": table, "left_gripper": gripper},
        "wrenches": {"left": np.zeros(6)},
        "grips": grips or {},
        "bodies": {"table": TABLE},
        **more,
    }
    return Percept(None, **values)  # type: ignore[arg-type]


def run(executive: PushExecutive, start: float, until: float, **percept: object) -> PushCommand:
    for now in np.arange(start, until, 0.01):
        command = executive.tick(float(now), seen(float(now), **percept))  # type: ignore[arg-type]
    return command


class Onwards:
    """A course that has no end."""

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        return CourseStep(PlanarTwist(0.1), "onwards")


def at(phase: Phase, course: Course | None = None) -> tuple[PushExecutive, float]:
    """Return an executive that has just come to a phase, and the time."""
    executive, now, grips = PushExecutive(PLAN, course), 0.0, {}
    while executive.phase != phase:
        command = executive.tick(now, seen(now, grips=grips))
        for request in command.requests:
            grips = HELD if request.action == "grasp" else {}
            executive.answer(GripperAnswer(request.action, request.side, True))
        now += 0.01
        assert now < 10.0, f"never came to {phase}, stuck in {executive.phase}"
    return executive, now


def nothing(_: PushExecutive) -> None:
    """Answer nothing."""


def refuse(executive: PushExecutive) -> None:
    executive.answer(GripperAnswer("grasp", "left", False, "no edge between the plates", 0.034))


NO_FORCE, HARD = np.zeros(6), np.array([0.0, 400.0, 0.0, 0.0, 0.0, 0.0])
# phase, seconds to wait there, what is perceived, next phase, part of the status
TRANSITIONS = {
    "far away": (Phase.APPROACH, 1.0, {"gap": 0.3}, Phase.APPROACH, "m to go"),
    "at the edge": (Phase.APPROACH, 0.05, {}, Phase.GRASP, "standing still"),
    "too low": (Phase.APPROACH, 1.0, {"up": 0.05}, Phase.APPROACH, "m up"),
    "out of time": (Phase.APPROACH, 21.0, {"gap": 0.3}, Phase.FAILED, "the edge was not reached in 20 s"),
    "no scene": (Phase.APPROACH, 6.0, {"bodies": {}}, Phase.FAILED, "no sight of body 'table' in the scene"),
    "no tags": (Phase.APPROACH, 6.0, {"tags": {}}, Phase.FAILED, "no sight of tag 'table', tag 'left_gripper'"),
    "no answer": (Phase.GRASP, 6.0, {}, Phase.FAILED, "expected an answer"),
    "holding": (Phase.SETTLE, 0.15, {"grips": HELD}, Phase.PUSH, "segment 1 of 1"),
    "lost at rest": (Phase.SETTLE, 0.02, {}, Phase.FAILED, "left gripper lost 'table'"),
    "pushed": (Phase.PUSH, 0.55, {"grips": HELD}, Phase.RELEASE, "at rest"),
    "slipped off": (Phase.PUSH, 0.2, {}, Phase.FAILED, "left gripper lost 'table'"),
    "too hard": (Phase.PUSH, 0.3, {"grips": HELD, "wrenches": {"left": HARD}}, Phase.RELEASE, "opening"),
    "holds already": (Phase.APPROACH, 0.05, {"grips": HELD}, Phase.FAILED, "left holds 'table'; release first"),
    "tag gone": (Phase.PUSH, 0.05, {"grips": HELD, "tags": {}}, Phase.RELEASE, "opening"),
    "a knock": (Phase.PUSH, 0.1, {"grips": HELD, "wrenches": {"left": HARD}}, Phase.PUSH, "segment"),
    "not opening": (Phase.RELEASE, 6.0, {"grips": HELD}, Phase.FAILED, "did not open"),
    "backed off": (Phase.RETREAT, 0.3, {}, Phase.DONE, "done"),
    "over": (Phase.DONE, 1.0, {"tags": {}}, Phase.DONE, "done"),
}


@pytest.mark.parametrize("case", TRANSITIONS)
def test_transition(case: str) -> None:
    phase, wait, percept, then, status = TRANSITIONS[case]
    executive, now = at(phase) if phase != Phase.APPROACH else (PushExecutive(PLAN), 0.0)
    command = run(executive, now, now + wait, **percept)
    assert executive.phase == then
    assert status in command.status
    assert "\n" not in command.status


def test_a_refused_grasp_is_tried_again_and_then_told_with_its_distance() -> None:
    executive, now = at(Phase.GRASP)
    asked = 0
    while executive.phase != Phase.FAILED and now < 60.0:
        command = executive.tick(now, seen(now, gap=-0.01 * asked))
        for _ in command.requests:
            asked += 1
            refuse(executive)
        now += 0.01
    assert asked == PLAN.limits.grasp_attempts
    assert "no edge between the plates (0.034 m off); gave up after 3 attempts" in command.status


def test_a_failed_push_lets_go_before_it_says_so() -> None:
    executive, now = at(Phase.PUSH)
    grips: Mapping[str, Grip] = HELD
    released = []
    while executive.phase != Phase.FAILED and now < 60.0:
        command = executive.tick(now, seen(now, grips=grips, wrenches={"left": HARD}))
        if command.requests:
            released.append(command.requests[0].action)
            grips = {}
        now += 0.01
    assert released == ["release"]
    assert "expected at most 150 N, got 400 N" in command.status


@pytest.mark.parametrize("shown", [0.0, 0.05], ids=["at once", "after the answers"])
def test_one_hand_that_closed_is_opened_again_when_the_other_was_refused(shown: float) -> None:
    grips = [{"gripper": "left", "point": [-0.375, 0.4]}, {"gripper": "right", "point": [-0.375, -0.4]}]
    executive = PushExecutive(PushPlan.model_validate({**PLAN.model_dump(), "grips": grips}))
    closed: float | None = None
    asked: list[tuple[str, str]] = []
    now = 0.0
    while executive.phase != Phase.FAILED and now < 60.0:
        holds = HELD if closed is not None and now >= closed + shown else {}
        percept = seen(now, grips=holds)
        left = percept.tags["left_gripper"]
        tags = {**percept.tags, "right_gripper": Tag(now, left.position - np.array([0.0, 0.8, 0.0]), BACKWARD)}
        command = executive.tick(now, seen(now, grips=holds, tags=tags))
        for request in command.requests:
            asked.append((request.action, request.side))
            clamps = request == GripperRequest("grasp", "left", "table")
            closed = now if clamps else None if request == GripperRequest("release", "left", "table") else closed
            executive.answer(GripperAnswer(request.action, request.side, clamps or request.action == "release"))
        now += 0.01
    assert asked[:2] == [("grasp", "left"), ("grasp", "right")]
    assert ("release", "left") in asked[2:]
    assert "right gripper refused 'table'" in command.status


@pytest.mark.parametrize("tag", ["table", "left_gripper"])
@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.PUSH])
def test_a_lost_tag_ends_it(phase: Phase, tag: str) -> None:
    executive, now = at(phase, Onwards())
    grips = HELD if phase == Phase.PUSH else {}
    old = seen(now, gap=0.3, grips=grips).tags[tag]
    for t in np.arange(now, now + PLAN.limits.tag_age + 0.3, 0.01):
        percept = seen(float(t), gap=0.3, grips=grips)
        if executive.phase != phase:
            break
        command = executive.tick(
            float(t), Percept(None, {**percept.tags, tag: old}, percept.wrenches, grips, percept.bodies)
        )
    assert executive.phase in (Phase.FAILED, Phase.RELEASE)
    assert f"tag '{tag}' was lost" in command.status


def test_a_tag_that_is_no_pose_ends_it() -> None:
    executive, now = at(Phase.PUSH)
    percept = seen(now, grips=HELD)
    bad = Tag(now, np.full(3, np.nan), FORWARD)
    command = executive.tick(now, Percept(None, {**percept.tags, "table": bad}, {}, HELD, percept.bodies))
    assert "expected a pose, got NaN" in command.status


def test_it_comes_near_only_when_lined_up() -> None:
    high, lined = (run(PushExecutive(PLAN), 0.0, 0.5, gap=0.09, up=up).twists["left_ft"] for up in (0.05, 0.0))
    assert high.vx <= 0.01
    assert high.vz > 0.02
    assert lined.vx > 0.05


def test_commands_are_rest_wherever_nothing_is_to_move() -> None:
    for phase in (Phase.GRASP, Phase.SETTLE, Phase.RELEASE):
        executive, now = at(phase)
        grips = {} if phase == Phase.GRASP else HELD
        command = executive.tick(now, seen(now, grips=grips))
        assert set(command.twists) == ({"left_ft"} if phase == Phase.GRASP else {"table"})
        assert all(not twist.array().any() and twist.vz == 0.0 for twist in command.twists.values())


def test_same_percepts_same_commands() -> None:
    one, two = at(Phase.PUSH)[0], at(Phase.PUSH)[0]
    assert run(one, 5.0, 5.3, grips=HELD) == run(two, 5.0, 5.3, grips=HELD)
