"""Who thinks for the node: `Thoughts` in a process of its own, which is given what was heard with each job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pbrl_model.ros.heard import Message, recording_of
from pbrl_namo.executive import Answer, Job, LearnJob, MismatchJob, PlanAnswer, PlanJob, ProcessThinker
from pbrl_namo.executive.thinker import answered
from pbrl_namo.regions.free_space import free_space
from pbrl_namo.ros.markers import Floor
from pbrl_namo.thinking import Thoughts
from pbrl_namo.warming import compile_kernels, compile_learning


@dataclass(frozen=True)
class Asked:
    """A job, and what was heard that it may ask for: bytes, which are decoded where there is time."""

    job: Job
    heard: list[Message]


@dataclass(frozen=True)
class Thought:
    """An answer, and the floor that was planned on: free space is found where there is time, with the plan."""

    answer: Answer
    floor: Floor | None


class NodeThinker:
    """See `Thinker`.

    Args:
        heard: gives all that was heard and is still kept.

    Attributes:
        floor: that was planned on last, to be drawn; None: nothing was planned yet.
    """

    def __init__(self, heard: Callable[[], list[Message]]) -> None:
        self.floor: Floor | None = None
        self._heard = heard
        self._process = ProcessThinker(ready_to_think, compile_learning)
        self._process.start()

    def begin(self, job: Job) -> None:
        """See `Thinker.begin`."""
        self._process.begin(Asked(job, self._heard() if isinstance(job, LearnJob | MismatchJob) else []))

    def poll(self) -> Answer | None:
        """See `Thinker.poll`."""
        thought = self._process.poll()
        if not isinstance(thought, Thought):
            lost: Answer | None = thought
            return lost
        self.floor = thought.floor or self.floor
        return thought.answer

    def drop(self) -> None:
        """See `Thinker.drop`."""
        self._process.drop()

    def close(self) -> None:
        """End the process, whatever it is at."""
        self._process.close()


def ready_to_think() -> Callable[[Asked], Thought]:
    """Compile what planning calls, then return `think`."""
    compile_kernels()
    return think


def think(asked: Asked) -> Thought:
    """Return the answer to a job."""
    job, floor = asked.job, None
    answer = answered(Thoughts(lambda begin, end: recording_of(asked.heard)), job)
    if isinstance(job, PlanJob) and isinstance(answer, PlanAnswer):
        floor = Floor(job.scene, free_space(job.scene).regions)
    return Thought(answer, floor)
