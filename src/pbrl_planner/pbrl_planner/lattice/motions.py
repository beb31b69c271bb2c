"""Primitives, what they cost and what they sweep: everything about a robot that does not depend on a floor."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.along import Along
from pbrl_planner.lattice.body import ArticulatedBody
from pbrl_planner.lattice.moves import Move, MoveTables, Relaxed, moves_of, reach_of, relax
from pbrl_planner.lattice.primitives import TURN, Pace, PrimitiveSet
from pbrl_planner.lattice.search_kernel import LIMIT
from pbrl_planner.lattice.shelf import Shelf
from pbrl_planner.lattice.sweep_kernel import SweepTables
from pbrl_planner.lattice.sweeps import WORD, Cut, Floor, Shapes, cut_up, joined

DEAREST_MOVE = 1 << 18
"""Cost of a primitive on floor of cost 0 at most, four minutes: the lower bound keeps a bucket for each edge's cost."""
MOST_TABLES = 16
"""Laid out for grids of several sizes that are kept."""
Direction = Literal["forward", "backward"]
Cells = NDArray[np.int64]


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
        self._tables: dict[tuple[str, str, int], MoveTables] = {}
        self.shelf = Shelf()
        self._pieces: dict[str, tuple[NDArray[np.int32], NDArray[np.int32]]] = {}
        self._outlines: dict[tuple[int, int], dict[str, Cells]] = {}

    @cached_property
    def relaxed(self) -> Relaxed:
        """What the lower bound is made of."""
        return relax(self.moves, self.primitives.bins, LIMIT)

    @cached_property
    def along(self) -> Along:
        """What lies along primitives that follow one another."""
        return Along.of(self.primitives, self.moves)

    @cached_property
    def masks(self) -> list[NDArray[np.bool_]]:
        """Cells that each primitive sweeps; none for a point."""
        if self.body is None:
            return []
        return [self.body.mask(each.poses, self.primitives.resolution) for each in self.primitives.primitives]

    @cached_property
    def reach(self) -> int:
        """Cells along an axis that any move looks away from where it begins or ends."""
        return reach_of(self.moves)

    @cached_property
    def sweep_reach(self) -> int:
        """Cells along an axis that robot or cart cover at most, seen from where a move begins or ends."""
        # Twice: searched from the goal, a sweep is seen from where it ends.
        return 2 * max((len(mask) // 2 for mask in self.masks), default=0)

    @cached_property
    def shapes(self) -> Shapes:
        """What the moves cover, cut up; not asked for a point."""
        return Shapes.of(self.moves, self.masks, self.primitives.bins)

    def cut(self, direction: Direction) -> Cut:
        """Return each primitive's sweep, cut up, as seen from where a search comes to it: its start or its end."""
        return self.shapes.forward if direction == "forward" else self.shapes.backward

    def sweeps(self, direction: Direction, moves: MoveTables, floor: Floor, shape: tuple[int, int]) -> SweepTables:
        """Lay out sweeps for a search on a grid of so many rows and columns, nothing known.

        Args:
            direction: of the search.
            moves: of it.
            floor: its bits.
            shape: rows and columns of the grid.
        """
        if not self._pieces:
            self._pieces["stays"] = joined(self.shapes.stays)
        if direction not in self._pieces:
            cut = self.cut(direction)
            self._pieces[direction] = joined([cut[number] for number in moves.primitive])
        rows, words = shape[0], -(-shape[1] // WORD)
        of_moves, of_bins = (rows, words, len(moves.step)), (rows, words, self.primitives.bins)
        answers = self.shelf.answers(f"moves {direction}", math.prod(of_moves))
        standing = self.shelf.answers(f"bins {direction}", math.prod(of_bins))
        return SweepTables(
            floor.border,
            moves.source,
            moves.target,
            moves.ahead,
            *self._pieces[direction],
            *self._pieces["stays"],
            floor.levels,
            *answers.shaped(of_moves),
            *standing.shaped(of_bins),
            answers.stamp,
            standing.stamp,
        )

    @cached_property
    def disc(self) -> NDArray[np.int32]:
        """Cells, cut up, in none of which anything stands where the robot's centre is, however it turns."""
        if self.body is None:
            return np.zeros((0, 3), dtype=np.int32)
        # The centre crosses a cell anywhere, not only in its middle.
        near = self.body.inner_radius - math.sqrt(0.5) * self.primitives.resolution
        reach = max(math.ceil(near / self.primitives.resolution), 0)
        x, y = np.meshgrid(*[np.arange(-reach, reach + 1)] * 2)
        return cut_up(np.hypot(x, y) * self.primitives.resolution < near)

    def tables(self, direction: Direction, stride: int) -> MoveTables:
        """Return the moves of a search from the start or from the goal, on a grid whose rows have `stride` cells."""
        return self._laid_out("all", self.moves, self.primitives.bins, direction, stride)

    def floor_tables(self, direction: Direction, stride: int) -> MoveTables:
        """Return those of the lower bound on the floor: to the goal, or to the start from everywhere."""
        return self._laid_out("floor", self.relaxed.floor, 1, direction, stride)

    def _laid_out(self, kind: str, moves: list[Move], bins: int, direction: Direction, stride: int) -> MoveTables:
        key = (kind, direction, stride)
        if key not in self._tables:
            if len(self._tables) >= MOST_TABLES:
                self._tables.clear()
            chosen = moves if direction == "forward" else [move.reverse() for move in moves]
            self._tables[key] = MoveTables.of(chosen, bins, stride)
        return self._tables[key]

    def outlines(self, heading: int, articulation: int) -> dict[str, Cells]:
        """Return the rows and columns (2, n) that each part covers in a bin, relative to the robot's cell."""
        if self.body is None:
            return {}
        key = (heading, articulation)
        if key not in self._outlines:
            turned = math.remainder(heading * TURN / self.primitives.headings, TURN)
            pose = np.array([[0.0, 0.0, turned, self.primitives.articulations[articulation]]])
            masks = {
                part: self.body.mask(pose, self.primitives.resolution, (part,)) for part in self.body.outlines(pose)
            }
            self._outlines[key] = {part: np.array(np.nonzero(mask)) - len(mask) // 2 for part, mask in masks.items()}
        return self._outlines[key]
