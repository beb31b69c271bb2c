"""One question to the planner as a node is asked it: on whose map, and what the answer is called."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.cart.navigator import Answer, Improved, Navigator
from pbrl_planner.costmap import INSCRIBED, LETHAL, CostField
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import CostGrid, LatticePlan

SAME = 1e-6
"""Of a resolution, relative, by which two count as one."""


class Outcome(Enum):
    """What a question came to; the numbers are those of the action `PlanCartPath`."""

    FOUND = 0
    NO_PATH = 1
    GOAL_OCCUPIED = 2
    GOAL_OFF_MAP = 3
    START_OCCUPIED = 4
    START_OFF_MAP = 5
    UNDECIDED = 6
    NOT_READY = 7
    STOPPED = 8


OUTCOMES = {
    Answer.PLAN: Outcome.FOUND,
    Answer.NO_PATH: Outcome.NO_PATH,
    Answer.GOAL_TAKEN: Outcome.GOAL_OCCUPIED,
    Answer.SHUT_IN: Outcome.START_OCCUPIED,
    Answer.UNDECIDED: Outcome.UNDECIDED,
}


@dataclass(frozen=True)
class Reply:
    """An answer.

    Attributes:
        outcome: what it came to.
        message: in a sentence.
        plan: where one was found.
        poses: (n, 4) of it, and before them where robot and cart are, which is not quite where it begins.
    """

    outcome: Outcome
    message: str
    plan: LatticePlan | None = None
    poses: Array = field(default_factory=lambda: np.zeros((0, 4)))


def ask(
    navigator: Navigator, now: float, floor: CostField, start: Array, goal: Array, improved: Improved | None = None
) -> Reply:
    """Plan from a pose (4,) to a pose (3,) of `base` in `map` on a costmap of any resolution.

    Args:
        navigator: plans.
        now: [s], for its account.
        floor: costs of it.
        start: x, y, heading, articulation [m, rad].
        goal: x, y, heading, the cart straight.
        improved: is given each solution as soon as it is there; returns True: it is good enough.
    """
    for outcome, what, pose in (
        (Outcome.START_OFF_MAP, "start", start),
        (Outcome.GOAL_OFF_MAP, "goal", goal),
    ):
        if not np.isfinite(pose).all():
            return Reply(outcome, f"{what}: expected finite numbers, got {pose}")
        fault = off_map(floor, pose)
        if fault:
            return Reply(outcome, f"{what}: {fault}")
    try:
        made = navigator.plan(now, in_cells_of(navigator.resolution, floor), start, goal, improved)
    except PlannerError as error:
        return Reply(Outcome.UNDECIDED, str(error))
    call = navigator.calls[-1]
    outcome = OUTCOMES[call.answer]
    if made is None:
        return Reply(outcome, f"{call.answer}; {call.reason}" if call.reason else str(call.answer))
    return Reply(
        outcome,
        f"{made.cost / 1000.0:.1f} s at most {made.epsilon:.2f} times the least",
        made,
        np.vstack([start, made.poses]),
    )


def off_map(floor: CostField, pose: Array) -> str:
    """Return why a pose is not on a costmap, in words; empty where it is."""
    rows, columns = floor.cells.shape
    low = np.array(floor.origin)
    high = low + floor.resolution * np.array([columns, rows])
    if (low <= pose[:2]).all() and (pose[:2] < high).all():
        return ""
    return (
        f"expected it on the map, from ({low[0]:.2f}, {low[1]:.2f}) to ({high[0]:.2f}, {high[1]:.2f}) m, "
        f"got ({pose[0]:.2f}, {pose[1]:.2f})"
    )


def in_cells_of(resolution: float, floor: CostField) -> CostField:
    """Return a costmap in cells of another size [m]: a new cell costs what the dearest old one in it does.

    Raises:
        PlannerError: there would be too many cells.
    """
    if math.isclose(resolution, floor.resolution, rel_tol=SAME):
        return floor
    grid = CostGrid(floor.cells, floor.resolution, floor.origin, INSCRIBED, LETHAL).resampled(resolution)
    return replace(floor, cells=grid.cells, resolution=resolution)
