"""The executive of the desk: states and events, ticked; strokes of the arm come out.

Looking and moving take turns, so that the arm is never in the picture that is thought about. Thinking is left to
whoever ticks: it may take seconds, in which the arm stands still beside the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from pbrl_bag.liveness import OWN_DELAY
from pbrl_control.ball_arm import Stroke, Strokes
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_planner.tabletop.task import Ended, Ending, NextPush, Task

SETTLE = 0.2
"""[s] between the end of a motion and the first picture that counts."""
LOOKS = 3
"""Pictures in which an item may be missing before it counts as lost: people reach across tables."""
BLIND = 5.0
"""Without a look for so long [s] the camera is not there any more."""


class State(Enum):
    """What is being done."""

    IDLE = "waits for a goal"
    STOWING = "takes the arm out of sight"
    LOOKING = "looks"
    THINKING = "thinks"
    PUSHING = "pushes"


class DeskExecutive:
    """Carries a task out with one arm.

    Args:
        strokes: of the arm.

    Attributes:
        state: what is being done.
        last_task: the one under way, or else the one before.
        ended: how that ended; None while it is under way, or there was none.
        question: the poses to be thought about, by name; None where there is nothing to think about.
    """

    def __init__(self, strokes: Strokes) -> None:
        self._strokes = strokes
        self.state = State.IDLE
        self.ended: Ended | None = None
        self.question: Mapping[str, Array] | None = None
        self.last_task: Task | None = None
        self._stroke: Stroke | None = None
        self._begun = self._clear = self._looked = self._ticked = 0.0
        self._misses = 0

    @property
    def task(self) -> Task | None:
        """The task under way; None: none is."""
        return self.last_task if self.ended is None else None

    def begin(self, task: Task, now: float, joints: Array) -> None:
        """Take a task up; the one before, if any, is dropped, and the arm taken out of sight first.

        Args:
            task: what is wanted.
            now: time [s].
            joints: (4,) where the arm is [rad].
        """
        self.last_task, self.ended, self.question, self._misses = task, None, None, 0
        self._ticked = now
        self._stow(now, joints)

    def cancel(self, now: float, joints: Array) -> None:
        """Drop the task under way; the arm is taken out of sight."""
        if self.task is not None:
            self.ended, self.question = Ended(Ending.CANCELLED, "cancelled"), None
            self._stow(now, joints)

    def halt(self, ended: Ended) -> None:
        """End the task under way, if any, and leave the arm where it is."""
        self._stroke, self.question, self.state = None, None, State.IDLE
        if self.task is not None:
            self.ended = ended

    def tick(self, now: float, joints: Array) -> Array | None:
        """Return the angles (4,) that the arm is to have now; None: it stays where it is.

        Args:
            now: time [s].
            joints: (4,) where the arm is [rad].
        """
        if now < self._ticked:  # by a simulator begun anew: arm and items are elsewhere
            self.halt(Ended(Ending.SET_BACK, f"by {self._ticked - now:.2f} s; give the goal again"))
        self._go_on_after_standing(now)
        if self.state is State.LOOKING and now > self._looked + BLIND:
            self.halt(Ended(Ending.BLIND, f"no picture of it for {BLIND:.0f} s; is the camera running?"))
        if self._stroke is None:
            return None
        index = int((now - self._begun) / self._stroke.period)
        if index < len(self._stroke.joints):
            return self._stroke.joints[max(index, 0)]
        last = self._stroke.joints[-1]
        self._stroke = None
        if self.state is State.PUSHING:
            self._stow(now, last)
        elif self.state is State.STOWING:
            self.state = State.LOOKING if self.task is not None else State.IDLE
            self._clear = self._looked = now + SETTLE
        return last

    def see(self, stamp: float, poses: Mapping[str, Array], wanted: int) -> None:
        """Take in what a picture shows.

        Args:
            stamp: when it was taken [s].
            poses: of the items that were found, (3,) by name.
            wanted: how many there should be.
        """
        if self.state is not State.LOOKING or stamp < self._clear:
            return
        self._looked = stamp
        if len(poses) < wanted and self._misses < LOOKS:
            self._misses += 1
            return
        self._misses, self.question, self.state = 0, poses, State.THINKING

    def answer(self, asked: NextPush | Ended, now: float, joints: Array) -> None:
        """Take the answer to the question: a push is begun, or the task has ended."""
        if self.state is not State.THINKING or self.task is None:
            return
        self.question = None
        if isinstance(asked, Ended):
            self.ended, self.state = asked, State.IDLE
            return
        try:
            self._start(self._strokes.push(joints, asked.path), now, State.PUSHING)
        except ControlError as error:
            self.ended, self.state = Ended(Ending.UNREACHED, str(error)), State.IDLE

    def _go_on_after_standing(self, now: float) -> None:
        """Let time in which nobody ticked not count: a stroke goes on where it is, a look is waited for anew."""
        stood = now - self._ticked
        if stood > OWN_DELAY:
            self._begun += stood
            self._looked += stood
        self._ticked = now

    def _stow(self, now: float, joints: Array) -> None:
        try:
            self._start(self._strokes.stow(joints), now, State.STOWING)
        except ControlError as error:
            self.ended, self.state = Ended(Ending.UNREACHED, str(error)), State.IDLE

    def _start(self, stroke: Stroke, now: float, state: State) -> None:
        self._stroke, self._begun, self.state = stroke, now, state
