"""What a search gives back: a plan, or the sentence that says why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents import search_kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class PlanStatus(Enum):
    """How a search ended."""

    FOUND = "a plan reaches the goal"
    THERE = "the goal is reached already"
    EXHAUSTED = "no plan: every pose that the actions reach was tried; give finer actions or clear the way"
    OUT_OF_BUDGET = "no plan within the budget of nodes; raise it or give a larger tolerance"
    OUTSIDE = "no plan: the body stands outside the outline of the floor"


@dataclass(frozen=True)
class Plan:
    """What a search found.

    Attributes:
        status: whether the goal is reached, or why not.
        actions: (n,) indices; without a plan those that lead nearest to the goal.
        poses: (n + 1, 3) expected, from the start on.
        cost: sum of the actions' costs.
        expanded: nodes.
    """

    status: PlanStatus
    actions: Integers
    poses: Array
    cost: float
    expanded: int

    @property
    def reaches(self) -> bool:
        """Tell whether the plan ends at the goal."""
        return self.status in (PlanStatus.FOUND, PlanStatus.THERE)


@dataclass(frozen=True)
class Reached:
    """All nodes of a search.

    Attributes:
        costs: (n,) infinite where a node was not reached.
        poses: (n, 3).
        parents: (n,) nodes they were reached from.
        actions: (n,) by which.
        expanded: nodes.
    """

    costs: Array
    poses: Array
    parents: Integers
    actions: Integers
    expanded: int

    def nearest_first(self) -> Integers:
        """Return the nodes that were reached, the cheapest first."""
        nodes = np.flatnonzero(np.isfinite(self.costs))
        return nodes[np.argsort(self.costs[nodes], kind="stable")]

    def plan(self, node: int, status: PlanStatus = PlanStatus.FOUND) -> Plan:
        """Return the plan that leads to a node."""
        trail = [int(node)]
        while self.parents[trail[-1]] != search_kernel.NONE:
            trail.append(int(self.parents[trail[-1]]))
        trail.reverse()
        return Plan(status, self.actions[trail[1:]], self.poses[trail], float(self.costs[node]), self.expanded)


STATUS = {
    search_kernel.FOUND: PlanStatus.FOUND,
    search_kernel.EXHAUSTED: PlanStatus.EXHAUSTED,
    search_kernel.OUT_OF_BUDGET: PlanStatus.OUT_OF_BUDGET,
}
