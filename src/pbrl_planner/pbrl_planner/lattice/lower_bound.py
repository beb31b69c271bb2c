"""A lower bound of what is left to the goal: the way of the robot's centre on the floor, and its turns anywhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.heuristic_kernel import cell_costs
from pbrl_planner.lattice.lattice import Lattice
from pbrl_planner.lattice.search_kernel import LIMIT


@dataclass(frozen=True)
class LowerBound:
    """Costs that no way to the goal falls short of; h(a) <= cost(a, b) + h(b) for each edge.

    Attributes:
        toward: (cells,) of the way on the floor (thesis 4.5.4); LIMIT where there is none.
        turning: (bins,) of changing heading and articulation; LIMIT where that cannot be.
    """

    toward: NDArray[np.int32]
    turning: NDArray[np.int32]

    @classmethod
    def of(cls, lattice: Lattice, goal: int, direction: Literal["forward", "backward"]) -> LowerBound:
        """Compute it for one goal.

        Args:
            lattice: floor and motions.
            goal: number of its state.
            direction: "forward": from each state to the goal; "backward": from it to each state.

        Raises:
            PlannerError: costs are too large to be added up.
        """
        cell, bin_ = divmod(goal, lattice.primitives.bins)
        floor = lattice.floor_tables(direction)
        toward = np.empty(lattice.cells, dtype=np.int32)
        reached = cell_costs(
            lattice.floor_cost,
            lattice.grid.blocked,
            cell,
            floor.cell_step,
            floor.base,
            floor.cells_first,
            floor.cells,
            LIMIT,
            toward,
        )
        if reached < 0:
            raise PlannerError(
                f"costs: expected sums below {LIMIT}, got more; lower the primitives' multipliers or the map's costs"
            )
        return cls(toward, lattice.turning(bin_, direction))

    def at(self, state: int) -> int:
        """Return it at a state, by number; LIMIT or more: there is no way."""
        cell, bin_ = divmod(state, len(self.turning))
        return int(self.toward[cell]) + int(self.turning[bin_])
