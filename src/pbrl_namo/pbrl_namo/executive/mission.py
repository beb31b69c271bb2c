"""One goal: what is believed, what was tried, what is at hand; the jobs that follow and what answers come to."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.account import FAILURES, Account, Tries
from pbrl_namo.executive.asking import wrong
from pbrl_namo.executive.jobs import (
    Answer,
    Belief,
    GraspAnswer,
    GraspJob,
    LearnAnswer,
    LearnJob,
    MismatchAnswer,
    MismatchJob,
    PlanAnswer,
    PlanJob,
    Refused,
    finite,
)
from pbrl_namo.executive.manipulating import Manipulation
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import Step
from pbrl_namo.executive.table import Event, State
from pbrl_namo.executive.view import RoomView

AT_AN_OBJECT = frozenset({State.GET_GRASP_POINT, State.NAVIGATE, State.GRASP, State.CLEAR})


class Mission:
    """The way to one goal.

    Args:
        goal: (3,) in `world`; heading NaN: any [m, rad].
        beliefs: by object; kept, and changed by what is learned.
        settings: budgets.
        seed: of every draw.

    Attributes:
        goal: as given.
        beliefs: as last learned.
        tries: what was tried.
        account: what was done.
        planned: the last plan.
        grasp: the last grasp that was found.
        manipulation: the one under way, or the last.
        been: poses (3,) by object from which it was to be moved [m, rad].
        vanished: things that are taken to stand where they were last seen.
        surprised: when something last happened to a manipulation, what has ended it for instance [s]; NaN: never.

    Raises:
        NamoError: the goal is no place.
    """

    def __init__(self, goal: Array, beliefs: dict[str, Belief], settings: ExecutiveSettings, seed: int) -> None:
        self.goal = checked_goal(goal)
        self.beliefs = beliefs
        self.tries = Tries(settings.tries)
        self.account = Account()
        self.planned = PlanAnswer()
        self.grasp = GraspAnswer()
        self.manipulation: Manipulation | None = None
        self.vanished: tuple[str, ...] = ()
        self._settings, self._seed = settings, seed
        self.surprised = math.nan
        self.been: dict[str, tuple[Array, ...]] = {}
        self._stood: dict[str, Array] = {}
        self._drawn = 0

    @property
    def object(self) -> str:
        """What is being moved, or about to be; empty: nothing."""
        return "" if self.planned.move is None else self.planned.move.object

    def left_alone(self) -> tuple[str, ...]:
        """Return which things are not to be moved: given up, or not seen any more."""
        return tuple(sorted({*self.tries.given_up, *self.vanished}))

    def notes(self) -> list[str]:
        """Return what a person should know beside the sentence of the moment."""
        gone = [f"{name} is not seen, it is taken to stand where it was last" for name in self.vanished]
        return [*self.tries.given_up.values(), *gone]

    def plan_job(self, now: float, view: RoomView) -> PlanJob:
        """Return the job of planning for what is seen now; raises as of `RoomView.scene`."""
        scene = view.scene(now, self.goal, self.left_alone())
        self._stood = {name: np.array(pose) for name, pose in scene.poses.items()}
        return PlanJob(scene, dict(self.beliefs), self.tries.counts, self._draw(), dict(self.been))

    def grasp_job(self, now: float, view: RoomView) -> GraspJob:
        """Return the job of finding a grasp for the planned move; raises as of `RoomView.scene`."""
        move = self.planned.move
        if move is None:
            raise NamoError("grasp: expected a move that was planned, got none")
        scene = view.scene(now, self.goal, self.left_alone())
        if move.object not in scene.movable:
            raise NamoError(
                f"plan: expected one of {', '.join(scene.movable) or 'no things'} to be moved, got {move.object!r}"
            )
        return GraspJob(scene, move, self.tries.stands(move.object), self._draw())

    def learn_job(self) -> LearnJob:
        """Return the job of learning from the last manipulation.

        Raises:
            NamoError: nothing was held in it.
        """
        return LearnJob(*self._recorded(), self._draw())

    def mismatch_job(self) -> MismatchJob:
        """Return the job of finding out what the model of the last manipulation leaves out; raises alike."""
        return MismatchJob(*self._recorded(), self._draw())

    def take_plan(self, answer: Answer) -> Step:
        """Return what comes of a plan."""
        if isinstance(answer, Refused):
            return Step(answer.reason, Event.NO_WAY)
        if not isinstance(answer, PlanAnswer):
            return wrong(PlanAnswer, answer)
        self.planned = answer
        self.account.planning_seconds += answer.seconds
        self.account.regions = self.account.regions or answer.regions
        if answer.move is not None:
            fault = finite(answer.move)
            if fault:
                return Step(fault, Event.JOB_LOST)
            move = answer.move
            if move.object in self._stood:
                self.been[move.object] = (*self.been.get(move.object, ()), self._stood[move.object])
            if move.more > 0:
                later = f"{move.more} more to open the way from region {move.start} to {move.end}"
                return Step(f"{move.object} is moved first, {later}", Event.PLANNED)
            return Step(f"{move.object} is to open the way from region {move.start} to {move.end}", Event.PLANNED)
        if answer.way is not None:
            return Step(f"nothing is in the way, {answer.way.length:.1f} m to drive", Event.NOTHING_TO_DO)
        reason = answer.reason or "the planner gave no reason"
        reason = reason if reason.startswith("no way") else f"no way to the goal: {reason}"
        told = not answer.cut_off or "cut off" in reason
        regions = "" if told else f"; cut off: regions {', '.join(map(str, answer.cut_off))}"
        return Step("; ".join([f"{reason}{regions}", *self.notes()]), Event.NO_WAY)

    def take_grasp(self, answer: Answer) -> Step:
        """Return what comes of a search for a grasp."""
        if isinstance(answer, Refused):
            return Step(answer.reason, Event.NO_GRASP)
        if not isinstance(answer, GraspAnswer):
            return wrong(GraspAnswer, answer)
        self.account.planning_seconds += answer.seconds
        if answer.candidate is None:
            return Step(f"no grasp of {self.object!r}: {answer.reason}", Event.NO_GRASP)
        self.grasp = answer
        hands = " and ".join(answer.candidate.sides)
        return Step(f"{answer.candidate.path_length:.1f} m to drive, then to grasp {hands}", Event.GRASP_FOUND)

    def take_learned(self, answer: Answer) -> Step:
        """Return what comes of learning."""
        if isinstance(answer, Refused):
            return Step(f"nothing is learned of {self.object!r}: {answer.reason}", Event.NOT_LEARNED)
        if not isinstance(answer, LearnAnswer):
            return wrong(LearnAnswer, answer)
        self.account.learning_seconds += answer.seconds
        if answer.belief is None:
            return Step(f"nothing is learned of {self.object!r}: {answer.reason}", Event.NOT_LEARNED)
        self.beliefs[self.object] = answer.belief
        if answer.explained or not self._settings.ask_mismatch:
            return Step(f"the model of {self.object!r} is updated; {answer.reason}".rstrip("; "), Event.UPDATED)
        return Step(f"the model of {self.object!r} does not explain it: {answer.reason}", Event.UNEXPLAINED)

    def take_mismatch(self, answer: Answer) -> Step:
        """Return what comes of asking what a model leaves out."""
        if isinstance(answer, Refused):
            return Step(answer.reason, Event.UNKNOWN)
        if not isinstance(answer, MismatchAnswer):
            return wrong(MismatchAnswer, answer)
        self.account.learning_seconds += answer.seconds
        if answer.belief is None:
            return Step(f"what the model of {self.object!r} leaves out is not known; {answer.found}", Event.UNKNOWN)
        self.beliefs[self.object] = answer.belief
        return Step(f"left out of the model of {self.object!r}: {answer.found}", Event.REPAIRED)

    def take_note(self, now: float, state: State, step: Step) -> None:
        """Remember what an event says of the object at hand."""
        if state not in AT_AN_OBJECT or step.event is None:
            return
        if step.event in FAILURES:
            self.tries.failed(self.object, step.status)
        if step.event == Event.OPENED:
            self.tries.opened(self.object)
        if step.event in (Event.MISSED, Event.GRIP_SLIPPED) and self.grasp.candidate is not None:
            self.tries.missed(self.object, self.grasp.candidate.base_goal[:2])
        self.surprised = now

    def _recorded(self) -> tuple[str, float, float, Belief | None]:
        held = self.manipulation
        if held is None or not math.isfinite(held.closed) or not self.surprised > held.closed:
            raise NamoError(f"learning of {self.object!r}: expected it to have been held, it was not")
        name = held.move.object
        return name, held.closed, self.surprised, self.beliefs.get(name)

    def _draw(self) -> int:
        """Return the seed of the next job, above zero: the same ones in the same order for the same seed."""
        self._drawn += 1
        return job_seed(self._seed, self._drawn)


def job_seed(seed: int, number: int) -> int:
    """Return the seed of a mission's job, above zero.

    Args:
        seed: of the mission.
        number: of the job, from 1 on; the first one is a plan.
    """
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0] % (2**31 - 1)) + 1


def checked_goal(goal: Array) -> Array:
    """Return a goal (3,) as an array.

    Raises:
        NamoError: it is no place.
    """
    found = np.asarray(goal, dtype=float)
    if found.shape != (3,) or not np.isfinite(found[:2]).all() or math.isinf(found[2]):
        raise NamoError(f"goal: expected (x, y, theta) with finite x and y, theta may be NaN, got {goal}")
    return found
