"""One obstacle from the way to it to the opening, by a fetch: NavigateToPoint, Grasp and ClearObstacle of figure 42."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from pbrl_control.errors import ControlError
from pbrl_control.fetching import FetchExecutive
from pbrl_control.grasp_plan import PushLimits
from pbrl_control.grasping import GraspCandidate, GraspSearch, GraspSettings
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.navigation import FloorMap
from pbrl_control.percept import BodyShape, Percept
from pbrl_control.planar import Array, compose, inverse
from pbrl_control.push import GripperAnswer, Phase
from pbrl_control.settings import ControllerSettings
from pbrl_control.trajectories.course import TrajectoryCourse
from pbrl_control.trajectories.trajectory import MotionLimits
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan
from pbrl_namo.executive.course import ClearingCourse, Opened, cause_of
from pbrl_namo.executive.jobs import Move
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import Step, still_held
from pbrl_namo.executive.table import Event, State
from pbrl_namo.executive.view import RoomView

ON_THE_WAY = frozenset({Phase.LOCATE, Phase.RETREAT, Phase.STOW, Phase.DRIVE})
AT_THE_EDGE = frozenset({Phase.APPROACH, Phase.GRASP, Phase.SETTLE, Phase.PUSH})
BASE_MOVED, BASE_TURNED = 0.10, 0.2  # [m, rad] from where a way begins: it is another way


class FoundGrasp:
    """A grasp that was found beforehand, as long as base and object are where they were then.

    Args:
        candidate: the grasp, and the way to it.
        pose: (3,) of the object then, in `world` [m, rad].
        settings: how far the object may be from there.
    """

    def __init__(self, candidate: GraspCandidate, pose: Array, settings: ExecutiveSettings) -> None:
        self._candidate, self._pose = candidate, np.array(pose)
        self._moved, self._turned = settings.fetch.moved, settings.fetch.moved_yaw

    def search(
        self,
        name: str,
        shape: BodyShape,
        pose: Array,
        base: Array,
        floor: FloorMap,
        rng: np.random.Generator,
        settings: GraspSettings,
    ) -> GraspSearch:
        """See `pbrl_control.fetching.GraspChoice.search`."""
        for what, then, now, most, most_turned in (
            ("the base", self._candidate.path.start, base, BASE_MOVED, BASE_TURNED),
            (repr(name), self._pose, pose, self._moved, self._turned),
        ):
            away = compose(inverse(then), np.asarray(now))
            distance, turned = float(np.hypot(*away[:2])), abs(float(away[2]))
            if distance > most or turned > most_turned:
                return GraspSearch(
                    (), (), f"{what} has moved by {distance:.2f} m and {turned:.2f} rad since the way was found"
                )
        return GraspSearch((self._candidate,), ())


def plan_of(move: Move, candidate: GraspCandidate, settings: ExecutiveSettings) -> TrajectoryPlan:
    """Return a move as a trajectory to be followed, no faster than furniture may go.

    Raises:
        ControlError: it is no trajectory.
    """
    limits = settings.motion
    segments = [_slowed(np.asarray(twist, dtype=float), duration, limits) for twist, duration in move.segments]
    last, time = segments[-1]
    if move.more == 0:  # a step ends where the next one begins
        segments[-1] = (last, time * settings.stretch)
    abort = settings.abort
    if move.model is None and math.isfinite(move.expected_force):
        most = max(abort.force_ratio * move.expected_force, abort.force_floor)
        abort = abort.model_copy(update={"force": most})
    if move.pushes:
        most = max(abort.force_ratio * move.expected_force, abort.force_floor)
        abort = abort.model_copy(update={"force_floor": most})
    try:
        return TrajectoryPlan(
            name=f"clear {move.object}",
            object=move.object,
            grips=candidate.grips(),
            limits=PushLimits(force=settings.hard_force),
            segments=tuple({"twist": tuple(map(float, twist)), "duration": time} for twist, time in segments),  # type: ignore[misc]
            motion=limits,
            follow=settings.follow,
            abort=abort,
        )
    except ValidationError as error:
        reason = " ".join(str(error.errors()[0]["msg"]).split())
        raise ControlError(f"move of {move.object!r}: expected a trajectory, got: {reason}") from error


def _slowed(twist: Array, duration: float, limits: MotionLimits) -> tuple[Array, float]:
    """Return the same way, slower where the twist is above the limits."""
    speed, turning = float(np.hypot(*twist[:2])), abs(float(twist[2]))
    ratio = max(speed / limits.speed, turning / limits.yaw_rate, 1.0)
    return twist / ratio, duration * ratio


class Manipulation:
    """Fetches one object and moves it.

    Args:
        move: what is to be done.
        candidate: the grasp, and the way to it.
        view: of robot and room.
        kinematics: of the robot.
        controller: settings of the body controller that obeys.
        settings: of all this.
        opened: says whether there is an opening; None: nobody can tell.

    Attributes:
        move: as given.
        candidate: as given.
        plan: as the fetch has it.
        course: what the object does while it is held.
        closed: when the first grip closed [s]; NaN before.

    Raises:
        ControlError: the move is no trajectory, or the object has no pose.
    """

    def __init__(
        self,
        move: Move,
        candidate: GraspCandidate,
        view: RoomView,
        kinematics: RobotKinematics,
        controller: ControllerSettings,
        settings: ExecutiveSettings,
        opened: Opened | None,
    ) -> None:
        pose = view.around.pose(move.object)
        if pose is None:
            raise ControlError(f"move of {move.object!r}: expected it to have been seen, it was not")
        self.move, self.candidate = move, candidate
        self.plan = plan_of(move, candidate, settings)
        self.closed = math.nan
        self._trajectory = TrajectoryCourse(self.plan, move.model)
        self.course = ClearingCourse(self._trajectory, opened, settings.check_period)
        choice = FoundGrasp(candidate, pose, settings)
        self._view, self._settings = view, settings
        self._fetch = FetchExecutive(
            self.plan,
            kinematics,
            controller,
            settings.fetch,
            choice=choice,
            course=self.course,
            struck=view.around.struck,
        )
        view.tell(self._fetch)

    @property
    def expected_force(self) -> float:
        """Largest force that is expected at any grip [N]; as planned, until the real grips are known. NaN: unknown."""
        follower = self._trajectory.follower
        known = None if follower is None else follower.expected_force
        return self.move.expected_force if known is None else known

    @property
    def force_limit(self) -> float:
        """Force at any grip that counts as unexpected [N]; NaN before the object sets out."""
        follower = self._trajectory.follower
        return math.nan if follower is None else follower.force_limit

    def part(self, state: State) -> ManipulationPart:
        """Return what does one of the three states' work."""
        return ManipulationPart(self, state)

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` [m, rad] at a time [s]."""
        self._fetch.odometry(time, pose)

    def told(self) -> None:
        """Take in that what wears no tag was told anew."""
        self._view.tell(self._fetch)

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a gripper's request."""
        self._fetch.answer(answer)

    def step(self, state: State, now: float, percept: Percept) -> Step:
        """Go on with NavigateToPoint, Grasp or ClearObstacle."""
        if state == State.NAVIGATE and percept.grips:
            return Step(still_held(percept), Event.STILL_HELD)
        command = self._fetch.tick(now, percept)
        step = Step.of(replace(command, status=command.status.removeprefix("giving up: ")))
        if state == State.NAVIGATE:
            return self._navigate(now, step)
        if state == State.GRASP:
            return self._grasp(now, step, percept)
        return self._clear(step)

    def _navigate(self, now: float, step: Step) -> Step:
        if step.phase in ON_THE_WAY and self._fetch.phase in ON_THE_WAY:
            return step
        if self._fetch.phase == Phase.FAILED:
            return Step(step.status, Event.VANISHED if self._unseen(now) else Event.WAY_LOST)
        return Step("before the edge", Event.ARRIVED)

    def _grasp(self, now: float, step: Step, percept: Percept) -> Step:
        if math.isnan(self.closed) and any(grip.object == self.move.object for grip in percept.grips.values()):
            self.closed = now
        if self._fetch.phase in AT_THE_EDGE:
            return Step("held for sure", Event.HELD) if self._fetch.confirmed else step
        if self._unseen(now):
            return Step(step.status, Event.VANISHED)
        forced = cause_of(step.status) == Event.UNEXPECTED_FORCE and bool(percept.grips)
        return Step(step.status, Event.UNEXPECTED_FORCE if forced else Event.MISSED)

    def _clear(self, step: Step) -> Step:
        if self.course.end is not None:
            event, sentence = self.course.end
            if event == Event.MOVED and self.move.more > 0:
                return Step(f"moved as planned, {self.move.more} more to follow", Event.STEPPED)
            return Step(sentence, event)
        if self._fetch.phase == Phase.PUSH:
            return step
        return Step(step.status, cause_of(step.status) or Event.FAULT)

    def _unseen(self, now: float) -> bool:
        return self._view.around.age(self.move.object, now) > self._settings.fetch.tag_age


class ManipulationPart:
    """One of the three states of a manipulation.

    Args:
        manipulation: that goes on from state to state.
        state: this one.
    """

    def __init__(self, manipulation: Manipulation, state: State) -> None:
        self._manipulation, self._state = manipulation, state

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        return self._manipulation.step(self._state, now, percept)

    def answer(self, answer: GripperAnswer) -> None:
        """See `Part.answer`."""
        self._manipulation.answer(answer)

    def drop(self) -> None:
        """See `Part.drop`."""
