"""Floor, primitives and body put together: everything about a place that does not depend on start and goal."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.body import ArticulatedBody
from pbrl_planner.lattice.grid import CostGrid
from pbrl_planner.lattice.moves import MoveTables, Relaxed, moves_of, reach_of, relax
from pbrl_planner.lattice.primitives import TURN, Pace, PrimitiveSet
from pbrl_planner.lattice.search_kernel import LIMIT
from pbrl_planner.lattice.sweeps import Floor, Sweeps, cut_up

SAME = 1e-6  # of a resolution, relative, by which two count as one
MOST_STATES = 1 << 30
DEAREST_MOVE = 1 << 18
"""Cost of a primitive on floor of cost 0 at most, four minutes: the lower bound keeps a bucket for each edge's cost."""
BORDER = 255
"""Cost of the cells around the map."""
State = tuple[int, int, int, int]


class Motions:
    """Primitives, what they cost and what they sweep: everything that does not depend on a floor.

    What takes long is found out once, when it is asked for first, and holds for every floor.

    Args:
        primitives: the motions.
        pace: speeds, which make the costs.
        body: outlines of robot and cart; None: a point moves, and the floor's costs say where it may be.
        costs: (p,) of the primitives on floor of cost 0, whole numbers above zero; None: their times.

    Raises:
        PlannerError: there are articulations but no cart, or costs are not what they should be.
    """

    def __init__(
        self,
        primitives: PrimitiveSet,
        pace: Pace | None = None,
        body: ArticulatedBody | None = None,
        costs: NDArray[np.int64] | None = None,
    ) -> None:
        if len(primitives.articulations) > 1 and (body is None or body.cart is None):
            raise PlannerError("body: expected one with a cart, since the primitives have articulations, got none")
        self.primitives, self.body, self.pace = primitives, body, pace or Pace()
        self.costs = primitives.base_costs(self.pace) if costs is None else np.asarray(costs)
        shaped = self.costs.shape == (len(primitives.primitives),) and self.costs.dtype.kind == "i"
        if not shaped or self.costs.min(initial=1) < 1 or self.costs.max() > DEAREST_MOVE:
            raise PlannerError(
                f"costs: expected {len(primitives.primitives)} whole numbers from 1 to {DEAREST_MOVE}, got "
                f"{self.costs.dtype} {self.costs.shape} up to {self.costs.max(initial=0)}; lower multipliers"
            )
        self.moves = moves_of(primitives, self.costs, body)
        self._cut: dict[str, list[NDArray[np.int32]]] = {}

    @cached_property
    def relaxed(self) -> Relaxed:
        """What the lower bound is made of."""
        return relax(self.moves, self.primitives.bins, LIMIT)

    @cached_property
    def masks(self) -> list[NDArray[np.bool_]]:
        """Cells that each primitive sweeps; none for a point."""
        if self.body is None:
            return []
        return [self.body.mask(each.poses, self.primitives.resolution) for each in self.primitives.primitives]

    def cut(self, direction: Literal["forward", "backward"]) -> list[NDArray[np.int32]]:
        """Return each primitive's sweep, cut up, as seen from where a search comes to it: its start or its end."""
        if direction not in self._cut:
            ends = [each.end[:2] if direction == "backward" else (0, 0) for each in self.primitives.primitives]
            self._cut[direction] = [cut_up(mask, *end) for mask, end in zip(self.masks, ends, strict=True)]
        return self._cut[direction]


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
        self.border = reach_of(motions.moves)
        self.stride = columns + 2 * self.border
        self.cells = self.stride * (rows + 2 * self.border)
        if self.cells * primitives.bins > MOST_STATES:
            raise PlannerError(
                f"map: expected at most {MOST_STATES} states, got {self.cells} cells of {primitives.bins} headings and "
                "articulations; take a part of the map or larger cells"
            )
        self.cost = np.full((rows + 2 * self.border, self.stride), BORDER, dtype=np.uint8)
        self.cost[self.border : self.border + rows, self.border : self.border + columns] = grid.cells
        self._sweeps: dict[str, Sweeps] = {}

    def tables(self, direction: Literal["forward", "backward"]) -> MoveTables:
        """Return the moves of a search from the start or from the goal."""
        return self._forward if direction == "forward" else self._backward

    @cached_property
    def _forward(self) -> MoveTables:
        return MoveTables.of(self.motions.moves, self.primitives.bins, self.stride)

    @cached_property
    def _backward(self) -> MoveTables:
        return MoveTables.of([move.reverse() for move in self.motions.moves], self.primitives.bins, self.stride)

    def sweeps(self, direction: Literal["forward", "backward"]) -> Sweeps:
        """Return what each move sweeps, and what of that is known to be free."""
        if direction not in self._sweeps:
            self._sweeps[direction] = Sweeps.none() if self.body is None else self._new_sweeps(direction)
        return self._sweeps[direction]

    def _new_sweeps(self, direction: Literal["forward", "backward"]) -> Sweeps:
        cut = self.motions.cut(direction)
        return Sweeps.of([cut[number] for number in self.tables(direction).primitive], self._floor, *self.cost.shape)

    @cached_property
    def _taken(self) -> NDArray[np.bool_]:
        found = np.ones(self.cost.shape, dtype=bool)
        rows, columns = self.grid.cells.shape
        inside = (slice(self.border, self.border + rows), slice(self.border, self.border + columns))
        found[inside] = self.grid.cells >= self.grid.lethal
        return found

    @cached_property
    def _floor(self) -> Floor:
        # Twice: searched from the goal, a sweep is seen from where it ends.
        return Floor.of(self._taken, 2 * max(len(mask) // 2 for mask in self.motions.masks))

    def floor_tables(self, direction: Literal["forward", "backward"]) -> MoveTables:
        """Return the moves of the lower bound on the floor: to the goal, or to the start from everywhere."""
        return self._floor_forward if direction == "forward" else self._floor_backward

    @cached_property
    def _floor_forward(self) -> MoveTables:
        return MoveTables.of(self.motions.relaxed.floor, 1, self.stride)

    @cached_property
    def _floor_backward(self) -> MoveTables:
        return MoveTables.of([move.reverse() for move in self.motions.relaxed.floor], 1, self.stride)

    def turning(self, goal: int, direction: Literal["forward", "backward"]) -> NDArray[np.int32]:
        """Return the lower bound (bins,) on changing from each bin to the goal's, or from there to each."""
        turning = self.motions.relaxed.turning
        found = turning[:, goal] if direction == "forward" else turning[goal]
        return np.minimum(found, LIMIT).astype(np.int32)

    @cached_property
    def floor_cost(self) -> NDArray[np.uint8]:
        """Costs for the lower bound: closed, too, where something stands nearer than the robot's sides ever are."""
        found = self.cost.copy()
        if self.body is not None:
            # The centre crosses a cell anywhere, not only in its middle.
            near = self.body.inner_radius - math.sqrt(0.5) * self.grid.resolution
            found[distance_transform_edt(~self._taken) * self.grid.resolution < near] = BORDER
        return np.ascontiguousarray(found.ravel())

    def fault(self, state: State) -> str:
        """Return what is wrong with being in a state, in words; empty where nothing is."""
        column, row = state[:2]
        rows, columns = self.grid.cells.shape
        width, height = self.grid.size
        if not (0 <= column < columns and 0 <= row < rows):
            return f"is not on the map of {width:g} x {height:g} m"
        if self.grid.cells[row, column] >= self.grid.blocked:
            return "the robot's centre would be in an obstacle"
        if self.body is None:
            return ""
        pose = self.pose_of(state) * [0.0, 0.0, 1.0, 1.0]
        for part in self.body.outlines(pose[None]):
            mask = self.body.mask(pose[None], self.grid.resolution, (part,))
            y, x = np.nonzero(mask) - np.array([[len(mask) // 2 - row], [len(mask) // 2 - column]])
            inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
            if not inside.all():
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
        cell, total = divmod(self.number_of(state), self.primitives.bins)[0], 0
        cost = self.cost.ravel()
        for number in primitives:
            move = self.motions.moves[number]
            crossed = [(0, 0), (move.dx, move.dy), *move.dear]
            total += move.cost * (1 + max(int(cost[cell + y * self.stride + x]) for x, y in crossed))
            cell += move.dy * self.stride + move.dx
        return total

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
