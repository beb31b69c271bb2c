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


class LowerBound:
    """Costs that no way to the goal falls short of; h(a) <= cost(a, b) + h(b) for each edge.

    The search on the floor goes no further than it is asked to. Beyond, `radius` is the bound: the lesser of a bound
    that is consistent and of one number is consistent, too.

    Args:
        lattice: floor and motions.
        goal: number of its state.
        direction: "forward": from each state to the goal; "backward": from it to each state.

    Attributes:
        toward: (cells,) of the way on the floor (thesis 4.5.4), what is below `radius`; LIMIT or anything no less than
            that elsewhere.
        turning: (bins,) of changing heading and articulation; LIMIT where that cannot be.
    """

    def __init__(self, lattice: Lattice, goal: int, direction: Direction) -> None:
        cell, bin_ = divmod(goal, lattice.primitives.bins)
        self.turning = lattice.turning(bin_, direction)
        self.toward: NDArray[np.int32] = np.full(lattice.cells, LIMIT, dtype=np.int32)
        self._cost, self._blocked = lattice.floor_cost, lattice.grid.blocked
        self._moves = lattice.floor_tables(direction)
        base = self._moves.base
        # Of a point that only turns there are none.
        self._shift = int(base.min(initial=1 << 20)).bit_length() - 1
        widest = (int(base.max(initial=1)) * 256 >> self._shift) + 2
        self._head = np.full(1 << widest.bit_length(), -1, dtype=np.int32)
        self._pool = np.empty((ROOM, 2), dtype=np.int32)
        self._numbers = np.array([0, 0, -1, 0], dtype=np.int64)
        if self._cost[cell] < self._blocked:
            self.toward[cell], self._head[0], self._pool[0] = 0, 0, (cell, -1)
            self._numbers[[kernel.WAITING, kernel.USED]] = 1

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
        """Costs on the floor below this are there; LIMIT: all are."""
        waits = self._numbers[kernel.WAITING] > 0
        return int(self._numbers[kernel.BUCKET] << self._shift) if waits else LIMIT

    def finish(self) -> None:
        """Compute the rest.

        Raises:
            PlannerError: as `reach`.
        """
        self._spread(-1, 2 * LIMIT)

    def reach(self, state: int, share: float = 1.0) -> None:
        """Compute it as far as a state, by number, and everywhere up to a share of the cost on the floor there.

        Raises:
            PlannerError: costs are too large to be added up.
        """
        cell = state // len(self.turning)
        if self.toward[cell] >= self.radius:
            self._spread(cell, 0)
        self._spread(-1, int(share * min(int(self.toward[cell]), LIMIT)))

    def at(self, state: int) -> int:
        """Return it at a state, by number; LIMIT or more: there is no way."""
        cell, bin_ = divmod(state, len(self.turning))
        return min(int(self.toward[cell]), self.radius) + int(self.turning[bin_])

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
