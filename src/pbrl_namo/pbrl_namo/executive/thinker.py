"""Who answers the executive's jobs, and how he is asked: nobody waits, and who dies is asked again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from pbrl_control.errors import ControlError
from pbrl_model.errors import ModelError
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import Answer, Job, Lost, Refused
from pbrl_namo.executive.settings import JobSettings


class Thinker(Protocol):
    """Whoever plans and learns, one job at a time; none of its methods waits."""

    def begin(self, job: Job) -> None:
        """Start a job; one that is under way is dropped."""
        ...

    def poll(self) -> Answer | None:
        """Return the answer, once; None while there is none."""
        ...

    def drop(self) -> None:
        """Forget the job: nobody wants its answer any more."""
        ...


class ImmediateThinker:
    """Answers in `begin`: for tests, and for whoever has the time.

    Args:
        answer: what does the work.
    """

    def __init__(self, answer: Callable[[Job], Answer]) -> None:
        self._answer = answer
        self._found: Answer | None = None

    def begin(self, job: Job) -> None:
        """See `Thinker.begin`."""
        self._found = answered(self._answer, job)

    def poll(self) -> Answer | None:
        """See `Thinker.poll`."""
        found, self._found = self._found, None
        return found

    def drop(self) -> None:
        """See `Thinker.drop`."""
        self._found = None


def answered(answer: Callable[[Job], Answer], job: Job) -> Answer:
    """Return the answer to a job; what the house refuses is `Refused`, any other error `Lost`."""
    try:
        return answer(job)
    except (NamoError, ControlError, ModelError) as error:
        return Refused(" ".join(str(error).split()))
    except Exception as error:
        return Lost(one_line(error))


def one_line(error: BaseException) -> str:
    """Return an error's kind and what it says, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


class Question:
    """One job that is asked until there is an answer, or no hope of one.

    Args:
        thinker: who is asked.
        job: what.
        timeout: [s] until an asking counts as lost.
        settings: how often it is asked again, and when.

    Attributes:
        lost: why each asking so far has led to nothing.
    """

    def __init__(self, thinker: Thinker, job: Job, timeout: float, settings: JobSettings) -> None:
        self.lost: list[str] = []
        self._thinker, self._job = thinker, job
        self._timeout, self._settings = timeout, settings
        self._asked: float | None = None
        self._due: float | None = None  # when it is asked next

    def step(self, now: float) -> Answer | None:
        """Return the answer; None while there is none. `Lost`: after the last asking only."""
        if self._asked is None:
            if self._due is not None and now < self._due:
                return None
            self._asked = now
            lost = self._begin()
            if lost is not None:
                return self._again(now, lost)
        answer = self._poll()
        if answer is None and now - self._asked > self._timeout:
            self._thinker.drop()
            answer = Lost(f"no answer within {self._timeout:.0f} s")
        return self._again(now, answer) if isinstance(answer, Lost) else answer

    def drop(self) -> None:
        """Nobody wants the answer any more."""
        self._thinker.drop()

    def _begin(self) -> Lost | None:
        try:
            self._thinker.begin(self._job)
        except Exception as error:  # whatever a thinker does, the robot goes on ticking
            return Lost(one_line(error))
        return None

    def _poll(self) -> Answer | None:
        try:
            return self._thinker.poll()
        except Exception as error:
            return Lost(one_line(error))

    def _again(self, now: float, lost: Lost) -> Lost | None:
        self.lost.append(lost.reason)
        if len(self.lost) >= self._settings.tries:
            return Lost(f"asked {len(self.lost)} times, the last time: {lost.reason}")
        self._asked, self._due = None, now + self._settings.wait
        return None
