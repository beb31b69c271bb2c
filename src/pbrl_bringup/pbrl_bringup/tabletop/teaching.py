"""Teaching a simulated desk: items are pushed until displacement models are known (LEARN_MODEL, thesis figure 1)."""

from __future__ import annotations

from collections.abc import Callable

from pbrl_bringup.errors import BringupError
from pbrl_bringup.tabletop.desk_run import DeskRun
from pbrl_control.planar import Array
from pbrl_planner.tabletop import Ended, LearnedDisplacements, Lessons, LessonSettings, Push, Teaching

Seen = tuple[str, Push, Array]
"""Item, push, and the displacement (3,) in the item's frame before that it was seen to do."""


def teach(
    run: DeskRun,
    pushes: tuple[Push, ...],
    settings: LessonSettings | None = None,
    told: Callable[[int], None] | None = None,
) -> tuple[LearnedDisplacements, list[Seen]]:
    """Push the items of a desk until all pushes are known, and return the model and what was seen.

    Args:
        run: the desk.
        pushes: to be known.
        settings: how well.
        told: is called with the number of pushes so far.

    Raises:
        BringupError: an item is lost, or no push has room although some are still to be learned.
    """
    task = Teaching(Lessons(run.desk, pushes, settings))
    while True:
        asked = task.next(run.look())
        if isinstance(asked, Ended):
            break
        run.push(asked.path)
        if told is not None:
            told(task.pushes)
    if not asked.ending.success:
        raise BringupError(f"teaching: {asked.ending.value}: {asked.reason}")
    return task.lessons.model, task.seen
