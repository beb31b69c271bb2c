"""What every plan on a floor of a size wants done once, ahead of the first: tables, memory, compiled code."""

from __future__ import annotations

import numpy as np

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.grid import CostGrid
from pbrl_planner.lattice.lattice import Lattice
from pbrl_planner.lattice.motions import Direction, Motions
from pbrl_planner.lattice.planner import plan
from pbrl_planner.lattice.problem import LatticeProblem
from pbrl_planner.lattice.reach import reach
from pbrl_planner.lattice.settings import LatticeSettings

PATIENCE = 120.0
"""[s] that it may take where everything is compiled first."""
STEP = 0.3
"""[m] that a robot which is nowhere goes."""
DIRECTIONS: tuple[Direction, Direction] = ("forward", "backward")
"""Of searches and floods."""


def warm_up(motions: Motions, grid: CostGrid, settings: LatticeSettings) -> None:
    """Make a first plan on floors of this size take as long as any other: else it takes about a second longer.

    Args:
        motions: that are planned with; they keep what is made.
        grid: a floor as large; what is on it does not matter.
        settings: that are planned with.

    Raises:
        PlannerError: the floor cannot be planned on.
    """
    empty = CostGrid(np.zeros_like(grid.cells), grid.resolution, grid.origin, grid.blocked, grid.lethal)
    lattice = Lattice(empty, motions)
    for direction in DIRECTIONS:
        lattice.sweeps(direction)
    motions.shelf.have_memory(lattice.cells * lattice.primitives.bins)
    rows, columns = grid.cells.shape
    begin = np.array([*grid.centre_of(columns // 2, rows // 2), 0.0, 0.0])
    try:
        problem = LatticeProblem(lattice, begin, begin + np.array([STEP, 0.0, 0.0, 0.0]))
    except PlannerError:  # no room on so small a floor, where nothing takes long
        return
    plan(problem, settings.model_copy(update={"time_limit": PATIENCE}))
    start, goal = lattice.number_of(problem.start_state), lattice.number_of(problem.goal_state)
    reach(lattice, start, goal, PATIENCE)
