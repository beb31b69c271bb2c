"""Calls of the lattice planner on what the costmap says now, and an account of each (thesis table 1)."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.ndimage import binary_dilation

from pbrl_control.planar import Array, wrap
from pbrl_planner.costmap import INSCRIBED, LETHAL, CostField
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import CostGrid, Lattice, LatticePlan, LatticeProblem, LatticeSettings, Motions, plan, warm_up
from pbrl_planner.lattice.primitives import TURN

PATIENCE = LatticeSettings(
    epsilon=3.0, last_epsilon=1.0, time_limit=600.0, expansions=5_000_000, direction="forward", thinned=8
)
"""As in thesis 4.5.4: epsilon from 3 to 1, for at most as many expansions as take about ten seconds. Told so, the
same drive is planned alike however busy the machine is. From the start, in blocks of 0.2 m to begin with, the first
plan takes the fewest."""
NEAREST = 4
"""What is near obstacles costs up to five times as much."""
MORE_ROOM = 2
"""Cells by which a robot that stands too near to something is given room."""
NEAR_CELLS, FAR_CELLS = 2, 4
"""Cells around the robot's place in which a state to start from is looked for, and where there is none in them."""
ASKED = 8
"""Free states from which it is looked whether the robot gets there straight."""

Improved = Callable[[LatticePlan], bool | None]
"""Is given each solution as soon as it is there; returns True: it is good enough."""


class Answer(StrEnum):
    """What a call of the planner came to."""

    PLAN = "a plan"
    NO_PATH = "no path: everything that can be reached was searched"
    GOAL_TAKEN = "no path: something stands where the goal is"
    SHUT_IN = "no plan: the robot is off the map or its cart is turned too far"
    UNDECIDED = "no plan within the expansions allowed"


PROVED = (Answer.NO_PATH, Answer.GOAL_TAKEN)
"""Failures that are proofs: at that moment, in what the costmap said, there was no path on the lattice."""


@dataclass(frozen=True)
class PlannerCall:
    """One call.

    Attributes:
        time: simulated [s].
        answer: what it came to.
        reason: in words, where there is no plan.
        epsilon: bound in the end; None without a plan.
        expansions_first: until the first plan that is proved to be as good as the first epsilon asks; 0 without one.
        expansions: in all.
        seconds_first: of this process's own work until then; None without one.
        seconds: likewise until the end.
        cost: of the plan; -1 without one.
    """

    time: float
    answer: Answer
    reason: str
    epsilon: float | None
    expansions_first: int
    expansions: int
    seconds_first: float | None
    seconds: float
    cost: int

    @property
    def found(self) -> bool:
        """Whether there is a plan."""
        return self.answer is Answer.PLAN


class Navigator:
    """Plans on costmaps.

    Args:
        motions: of robot and cart.
        settings: epsilons and patience.

    Attributes:
        calls: account of all calls so far.
    """

    def __init__(self, motions: Motions, settings: LatticeSettings = PATIENCE) -> None:
        self._motions, self._settings = motions, settings
        self.calls: list[PlannerCall] = []

    @property
    def resolution(self) -> float:
        """Of the cells that it plans on [m]."""
        return self._motions.primitives.resolution

    def prepare(self, field: CostField) -> None:
        """Have a plan on a costmap of this size take as long at first as ever after; it takes a second itself.

        Raises:
            PlannerError: the costmap is none that can be planned on.
        """
        warm_up(self._motions, grid_of(field), self._settings)

    def plan(
        self, now: float, field: CostField, start: Array, goal: Array, improved: Improved | None = None
    ) -> LatticePlan | None:
        """Plan from a pose (4,) to a pose (3,) of `base`, cart straight, at the simulated time `now` [s].

        Each solution is given to `improved`, as to `pbrl_planner.lattice.plan`'s.

        Returns:
            None without a plan; why is in the last of `calls`.

        Raises:
            PlannerError: the costmap is none that can be planned on.
        """
        began = time.process_time()
        lattice = Lattice(grid_of(field), self._motions)
        begin = free_start(lattice, start)
        if begin is None:
            lattice = Lattice(with_room(lattice, start), self._motions)
            begin = free_start(lattice, start, FAR_CELLS)
        if begin is None:
            self._note_failure(now, Answer.SHUT_IN, "no state of the lattice near the robot is free", began)
            return None
        try:
            problem = LatticeProblem(lattice, begin, goal)
        except PlannerError as error:
            self._note_failure(now, Answer.GOAL_TAKEN, str(error), began)
            return None
        first: list[float] = []

        def note(each: LatticePlan) -> bool:
            if each.epsilon <= self._settings.epsilon:
                first.append(time.process_time() - began)
            return improved is not None and improved(each) is True

        made = plan(problem, self._settings, note)
        soon = [each.expansions for each in made.history if each.epsilon <= self._settings.epsilon]
        answer = Answer.PLAN if made.found else Answer.NO_PATH if made.exhausted else Answer.UNDECIDED
        self.calls.append(
            PlannerCall(
                now,
                answer,
                made.reason,
                made.epsilon if made.found else None,
                soon[0] if soon else 0,
                made.expansions,
                first[0] if first else None,
                time.process_time() - began,
                made.cost,
            )
        )
        return made if made.found else None

    def _note_failure(self, now: float, answer: Answer, reason: str, began: float) -> None:
        seconds = time.process_time() - began
        self.calls.append(PlannerCall(now, answer, reason, None, 0, 0, None, seconds, -1))


def grid_of(field: CostField) -> CostGrid:
    """Return a costmap's field as the lattice's floor: what is free costs 0 to `NEAREST`, the rest is as it was."""
    costs = np.arange(256)
    costs[:INSCRIBED] = np.ceil(NEAREST * costs[:INSCRIBED] / (INSCRIBED - 1))
    return CostGrid(costs.astype(np.uint8)[field.cells], field.resolution, field.origin, INSCRIBED, LETHAL)


def free_start(lattice: Lattice, pose: Array, near: int = NEAR_CELLS) -> Array | None:
    """Return the pose (4,) of the free state nearest to a pose (4,); None: none of those around it is free.

    Of the nearest ones that is taken to which robot and cart get straight from where they are, if there is one.

    Args:
        lattice: floor and motions.
        pose: of robot and cart.
        near: cells around it that are looked at.
    """
    primitives, size = lattice.primitives, lattice.grid.resolution
    column, row = lattice.grid.cell_of(float(pose[0]), float(pose[1]))
    turns = float(pose[2]) / (TURN / primitives.headings)
    bends = np.argsort(np.abs(np.array(primitives.articulations) - pose[3]), kind="stable")[:2]
    around = range(-near, near + 1)
    states = [
        (column + x, row + y, heading % primitives.headings, int(bend))
        for x, y, heading, bend in itertools.product(around, around, (math.floor(turns), math.ceil(turns)), bends)
    ]

    def away(state: tuple[int, int, int, int]) -> float:
        at = lattice.pose_of(state)
        off = math.hypot(*(at[:2] - pose[:2])) / size
        return off + 10.0 * abs(wrap(float(at[2] - pose[2]))) + 10.0 * abs(float(at[3] - pose[3]))

    free = (lattice.pose_of(state) for state in sorted(dict.fromkeys(states), key=away) if not lattice.fault(state))
    if not gets_straight(lattice, pose, pose):  # where it touches something already, no way is free from there
        return next(free, None)
    nearest = list(itertools.islice(free, ASKED))
    straight = (each for each in nearest if gets_straight(lattice, pose, each))
    return next(straight, nearest[0] if nearest else None)


def gets_straight(lattice: Lattice, pose: Array, end: Array) -> bool:
    """Say whether robot and cart touch nothing on the straight way from a pose (4,) to another."""
    grid, body = lattice.grid, lattice.body
    if body is None:
        return True
    column, row = grid.cell_of(float(pose[0]), float(pose[1]))
    middle = np.array([*grid.centre_of(column, row), 0.0, 0.0])
    there = end.copy()
    there[2] = pose[2] + wrap(float(end[2] - pose[2]))
    mask = body.mask(np.array([pose, there]) - middle, grid.resolution)
    y, x = np.nonzero(mask)
    y, x = y - len(mask) // 2 + row, x - len(mask) // 2 + column
    rows, columns = grid.cells.shape
    if min(x.min(), y.min()) < 0 or x.max() >= columns or y.max() >= rows:
        return False
    return bool((grid.cells[y, x] < grid.lethal).all())


def with_room(lattice: Lattice, pose: Array) -> CostGrid:
    """Return the floor with room where robot and cart are.

    The planner's outlines are larger than robot and cart. What is between the two is no reason not to leave.
    """
    grid, body = lattice.grid, lattice.body
    cells = grid.cells.copy()
    if body is None:
        return grid
    column, row = grid.cell_of(float(pose[0]), float(pose[1]))
    inside = np.array(grid.centre_of(column, row)) - pose[:2]
    mask = body.mask(np.array([[*-inside, pose[2], pose[3]]]), grid.resolution)
    # Once more around: the nearest state is not quite where the robot is.
    y, x = np.nonzero(binary_dilation(mask, iterations=MORE_ROOM))
    y, x = y - len(mask) // 2 + row, x - len(mask) // 2 + column
    on = (x >= 0) & (x < cells.shape[1]) & (y >= 0) & (y < cells.shape[0])
    taken = cells[y[on], x[on]] >= grid.blocked
    cells[y[on][taken], x[on][taken]] = NEAREST
    return CostGrid(cells, grid.resolution, grid.origin, grid.blocked, grid.lethal)
