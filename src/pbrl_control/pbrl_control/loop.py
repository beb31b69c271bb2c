"""Executive and controller as one pure loop: percept in, commands out. For whoever drives a simulator in process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from pbrl_control.controller import BodyController
from pbrl_control.course import Course
from pbrl_control.errors import ControlError
from pbrl_control.fence import Fence
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import BodyShape, Percept, holds_of
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, Phase, PushCommand, PushExecutive
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import BodyCommand, BodyState


@dataclass(frozen=True)
class LoopCommand:
    """What to send at this moment.

    Attributes:
        body: velocities of base and arms (waist and torso stand still).
        push: the executive's command: phase, status, twists, and the requests to carry out now; each is to
            be answered with `ControlLoop.answer`.
    """

    body: BodyCommand
    push: PushCommand


class Executive(Protocol):
    """Decides what the robot does: `PushExecutive`, `FetchExecutive`."""

    plan: GraspPlan
    phase: Phase

    def tick(self, now: float, percept: Percept) -> PushCommand:
        """Return what to do at `now` [s]; never raises for what it perceives."""
        ...

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a gripper's request."""
        ...


class ControlLoop:
    """One push or fetch, from the first percept to done or failed.

    Args:
        kinematics: of the robot.
        task: an executive, or the plan of a push.
        settings: of the body controller.
        course: what the object of a plan does while it is held; None: the segments of a push plan.

    Attributes:
        fenced: why the fence holds the robot back now; empty: it does not.

    Raises:
        ControlError: a course beside an executive, which has its own; a plan that lacks one.
    """

    def __init__(
        self,
        kinematics: RobotKinematics,
        task: GraspPlan | Executive,
        settings: ControllerSettings | None = None,
        course: Course | None = None,
    ) -> None:
        if course is not None and not isinstance(task, GraspPlan):
            raise ControlError(
                "control loop: expected a course beside a plan, got one beside an executive: tell it that"
            )
        self.controller = BodyController(kinematics, settings or ControllerSettings())
        self.executive: Executive = PushExecutive(task, course) if isinstance(task, GraspPlan) else task
        self._fence = Fence(kinematics.urdf, self.controller.settings.fence)
        self.fenced = ""
        self._last: float | None = None

    def told(self, bodies: Mapping[str, BodyShape], fixed: Mapping[str, Array]) -> None:
        """Take in the scene: outlines by name, and the pose (3,) of what is built in [m, rad]."""
        self._fence.told(bodies, fixed)

    def tick(self, now: float, percept: Percept) -> LoopCommand:
        """Return the commands for the time from `now` [s] on; call it at 100 Hz of the clock that `now` is of."""
        dt = 0.01 if self._last is None else now - self._last
        self._last = now
        push = self.executive.tick(now, replace(percept, share=self.controller.share))
        if percept.posture is None:
            return LoopCommand(BodyCommand(report="joint positions: expected some, none have been seen yet"), push)
        try:
            holds = holds_of(percept)
        except ControlError as error:
            return LoopCommand(BodyCommand(report=str(error)), push)
        holds = {side: replace(hold, expected=push.expected.get(side)) for side, hold in holds.items()}
        body = self.controller.tick(BodyState(percept.posture), push.twists, holds, percept.wrenches, dt)
        self.fenced = self._fence.fault(now, percept, body)
        if self.fenced:
            body = self.controller.stand(self.fenced)
        return LoopCommand(body, push)

    def answer(self, answer: GripperAnswer) -> None:
        """Pass on what came of a request."""
        self.executive.answer(answer)
