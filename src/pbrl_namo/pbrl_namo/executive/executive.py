"""The executive of navigation among movable obstacles: thesis figure 42, ticked. Pure; the time is given.

It takes the place of a fetch in a control loop: percepts in, commands out. What takes time, planning and learning, is
asked of a `Thinker` and waited for at rest; what moves is done by parts that know nothing of each other; what leads
where is `TABLE`. An event always goes with rest: whatever ends a motion, the command is zero in that same tick.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pbrl_control.errors import ControlError
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasp_plan import Grip as GripPlan
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import Percept
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, Phase, PushCommand
from pbrl_control.settings import ControllerSettings
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.account import Change
from pbrl_namo.executive.jobs import Belief
from pbrl_namo.executive.mission import Mission, checked_goal
from pbrl_namo.executive.parts import OpeningCheck, Parts
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import Part, Step, rest, still_held
from pbrl_namo.executive.table import ENDED, MOVING, Event, State, next_state
from pbrl_namo.executive.thinker import Thinker
from pbrl_namo.executive.view import Look, RoomView

NOTHING = GraspPlan(name="nothing yet", object="nothing", grips=(GripPlan(gripper="left", point=(0.0, 0.0)),))
"""The plan before there is one."""

CANNOT_BEGIN = {
    State.PLANNING: Event.NO_WAY,
    State.GET_GRASP_POINT: Event.NO_GRASP,
    State.NAVIGATE: Event.WAY_LOST,
    State.DRIVE_TO_GOAL: Event.WAY_LOST,
    State.UPDATE_MODEL: Event.NOT_LEARNED,
    State.ASK_MISMATCH: Event.UNKNOWN,
}
"""What it is called where a state cannot even be begun; elsewhere a fault."""


@dataclass(frozen=True)
class Order(PushCommand):
    """What is wanted now: a push command for a control loop, and the executive's own state."""

    state: State = State.LOOK


class NamoExecutive:
    """Brings the robot to a goal, moving what is in the way.

    Args:
        goal: (3,) in `world`; heading NaN: any [m, rad].
        kinematics: of the robot.
        thinker: who plans and learns.
        opening: says whether an opening has been made; None: nobody can tell, and each move is made to its end.
        controller: settings of the body controller that obeys.
        settings: patience, tolerances, budgets.
        beliefs: what is believed already, by object.
        seed: of every draw.

    Attributes:
        plan: the manipulation's, as a control loop wants it.
        phase: where it is, in the words of pushes and fetches.
        state: where it is.
        reason: why it has ended, or is about to; empty: neither.
        mission: the goal at hand, with beliefs, tries and counts.
        view: what is known of robot and room.

    Raises:
        NamoError: the goal is no place.
        ControlError: the controller is told not to stow idle arms.
    """

    def __init__(
        self,
        goal: Array,
        kinematics: RobotKinematics,
        thinker: Thinker,
        *,
        opening: OpeningCheck | None = None,
        controller: ControllerSettings | None = None,
        settings: ExecutiveSettings | None = None,
        beliefs: Mapping[str, Belief] | None = None,
        seed: int = 0,
    ) -> None:
        controller = controller or ControllerSettings()
        if not controller.stow_idle_arm:
            raise ControlError("executive: expected a controller that stows idle arms, got stow_idle_arm: false")
        self.settings = settings or ExecutiveSettings()
        self.mission = Mission(goal, dict(beliefs or {}), self.settings, seed)
        self.view = RoomView(kinematics, self.settings)
        self.plan, self.phase, self.state = NOTHING, Phase.LOCATE, State.LOOK
        self.reason = ""
        self.sentence = "not begun"
        self._seed = seed
        self._parts = Parts(
            self.view, kinematics, thinker, opening, controller, self.settings, lambda: self._paused_for
        )
        self._part: Part | None = None
        self._last: float | None = None
        self._begun: float | None = None  # of this goal
        self._paused_for = ""
        self._cancel = ""
        self._clock_set_back = False
        self._next_goal: Array | None = None

    def aim(self, goal: Array, seed: int | None = None) -> None:
        """Take another goal, in mid-action or after the end; raises NamoError where it is no place.

        Args:
            goal: (3,) in `world`; heading NaN: any [m, rad].
            seed: of every draw on the way there; None: as of the goal before.
        """
        self._next_goal, self._cancel = checked_goal(goal), ""
        self._seed = self._seed if seed is None else seed

    def cancel(self, reason: str = "cancelled") -> None:
        """End it: let go of what is held, then rest."""
        self._cancel, self._next_goal = reason, None

    def pause(self, reason: str) -> None:
        """Rest until `resume`: somebody without whom nothing can be done is gone."""
        self._paused_for = reason

    def resume(self) -> None:
        """Go on: he is back. What is held is let go, the world is looked at anew."""
        self._paused_for = ""

    def believe(self, name: str, belief: Belief) -> None:
        """Take in what was learned of an object by others; the next plan knows it."""
        self.mission.beliefs[name] = belief

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` [m, rad] at a time [s]."""
        self.view.odometry(time, pose)
        if self.mission.manipulation is not None:
            self.mission.manipulation.odometry(time, pose)

    def told(self, room: Array | None, fixed: Mapping[str, Array], masses: Mapping[str, float] | None = None) -> None:
        """Take in what wears no tag (see `Surroundings.told`), and what things are said to weigh [kg], by name."""
        self.view.told(room, fixed, masses or {})
        if self.mission.manipulation is not None:
            self.mission.manipulation.told()

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a gripper's request."""
        if self._part is not None:
            self._part.answer(answer)

    def tick(self, now: float, percept: Percept) -> Order:
        """Return what to do at `now` [s], given the latest percept; never raises for what it perceives."""
        if not math.isfinite(now):
            return self._order(Step(f"time: expected a finite number, got {now}"), percept)
        self._pass_time(now)
        self.view.take(now, percept)
        step = self._interruption(now) or self._work(now, percept)
        if step.event is None:
            return self._order(step, percept)
        self._happen(now, step, percept)
        return self._order(Step(self.sentence, None, self.phase), percept)

    def _pass_time(self, now: float) -> None:
        if self._last is not None and now < self._last:
            self._clock_set_back = True
            self._begun = None
            self.view.forget()
        elif self._last is not None:
            self.mission.account.pass_time(self.state, now - self._last)
        self._last = now
        self._begun = now if self._begun is None else self._begun

    def _interruption(self, now: float) -> Step | None:
        """Return what happens whatever is being done; None where nothing does."""
        clock, self._clock_set_back = self._clock_set_back, False
        cancel, self._cancel = self._cancel, ""
        if self._next_goal is not None and (self.state in ENDED or not (cancel or clock)):
            return Step("a new goal was given", Event.GOAL_CHANGED)
        if self.state in ENDED:
            return None
        if cancel and self.state != State.RELEASE_AND_CANCEL:
            return Step(cancel, Event.CANCELLED)
        spent = self._budget(now)
        if spent is not None or self.state == State.PAUSED:
            return spent
        if clock:
            return Step("the clock was set back: was a simulation begun anew?", Event.LINK_LOST)
        return Step(self._paused_for, Event.LINK_LOST) if self._paused_for else None

    def _budget(self, now: float) -> Step | None:
        """Return that it has gone on for long enough; None where it has not."""
        account, settings = self.mission.account, self.settings
        if self.state in (State.RELEASE_AND_FAIL, State.RELEASE_AND_CANCEL) or self._begun is None:
            return None
        if now - self._begun > settings.time_limit:
            reason = f"expected to be there within {settings.time_limit:.0f} s, is not"
        elif account.plans >= settings.plans and self.state == State.LOOK:
            reason = f"expected to be there with {settings.plans} plans, is not"
        elif account.faults >= settings.faults:
            reason = f"{account.faults} faults, the last one: {self.sentence}"
        else:
            return None
        return Step("; ".join([f"gave up: {reason}", *self.mission.notes()]), Event.GAVE_UP)

    def _work(self, now: float, percept: Percept) -> Step:
        """Let the state's part go on; make it first where the state is new."""
        if self._part is None:
            try:
                self._part = self._parts.make(self.state, now, self.mission, self.reason)
                held = self.mission.manipulation
                self.plan = self.plan if held is None else held.plan
            except (ControlError, NamoError) as error:
                return Step(_line(error), CANNOT_BEGIN.get(self.state, Event.FAULT))
        try:
            return self._part.step(now, percept)
        except (ControlError, NamoError) as error:
            return Step(_line(error), Event.FAULT)

    def _happen(self, now: float, step: Step, percept: Percept) -> None:
        """Go where an event leads, and take note of it."""
        assert step.event is not None
        before, event, sentence = self.state, step.event, step.status
        try:
            after = next_state(before, event)
        except NamoError as error:  # cannot happen; if it does, the robot rests and says so
            after, sentence = State.FAILED, _line(error)
        if isinstance(self._part, Look):
            self.mission.vanished = self._part.vanished
        self.mission.take_note(now, before, step)
        if event == Event.GOAL_CHANGED:
            self._aim(now)
        if self._part is not None and (after != before or (event == Event.GOAL_CHANGED and after == State.LOOK)):
            self._part.drop()
            self._part = None
        if before == State.PAUSED and after != State.PAUSED:
            self.view.forget()
        self._explain(before, event, after, sentence, percept)
        self.mission.account.note(Change(now, before, event, after, sentence, self.mission.object))
        self.state, self.sentence = after, self.reason if after in ENDED and self.reason else sentence
        ends = {State.DONE: Phase.DONE, State.FAILED: Phase.FAILED, State.CANCELLED: Phase.FAILED}
        self.phase = ends.get(after, Phase.SETTLE if percept.grips else Phase.LOCATE)

    def _aim(self, now: float) -> None:
        """Begin anew with the goal that was given, and with everything that was learned."""
        assert self._next_goal is not None
        held = self.mission.manipulation, self.mission.planned, self.mission.grasp
        surprised = self.mission.surprised
        self.mission = Mission(self._next_goal, self.mission.beliefs, self.settings, self._seed)
        self.mission.manipulation, self.mission.planned, self.mission.grasp = held
        self.mission.surprised = surprised
        self._next_goal, self._begun = None, now
        self.view.around.struck.forget()

    def _explain(self, before: State, event: Event, after: State, sentence: str, percept: Percept) -> None:
        """Keep why it has ended, or will as soon as what is held is let go."""
        ending = (State.RELEASE_AND_FAIL, State.RELEASE_AND_CANCEL)
        if after not in ENDED and after not in ending:
            self.reason = ""
            return
        if after == before:
            return
        if before in ending and self.reason:
            sentence = self.reason if event == Event.RELEASED else f"{self.reason}; {sentence}"
        held = still_held(percept) if after in ENDED else ""
        self.reason = f"{sentence}; still {held}" if held and held not in sentence else sentence

    def _order(self, step: Step, percept: Percept) -> Order:
        """Return a step as a command: at rest wherever nothing is to move."""
        ended = self.state in ENDED
        # Whoever is paused says nothing: without commands the controller halts, which is sooner than it comes to rest.
        silent = ended or self.state == State.PAUSED
        self.phase = self.phase if ended else step.phase
        self.sentence = step.status
        moving = self.state in MOVING and step.twists and all(twist.finite() for twist in step.twists.values())
        twists = {} if silent else step.twists if moving else rest(percept)
        return Order(self.phase, step.status, twists, step.requests, step.expected, self.state)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
