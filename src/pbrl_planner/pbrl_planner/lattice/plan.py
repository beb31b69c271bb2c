"""What comes out: the way, what it costs, how good it is known to be, and what finding it took."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array


@dataclass(frozen=True)
class Improvement:
    """One solution on the way.

    Attributes:
        epsilon: its cost is at most this times the cheapest plan's.
        cost: of it.
        expansions: until then.
        seconds: until then.
    """

    epsilon: float
    cost: int
    expansions: int
    seconds: float


@dataclass(frozen=True)
class LatticePlan:
    """The best plan so far, or that there is none.

    Attributes:
        poses: (n, 4) x, y, heading, articulation of the robot in `world` [m, m, rad, rad], heading without jumps;
            (0, 4) where no plan was found.
        primitives: (k,) their numbers, in order.
        waypoints: (k + 1, 4) poses between them.
        cost: the sum of its edges' costs; -1 without a plan.
        epsilon: bound that is proved: cost is at most this times the cheapest plan's; inf without a plan.
        expansions: states expanded.
        touched: states seen.
        seconds: that all took, the lower bound included.
        seconds_to_first: until the first plan; inf without one.
        seconds_to_bound: until the lower bound on the floor was there.
        history: each solution, the first first.
        exhausted: without a plan: everything that can be reached was searched, there is none.
        reason: why there is no plan, in words; empty where there is one.
    """

    poses: Array
    primitives: NDArray[np.int64]
    waypoints: Array
    cost: int
    epsilon: float
    expansions: int
    touched: int
    seconds: float
    seconds_to_first: float
    seconds_to_bound: float
    history: tuple[Improvement, ...]
    exhausted: bool
    reason: str

    @property
    def found(self) -> bool:
        """Whether there is a plan."""
        return len(self.poses) > 0
