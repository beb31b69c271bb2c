"""Moving an obstacle until there is an opening: a trajectory that ends early, well or badly, and then holds still.

A push lets go as soon as its course has ended. This one has not ended until it is told to: what was felt is learned
from first, while the object is still held (thesis 6.4).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from pbrl_control.course import Course, CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.percept import Percept
from pbrl_control.types import Hold, PlanarTwist
from pbrl_namo.executive.table import Event

Opened = Callable[[float, Percept], bool]
"""Says whether there is an opening, given the time [s] and what is seen."""

CAUSES: tuple[tuple[str, Event], ...] = (
    (r"unexpected force at ", Event.UNEXPECTED_FORCE),
    (r"(left|right) grip force: ", Event.UNEXPECTED_FORCE),
    (r"stall: ", Event.STALLED),
    (r"time-out: ", Event.TIMED_OUT),
    (r"lost tag: ", Event.TAG_LOST),
    (r"tag '.*' was lost: |tag '.*': ", Event.TAG_LOST),
    (r"(left|right) gripper lost ", Event.GRIP_LOST),
    (r"(left|right) grip on '.*': ", Event.GRIP_SLIPPED),
)
"""How a push or trajectory begins to say why it gives up, and which event that is; anything else is a fault."""


class ClearingCourse:
    """Follows a course and looks for the opening.

    Args:
        course: how the object is to move.
        opened: whether there is an opening; None: nobody can tell.
        period: [s] between two looks.

    Attributes:
        end: what has ended it, and a sentence; None while it goes on.
        felt: largest horizontal force at any grip, now [N]; NaN before the first.
        most_felt: so far.
    """

    def __init__(self, course: Course, opened: Opened | None, period: float) -> None:
        self.end: tuple[Event, str] | None = None
        self.felt = math.nan
        self.most_felt = 0.0
        self._course, self._opened, self._period = course, opened, period
        self._looked: float | None = None

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        """See `Course.step`; never finished, at rest once it has ended."""
        self.felt = max(forces.values(), default=math.nan)
        self.most_felt = max(self.most_felt, self.felt) if math.isfinite(self.felt) else self.most_felt
        if self.end is None:
            try:
                step = self._go_on(now, dt, percept, hold, forces)
            except ControlError as error:
                self.end = (cause_of(str(error)) or Event.FAULT, str(error))
            else:
                if step is not None:
                    return step
        assert self.end is not None
        return CourseStep(PlanarTwist(), self.end[1])

    def _go_on(
        self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]
    ) -> CourseStep | None:
        """Return what the object is to do; None, and why in `end`, where that is over."""
        self._looked = now if self._looked is None else self._looked
        if now - self._looked >= self._period:
            self._looked = now
            if self._is_open(now, percept):
                self.end = (Event.OPENED, "there is an opening")
                return None
        step = self._course.step(now, dt, percept, hold, forces)
        if not step.finished:
            return step
        if self._is_open(now, percept):
            self.end = (Event.OPENED, f"there is an opening; {step.status}")
        else:
            self.end = (Event.MOVED, f"moved as planned, but there is no opening; {step.status}")
        return None

    def _is_open(self, now: float, percept: Percept) -> bool:
        return self._opened is not None and self._opened(now, percept)


def cause_of(sentence: str) -> Event | None:
    """Return which event the reason of a push or trajectory for giving up is; None where it is none of `CAUSES`."""
    reason = sentence.removeprefix("giving up: ")
    return next((event for pattern, event in CAUSES if re.match(pattern, reason)), None)
