"""A lower bound of what is left to the goal: the way of the robot's centre on the floor, and its turns anywhere."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import heuristic_kernel as kernel
from pbrl_planner.lattice.lattice import Lattice
from pbrl_planner.lattice.motions import Direction
from pbrl_planner.lattice.search_kernel import LIMIT

ROOM = 1 << 13
"""Entries of the search on the floor to begin with."""
DIRECTED = 0.9
"""Share of the straight way's cost by which the search on the floor is directed: with all of it, moves that lead
straight on would make no difference, and buckets would have to be of no width."""


class LowerBound:
    """Costs that no way to the goal falls short of; h(a) <= cost(a, b) + h(b) for each edge.

    The search on the floor goes no further than it is asked to. What it has not settled has a sum, of its cost and of
    what is left from there at least, no less than `radius`; what is left to that is the bound there, a consistent one.

    Args:
        lattice: floor and motions.
        goal: number of its state.
        direction: "forward": from each state to the goal; "backward": from it to each state.
        towards: number of the state that the search on the floor is directed to; None: it goes all ways alike.

    Attributes:
        toward: (cells,) of the way on the floor (thesis 4.5.4) where that is settled; LIMIT or anything no less than it
            is elsewhere.
        turning: (bins,) of changing heading and articulation; LIMIT where that cannot be.
    """

    def __init__(self, lattice: Lattice, goal: int, direction: Direction, towards: int | None = None) -> None:
        cell, bin_ = divmod(goal, lattice.primitives.bins)
        self.turning = lattice.turning(bin_, direction)
        self.toward: NDArray[np.int32] = np.full(lattice.cells, LIMIT, dtype=np.int32)
        self._cost, self._blocked, self._stride = lattice.floor_cost, lattice.grid.blocked, lattice.stride
        self._moves = lattice.floor_tables(direction)
        base = self._moves.base
        # Of a point that only turns there are none.
        least, most = int(base.min(initial=1 << 20)), int(base.max(initial=1)) * 256
        self._edge = np.zeros(5)
        if towards is not None and len(base):
            focus = towards // lattice.primitives.bins
            self._edge[[kernel.ROW, kernel.COLUMN]] = divmod(focus, lattice.stride)
            self._edge[kernel.UNIT] = DIRECTED * float((base / self._lengths()).min())
            least, most = int((1.0 - DIRECTED) * least), 2 * most
        self._shift = max(least.bit_length() - 1, 0)
        self._head = np.full(1 << ((most >> self._shift) + 2).bit_length(), -1, dtype=np.int32)
        self._pool = np.empty((ROOM, 2), dtype=np.int32)
        first = kernel.left_over(cell, self._stride, self._edge) >> self._shift
        self._numbers = np.array([first, 0, -1, 0], dtype=np.int64)
        if self._cost[cell] < self._blocked:
            self.toward[cell], self._head[first & (len(self._head) - 1)], self._pool[0] = 0, 0, (cell, -1)
            self._numbers[[kernel.WAITING, kernel.USED]] = 1

    def _lengths(self) -> NDArray[np.float64]:
        """Return (m,) how far moves on the floor go [cells]."""
        rows = np.rint(self._moves.cell_step / self._stride)
        return np.asarray(np.hypot(rows, self._moves.cell_step - rows * self._stride))

    @classmethod
    def of(cls, lattice: Lattice, goal: int, direction: Direction) -> Self:
        """Compute it everywhere.

        Raises:
            PlannerError: as `reach`.
        """
        found = cls(lattice, goal, direction)
        found.finish()
        return found

    @property
    def radius(self) -> int:
        """Sums below this are settled; LIMIT: all are."""
        waits = self._numbers[kernel.WAITING] > 0
        return int(self._numbers[kernel.BUCKET] << self._shift) if waits else LIMIT

    @property
    def edge(self) -> NDArray[np.float64]:
        """How far the search on the floor has come, as (5,) for the compiled ones: see `heuristic_kernel.bounded`."""
        found, radius = self._edge.copy(), self.radius
        if radius == LIMIT:
            found[kernel.UNIT] = 0.0
        rows = len(self._cost) // self._stride
        found[kernel.RADIUS] = radius
        found[kernel.LOW] = max(radius - found[kernel.UNIT] * np.hypot(rows, self._stride) - 1.0, 0.0)
        return found

    def finish(self) -> None:
        """Compute the rest.

        Raises:
            PlannerError: as `reach`.
        """
        self._spread(-1, 2 * LIMIT)

    def reach(self, state: int, share: float = 1.0) -> None:
        """Compute it as far as a state, by number, and everywhere up to a share of the sum there.

        Raises:
            PlannerError: costs are too large to be added up.
        """
        cell = state // len(self.turning)
        left = kernel.left_over(cell, self._stride, self._edge)
        if self.toward[cell] + left >= self.radius:
            self._spread(cell, 0)
        self._spread(-1, int(share * min(int(self.toward[cell]) + left, LIMIT)))

    def at(self, state: int) -> int:
        """Return it at a state, by number; LIMIT or more: there is no way."""
        cell, bin_ = divmod(state, len(self.turning))
        return int(kernel.bounded(int(self.toward[cell]), cell, self._stride, self.edge) + self.turning[bin_])

    def _spread(self, until: int, radius: int) -> None:
        moves = self._moves
        while True:
            status = kernel.spread(
                self._cost,
                self._blocked,
                moves.cell_step,
                moves.base,
                moves.cells_first,
                moves.cells,
                LIMIT,
                self._shift,
                until,
                radius,
                self._stride,
                self._edge,
                self.toward,
                self._head,
                self._pool,
                self._numbers,
            )
            if status == kernel.TOO_COSTLY:
                raise PlannerError(
                    f"costs: expected sums below {LIMIT}, got more; lower the primitives' multipliers or the map's "
                    "costs"
                )
            if status != kernel.FULL:
                return
            self._pool = np.concatenate((self._pool, np.empty_like(self._pool)))
