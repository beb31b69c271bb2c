"""Keeps what was planned in last, so that it can be drawn; free space is found where there is time: with the plan."""

from __future__ import annotations

from collections.abc import Callable

from pbrl_control.errors import ControlError
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import Answer, Job, PlanJob
from pbrl_namo.regions.free_space import free_space
from pbrl_namo.ros.markers import Floor


class Planned:
    """Answers jobs as another does, in that one's thread.

    Args:
        answer: does the work.

    Attributes:
        floor: that was planned in last; None: nothing was planned yet.
        busy: whether a job is being answered.
    """

    def __init__(self, answer: Callable[[Job], Answer]) -> None:
        self._answer = answer
        self.floor: Floor | None = None
        self.busy = False

    def __call__(self, job: Job) -> Answer:
        """Return the answer to a job; raises as whoever answers it."""
        self.busy = True
        try:
            answer = self._answer(job)
            if isinstance(job, PlanJob):
                self.floor = _floor(job)
            return answer
        finally:
            self.busy = False


def _floor(job: PlanJob) -> Floor | None:
    try:
        return Floor(job.scene, free_space(job.scene).regions)
    except (ControlError, NamoError):  # a picture that cannot be drawn is no reason to give up a plan
        return None
