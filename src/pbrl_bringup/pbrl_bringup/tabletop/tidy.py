"""Tidying a simulated desk to the end: look, push, look again, with what came of it told in numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pbrl_bringup.tabletop.desk_run import DeskRun
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_planner.tabletop import Ended, Ending, Tidying


@dataclass(frozen=True)
class Outcome:
    """What became of one run.

    Attributes:
        ending: name of an `Ending`.
        reason: in words.
        pushes: made.
        replans: searches after the first.
        first_cost: of the layout at the start, as it truly was.
        cost: of the layout at the end, as it truly was.
        planning: time of all searches [s].
        simulated: time that it took the robot [s].
    """

    ending: str
    reason: str
    pushes: int
    replans: int
    first_cost: float
    cost: float
    planning: float
    simulated: float


def tidied(run: DeskRun, task: Tidying, shown: Callable[[int], None] | None = None) -> tuple[Outcome, list[Array]]:
    """Tidy until the task ends.

    Args:
        run: the desk.
        task: what is wanted of it.
        shown: is called with the number of pushes so far, before the first and after each, the arm out of sight.

    Returns:
        What became of it, and where the items truly were (n, 3), before the first push and after each.
    """
    begun, layouts = run.session.time, [run.truth()]
    first = task.objective(layouts[0])
    ending, reason = "", ""
    if shown is not None:
        shown(0)
    while not ending:
        asked = task.next(run.look())
        if isinstance(asked, Ended):
            ending, reason = asked.ending.name, asked.reason
            break
        try:
            run.push(asked.path)
        except ControlError as error:
            ending, reason = Ending.UNREACHED.name, str(error)
        layouts.append(run.truth())
        if shown is not None:
            shown(task.pushes)
    cost = task.objective(layouts[-1])
    simulated = run.session.time - begun
    return (
        Outcome(ending, reason, task.pushes, max(task.replans, 0), first, cost, task.planning_seconds, simulated),
        layouts,
    )
