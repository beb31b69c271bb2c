"""Floor, primitives and body put together: everything about a place that does not depend on start and goal."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.grid import CostGrid
from pbrl_planner.lattice.motions import Direction, Motions
from pbrl_planner.lattice.moves import MoveTables
from pbrl_planner.lattice.primitives import TURN
from pbrl_planner.lattice.search_kernel import LIMIT
from pbrl_planner.lattice.sweep_kernel import SweepTables, close_near
from pbrl_planner.lattice.sweeps import Floor, point_sweeps

SAME = 1e-6  # of a resolution, relative, by which two count as one
MOST_STATES = 1 << 30
BORDER = 255
"""Cost of the cells around the map."""
State = tuple[int, int, int, int]


class Lattice:
    """States (x, y, heading, articulation) on a floor, and the motions between them.

    Built once for a floor; what is found out about it is kept for later plans.

    Args:
        grid: the floor.
        motions: of the same resolution as the floor.

    Raises:
        PlannerError: the resolutions differ, or there are too many states.
    """

    def __init__(self, grid: CostGrid, motions: Motions) -> None:
        primitives = motions.primitives
        if not math.isclose(grid.resolution, primitives.resolution, rel_tol=SAME):
            raise PlannerError(
                f"map: expected the primitives' resolution {primitives.resolution:g} m, got {grid.resolution:g} m; "
                "give the map's cells that size with resampled()"
            )
        self.grid, self.motions, self.primitives, self.body = grid, motions, primitives, motions.body
        rows, columns = grid.cells.shape
        self.border = motions.reach
        self.stride = columns + 2 * self.border
        self.cells = self.stride * (rows + 2 * self.border)
        if self.cells * primitives.bins > MOST_STATES:
            raise PlannerError(
                f"map: expected at most {MOST_STATES} states, got {self.cells} cells of {primitives.bins} headings and "
                "articulations; take a part of the map or larger cells"
            )
        self.cost = np.full((rows + 2 * self.border, self.stride), BORDER, dtype=np.uint8)
        self.cost[self.border : self.border + rows, self.border : self.border + columns] = grid.cells
        self._sweeps: dict[str, SweepTables] = {}

    def tables(self, direction: Direction) -> MoveTables:
        """Return the moves of a search from the start or from the goal."""
        return self.motions.tables(direction, self.stride)

    def floor_tables(self, direction: Direction) -> MoveTables:
        """Return the moves of the lower bound on the floor: to the goal, or to the start from everywhere."""
        return self.motions.floor_tables(direction, self.stride)

    def sweeps(self, direction: Direction) -> SweepTables:
        """Return what each move sweeps, and what of that is known to be free."""
        if direction not in self._sweeps:
            if self.body is None:
                self._sweeps[direction] = point_sweeps()
            else:
                tables, shape = self.tables(direction), self.cost.shape
                self._sweeps[direction] = self.motions.sweeps(direction, tables, self._floor, shape)
        return self._sweeps[direction]

    @cached_property
    def _floor(self) -> Floor:
        return Floor.of(self.cost, self.grid.lethal, self.motions.sweep_reach)

    def turning(self, goal: int, direction: Direction) -> NDArray[np.int32]:
        """Return the lower bound (bins,) on changing from each bin to the goal's, or from there to each."""
        turning = self.motions.relaxed.turning
        found = turning[:, goal] if direction == "forward" else turning[goal]
        return np.minimum(found, LIMIT).astype(np.int32)

    @cached_property
    def floor_cost(self) -> NDArray[np.uint8]:
        """Costs for the lower bound: closed, too, where something stands nearer than the robot's sides ever are."""
        found = self.cost.copy()
        if len(self.motions.disc):
            close_near(self.motions.disc, self._floor.border, self._floor.levels, BORDER, found)
        return found.ravel()

    def fault(self, state: State) -> str:
        """Return what is wrong with being in a state, in words; empty where nothing is."""
        column, row = state[:2]
        rows, columns = self.grid.cells.shape
        width, height = self.grid.size
        if not (0 <= column < columns and 0 <= row < rows):
            return f"is not on the map of {width:g} x {height:g} m"
        if self.grid.cells[row, column] >= self.grid.blocked:
            return "the robot's centre would be in an obstacle"
        for part, (below, left) in self.motions.outlines(*state[2:]).items():
            y, x = below + row, left + column
            if min(x.min(), y.min()) < 0 or x.max() >= columns or y.max() >= rows:
                return f"the {part} would reach out of the map"
            hit = np.flatnonzero(self.grid.cells[y, x] >= self.grid.lethal)
            if len(hit):
                at = self.grid.centre_of(int(x[hit[0]]), int(y[hit[0]]))
                return f"the {part} would be in an obstacle at ({at[0]:.3f}, {at[1]:.3f}) m"
        return ""

    def cost_along(self, state: State, primitives: NDArray[np.int64]) -> int:
        """Return what primitives cost, one after the other from a state.

        Each costs its base times one more than the largest cost of a cell among its ends and those it crosses.
        """
        cell = self.number_of(state) // self.primitives.bins
        return self.motions.along.cost(self.cost.ravel(), self.stride, cell, primitives)

    def poses_along(self, state: State, primitives: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the poses between primitives (k + 1, 4) and along them (n, 4), headings without jumps."""
        place = self.grid.centre_of(*state[:2])
        return self.motions.along.poses_along(place, self.grid.resolution, state[2:], primitives)

    def pose_of(self, state: State) -> Array:
        """Return the pose (4,) of a state (column, row, heading, articulation) in `world` [m, m, rad, rad]."""
        x, y = self.grid.centre_of(state[0], state[1])
        heading = math.remainder(state[2] * TURN / self.primitives.headings, TURN)
        return np.array([x, y, heading, self.primitives.articulations[state[3]]])

    def number_of(self, state: State) -> int:
        """Return a state's number in the search."""
        cell = (state[1] + self.border) * self.stride + state[0] + self.border
        return cell * self.primitives.bins + self.primitives.bin_of(state[2], state[3])

    def state_of(self, number: int) -> State:
        """Return the state (column, row, heading, articulation) of a number."""
        cell, bin_ = divmod(number, self.primitives.bins)
        row, column = divmod(cell, self.stride)
        heading, articulation = divmod(bin_, len(self.primitives.articulations))
        return column - self.border, row - self.border, heading, articulation
