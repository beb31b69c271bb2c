"""The push executive: drive up, grasp, move by a course, release. A pure state machine, time is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from pbrl_control.admittance import WrenchBias
from pbrl_control.approach import Approacher
from pbrl_control.course import Course, SegmentCourse
from pbrl_control.errors import ControlError
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.percept import Percept, gripper_tag, holds_of
from pbrl_control.planar import Array
from pbrl_control.push_plan import PushPlan
from pbrl_control.types import Hold, PlanarTwist, gripper_frame

ANSWER_TIME = 5.0  # [s] a grasp or release service may take
START_TIME = 5.0  # [s] from the first tick until all tags have been seen
RETREAT_SPEED = 0.08  # [m/s]


class Phase(StrEnum):
    """Where a push is; the value is what `/push/status` says."""

    LOCATE = "locate"  # this and the next two where the object is driven to first, see `fetching`
    STOW = "stow"
    DRIVE = "drive"
    APPROACH = "approach"
    GRASP = "grasp"
    SETTLE = "settle"
    PUSH = "push"
    RELEASE = "release"
    RETREAT = "retreat"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class GripperRequest:
    """Something to ask of a gripper: `action` is "grasp" or "release"."""

    action: str
    side: str
    object: str


@dataclass(frozen=True)
class GripperAnswer:
    """What came of a request; `distance` [m] to the nearest edge that can be clamped, for a refused grasp."""

    action: str
    side: str
    success: bool
    message: str = ""
    distance: float = 0.0


@dataclass(frozen=True)
class PushCommand:
    """What the executive wants now.

    Attributes:
        phase: where the push is.
        status: a sentence; of a failed push, why.
        twists: commands by what they move (see `PlanarTwist`).
        requests: to be asked once, now; answers go to `PushExecutive.answer`.
        expected: see `CourseStep.expected`.
    """

    phase: Phase
    status: str
    twists: Mapping[str, PlanarTwist] = field(default_factory=dict)
    requests: tuple[GripperRequest, ...] = ()
    expected: Mapping[str, Array] = field(default_factory=dict)

    @property
    def finished(self) -> bool:
        """Whether the push has ended, well or not."""
        return self.phase in (Phase.DONE, Phase.FAILED)


class PushExecutive:
    """Runs one plan from drive-up to release.

    Args:
        plan: what to grasp, and how.
        course: what the object does while it is held; None: the segments of a push plan.

    Raises:
        ControlError: there is neither a course nor a push plan.
    """

    def __init__(self, plan: GraspPlan, course: Course | None = None) -> None:
        self.plan = plan
        self._course = course if course is not None else _segments_of(plan)
        self.phase = Phase.APPROACH
        self._sides: list[str] = [grip.gripper for grip in plan.grips]
        self._approacher: Approacher | None = None
        self._bias: dict[str, WrenchBias] = {side: WrenchBias(0.3) for side in self._sides}
        self._answers: dict[str, GripperAnswer] = {}
        self._clamped: set[str] = set()  # that have closed, as they answered; /grasps may not show it yet
        self._asked = False
        self._attempts = 0
        self._failure = ""
        self._begun = 0.0  # of the whole push
        self._started = False
        self._since = 0.0  # of this phase
        self._last = 0.0
        self._over_force: float | None = None
        self._steps: dict[Phase, Callable[[float, float, Percept], PushCommand]] = {
            Phase.APPROACH: self._approach,
            Phase.GRASP: self._grasp,
            Phase.SETTLE: self._settle,
            Phase.PUSH: self._push,
            Phase.RELEASE: self._release,
            Phase.RETREAT: self._retreat,
        }

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a request."""
        if answer.side in self._sides:
            self._answers[answer.side] = answer
            if answer.success:
                (self._clamped.add if answer.action == "grasp" else self._clamped.discard)(answer.side)

    def tick(self, now: float, percept: Percept) -> PushCommand:
        """Return what to do at `now` [s], given the latest percept; never raises for what it perceives."""
        if not self._started:
            self._started = True
            self._begun = self._since = self._last = now
        dt, self._last = max(now - self._last, 0.0), now
        if self.phase in (Phase.DONE, Phase.FAILED):
            return PushCommand(self.phase, self._failure or "done")
        self._learn_bias(percept, dt)
        try:
            return self._steps[self.phase](now, dt, percept)
        except ControlError as error:
            return self._fail(now, str(error), percept)

    def _approach(self, now: float, dt: float, percept: Percept) -> PushCommand:
        if self._closed(percept):
            held = ", ".join(f"{side} holds {percept.grips[side].object!r}" for side in self._closed(percept))
            raise ControlError(f"approach: expected open grippers, but {held}; release first")
        if self._unseen(percept):
            waited = now - self._begun
            if waited > START_TIME:
                raise ControlError(
                    f"no sight of {', '.join(self._unseen(percept))} in {waited:.1f} s; is the camera on?"
                )
            return self._rest("waiting for tags and scene", percept)
        self._check_tags(now, percept)
        if self._approacher is None:
            self._approacher = Approacher(self.plan, percept.bodies[self.plan.object])
        twists, arrived, sentence = self._approacher.step(percept, dt)
        if arrived:
            self._enter(Phase.GRASP, now)
            return self._rest("at the edge", percept)
        if now - self._since > self.plan.approach.timeout:
            raise ControlError(f"the edge was not reached in {self.plan.approach.timeout:.0f} s: {sentence}")
        return PushCommand(self.phase, sentence, twists)

    def _grasp(self, now: float, dt: float, percept: Percept) -> PushCommand:
        if now - self._since < self.plan.still:
            return self._rest("standing still", percept)
        if not self._asked:
            self._asked = True
            self._attempts += 1
            return self._rest("closing", percept, self._requests("grasp"))
        if len(self._answers) < len(self._sides):
            self._check_answer_time(now)
            return self._rest("closing", percept)
        refused = [answer for answer in self._answers.values() if not answer.success]
        if not refused:
            if all(side in percept.grips for side in self._sides):
                self._clamped.clear()  # from now on /grasps tells
                self._enter(Phase.SETTLE, now)
            else:
                self._check_answer_time(now)
            return self._rest("closed", percept)
        first = refused[0]
        sentence = f"{first.side} gripper refused {self.plan.object!r}: {first.message} ({first.distance:.3f} m off)"
        if self._attempts >= self.plan.limits.grasp_attempts or self._holding(percept):
            raise ControlError(f"{sentence}; gave up after {self._attempts} attempts")
        if self._approacher is not None:
            self._approacher.go_deeper(first.distance)
        self._enter(Phase.APPROACH, now)
        return self._rest(sentence, percept)

    def _settle(self, now: float, dt: float, percept: Percept) -> PushCommand:
        self._check_grip(now, percept)
        if now - self._since >= self.plan.settle:
            self._enter(Phase.PUSH, now)
        return self._rest("at rest, holding", percept)

    def _push(self, now: float, dt: float, percept: Percept) -> PushCommand:
        self._check_tags(now, percept)
        hold = self._check_grip(now, percept)
        self._check_force(now, percept)
        forces = {side: self._force(side, percept) for side in self._sides}
        step = self._course.step(now, dt, percept, hold, forces)
        if step.finished:
            self._enter(Phase.RELEASE, now)
            return self._rest(step.status, percept)
        return PushCommand(self.phase, step.status, {self.plan.object: step.twist}, expected=step.expected)

    def _release(self, now: float, dt: float, percept: Percept) -> PushCommand:
        if now - self._since < self.plan.settle and not self._failure:
            return self._rest("at rest, holding", percept)
        if not self._asked:
            self._asked = True
            return self._rest("opening", percept, self._requests("release"))
        if self._holding(percept) and now - self._since < ANSWER_TIME + self.plan.settle:
            return self._rest("opening", percept)
        if self._holding(percept):
            self._failure = self._failure or f"gripper did not open in {ANSWER_TIME:.0f} s"
            return self._end(now)
        self._enter(Phase.RETREAT, now)
        return self._rest("open", percept)

    def _retreat(self, now: float, dt: float, percept: Percept) -> PushCommand:
        if now - self._since >= self.plan.retreat / RETREAT_SPEED or self._closed(percept):
            return self._end(now)
        back = PlanarTwist(vx=-RETREAT_SPEED)
        return PushCommand(self.phase, "backing off", {gripper_frame(side): back for side in self._sides})

    def _end(self, now: float) -> PushCommand:
        self._enter(Phase.FAILED if self._failure else Phase.DONE, now)
        return PushCommand(self.phase, self._failure or "done")

    def _fail(self, now: float, sentence: str, percept: Percept) -> PushCommand:
        """Give up: open what is closed first, then say why."""
        self._failure = self._failure or sentence
        if not self._holding(percept) or self.phase in (Phase.APPROACH, Phase.RELEASE, Phase.RETREAT):
            return self._end(now)
        self._enter(Phase.RELEASE, now)
        return self._rest(f"giving up: {self._failure}", percept)

    def _closed(self, percept: Percept) -> list[str]:
        """Return which of this push's grippers hold something."""
        return [side for side in self._sides if side in percept.grips]

    def _holding(self, percept: Percept) -> bool:
        """Return whether one of this push's grippers holds something, or has answered that it does."""
        return bool(self._closed(percept) or self._clamped)

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase, self._since, self._asked = phase, now, False
        self._answers.clear()
        self._over_force = None

    def _rest(self, status: str, percept: Percept, requests: tuple[GripperRequest, ...] = ()) -> PushCommand:
        """Command rest: of what is held where something is, of the open grippers otherwise."""
        held = {grip.object for grip in percept.grips.values()}
        targets = held or {gripper_frame(side) for side in self._sides}
        return PushCommand(self.phase, status, {target: PlanarTwist() for target in sorted(targets)}, requests)

    def _requests(self, action: str) -> tuple[GripperRequest, ...]:
        return tuple(GripperRequest(action, side, self.plan.object) for side in self._sides)

    def _learn_bias(self, percept: Percept, dt: float) -> None:
        for side in self._sides:
            if side not in percept.grips and side in percept.wrenches:
                self._bias[side].update(percept.wrenches[side], dt)

    def _unseen(self, percept: Percept) -> list[str]:
        wanted = [self.plan.object, *(gripper_tag(side) for side in self._sides)]
        unseen = [f"tag {name!r}" for name in wanted if name not in percept.tags]
        return unseen if self.plan.object in percept.bodies else [f"body {self.plan.object!r} in the scene", *unseen]

    def _check_tags(self, now: float, percept: Percept) -> None:
        for name in (self.plan.object, *(gripper_tag(side) for side in self._sides)):
            tag = percept.tags.get(name)
            if tag is None:
                raise ControlError(f"tag {name!r}: expected a pose, got none")
            if not tag.finite():
                raise ControlError(f"tag {name!r}: expected a pose, got NaN or infinity")
            if now - tag.time > self.plan.limits.tag_age:
                raise ControlError(f"tag {name!r} was lost: last seen {now - tag.time:.1f} s ago")

    def _check_answer_time(self, now: float) -> None:
        if now - self._since > self.plan.still + ANSWER_TIME:
            raise ControlError(f"grasp: expected an answer and a grip within {ANSWER_TIME:.0f} s, got none")

    def _check_grip(self, now: float, percept: Percept) -> Hold:
        for side in self._sides:
            if side not in percept.grips or percept.grips[side].object != self.plan.object:
                raise ControlError(
                    f"{side} gripper lost {self.plan.object!r} {now - self._since:.1f} s into {self.phase}"
                )
        return holds_of(percept)[self._sides[0]]

    def _check_force(self, now: float, percept: Percept) -> None:
        forces = {side: self._force(side, percept) for side in self._sides}
        side = max(forces, key=lambda name: forces[name])
        limits = self.plan.limits
        if forces[side] <= limits.force:
            self._over_force = None
        elif self._over_force is None:
            self._over_force = now
        elif now - self._over_force > limits.force_time:
            raise ControlError(f"{side} grip force: expected at most {limits.force:.0f} N, got {forces[side]:.0f} N")

    def _force(self, side: str, percept: Percept) -> float:
        """Return the horizontal force at a gripper [N]; its z axis is the vertical, plates are kept level."""
        raw = percept.wrenches.get(side)
        return 0.0 if raw is None else float(np.hypot(*self._bias[side].remove(raw)[:2]))


def _segments_of(plan: GraspPlan) -> Course:
    if isinstance(plan, PushPlan):
        return SegmentCourse(plan)
    raise ControlError(f"plan {plan.name}: expected a course beside a plan without segments, got none")
