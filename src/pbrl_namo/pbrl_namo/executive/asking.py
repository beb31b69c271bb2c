"""Computational states: one job is asked until it is answered, while the robot rests."""

from __future__ import annotations

from collections.abc import Callable

from pbrl_control.percept import Percept
from pbrl_control.push import Phase
from pbrl_namo.executive.jobs import Answer, Lost
from pbrl_namo.executive.step import BasePart, Step
from pbrl_namo.executive.table import Event
from pbrl_namo.executive.thinker import Question


class Asking(BasePart):
    """Asks one question.

    Args:
        question: what, and who is asked.
        take: what the answer means: an event.
        what: is asked for, in words.
        phase: to be told.
    """

    def __init__(self, question: Question, take: Callable[[Answer], Step], what: str, phase: Phase) -> None:
        self._question, self._take, self._what, self._phase = question, take, what, phase

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        answer = self._question.step(now)
        if answer is None:
            lost = self._question.lost
            again = f" (asking again: {lost[-1]})" if lost else ""
            return Step(f"waiting for {self._what}{again}", None, self._phase)
        if isinstance(answer, Lost):
            return Step(f"{self._what}: expected an answer, got none; {answer.reason}", Event.JOB_LOST)
        return self._take(answer)

    def drop(self) -> None:
        """See `Part.drop`."""
        self._question.drop()


def wrong(expected: type, got: Answer) -> Step:
    """Return what an answer of another kind than was asked for comes to."""
    return Step(f"expected {expected.__name__} as an answer, got {type(got).__name__}", Event.JOB_LOST)
