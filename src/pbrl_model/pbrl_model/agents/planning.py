"""A* in model space: which pushes bring a body to its goal (thesis section 5.5.1).

A model is given as a table of motions: for each action the poses that the body passes, in its own axes at the start.
Motions of a body that touches nothing do not depend on where it is, so that a table holds all that a model says of it,
and one batch of the kernel makes it (`motions.py`). Where the planner knows the walls, motions that touch something are
left out; where it does not, the model's word is taken.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_model.agents import search_kernel
from pbrl_model.agents.domain import Goal, Thing
from pbrl_model.agents.obstacles import Obstacles, convex_pieces, padded
from pbrl_model.agents.plans import STATUS, Plan, PlanStatus, Reached
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CELL = 0.05  # [m]
TURNS = 48  # cells of heading
BUDGET = 60_000  # nodes
DIAGONAL = 1.0824  # a way over a grid of eight neighbours is at most this much longer than the straight one


@dataclass(frozen=True)
class Motions:
    """What a model says of each action.

    Attributes:
        table: (C, A, S, 3) poses on the way, the last where the body comes to rest, in its axes at the start; by
            contact condition, of which models that know no contact have one.
        cost: (A,) of each action, above zero.
    """

    table: Array
    cost: Array

    def __post_init__(self) -> None:
        if self.table.ndim != 4 or self.table.shape[3] != 3 or self.cost.shape != self.table.shape[1:2]:
            raise ModelError(
                f"motions: expected (conditions, actions, samples, 3) and a cost for each action, got "
                f"{self.table.shape} and {self.cost.shape}"
            )
        if not (np.isfinite(self.table).all() and np.isfinite(self.cost).all() and (self.cost > 0.0).all()):
            raise ModelError("motions: expected finite motions and finite costs above zero")


@dataclass(frozen=True)
class Sensing:
    """How the planner tells conditions of contact apart (thesis section 5.2.1).

    Attributes:
        rays: (sectors, tests, 4) origin on the outline, unit direction outwards; in the body's frame.
        reach: the collision radius [m].
    """

    rays: Array
    reach: float


@dataclass(frozen=True)
class Space:
    """Where a body may be.

    Attributes:
        lower: (2,) corner of the grid [m].
        upper: (2,) opposite corner [m].
        obstacles: what stands there.
        margin: kept from every obstacle [m].
        knows_walls: False: obstacles do not end a motion; only the table says what contact does.
    """

    lower: Array
    upper: Array
    obstacles: Obstacles
    margin: float = 0.03
    knows_walls: bool = True


@dataclass(frozen=True)
class SearchOptions:
    """Settings of the search.

    Attributes:
        cell: side of a cell [m].
        turns: cells of heading.
        budget: nodes that may be expanded.
        weight: of the heuristic; 1: no dearer than the cheapest over the cells; above: sooner found, dearer at most by
            that factor.
        around: whether the heuristic counts the way round the walls.
    """

    cell: float = CELL
    turns: int = TURNS
    budget: int = BUDGET
    weight: float = 1.0
    around: bool = True


class Planner:
    """Plans for one body among fixed obstacles.

    Args:
        thing: the body.
        space: where it may be.
        options: of the search.
        sensing: contact conditions, for tables that have more than one.
    """

    def __init__(
        self, thing: Thing, space: Space, options: SearchOptions = SearchOptions(), sensing: Sensing | None = None
    ) -> None:
        self._thing, self._space, self._options = thing, space, options
        self._sensing = sensing or Sensing(np.zeros((0, 0, 4)), 0.0)
        self._parts, self._counts = padded(convex_pieces(thing.footprint))
        self._radius = float(np.hypot(*thing.footprint.T).max())
        size = np.ceil((space.upper - space.lower) / options.cell).astype(int)
        self._shape = int(size[0]), int(size[1])
        self._fields: dict[tuple[float, float], Array] = {}

    def plan(self, start: Array, goal: Goal, motions: Motions) -> Plan:
        """Search for the cheapest actions from a pose (3,) to a goal.

        Raises:
            ModelError: the table has conditions, and the planner no rays to tell them apart.
        """
        if goal.reached(start):
            return Plan(PlanStatus.THERE, np.empty(0, dtype=np.int64), start[None].copy(), 0.0, 0)
        target = np.array([*goal.pose, goal.position_tolerance, goal.heading_tolerance])
        status, node, found = self._search(
            start, target, motions, self._field(goal), self._options.weight, self._options.budget
        )
        if node == search_kernel.NONE:
            return Plan(PlanStatus.OUTSIDE, np.empty(0, dtype=np.int64), np.asarray(start)[None].copy(), 0.0, 0)
        return found.plan(node, STATUS[status])

    def flood(self, start: Array, motions: Motions, budget: int) -> Reached:
        """Return what is reached from a pose (3,) by the cheapest actions, as far as a budget of nodes goes."""
        nowhere = np.array([1e6, 1e6, np.nan, 0.0, 0.0])
        return self._search(start, nowhere, motions, np.zeros(self._shape), 0.0, budget)[2]

    def _search(
        self, start: Array, target: Array, motions: Motions, field: Array, weight: float, budget: int
    ) -> tuple[int, int, Reached]:
        """Make the buffers and call the compiled search; return its status, its node, and all nodes."""
        if len(motions.table) not in (1, 2 ** len(self._sensing.rays)):
            raise ModelError(
                f"planner: expected a table for 1 or {2 ** len(self._sensing.rays)} contact conditions, "
                f"got {len(motions.table)}"
            )
        cells = self._shape[0] * self._shape[1] * self._options.turns + 1
        costs, poses = np.full(cells, np.inf), np.empty((cells, 3))
        parents, actions = np.empty(cells, dtype=np.int64), np.empty(cells, dtype=np.int64)
        obstacles = self._space.obstacles
        status, node, expanded = search_kernel.search(
            np.asarray(start, dtype=float),
            target,
            np.ascontiguousarray(motions.table),
            motions.cost,
            self._parts,
            self._counts,
            self._radius,
            obstacles.corners,
            obstacles.counts,
            obstacles.middles,
            obstacles.radii,
            self._margin_at(start),
            self._space.knows_walls,
            self._sensing.rays,
            self._sensing.reach,
            field,
            self._space.lower.astype(float),
            np.array([self._options.cell, 2.0 * np.pi / self._options.turns]),
            *reaches(motions),
            weight,
            budget,
            costs,
            poses,
            parents,
            actions,
        )
        return status, node, Reached(costs, poses, parents, actions, expanded)

    def free(self, pose: Array, margin: float | None = None) -> bool:
        """Tell whether the body may stand at a pose (3,)."""
        obstacles = self._space.obstacles
        return bool(
            search_kernel.stands_free(
                float(pose[0]),
                float(pose[1]),
                float(pose[2]),
                self._parts,
                self._counts,
                self._radius,
                obstacles.corners,
                obstacles.counts,
                obstacles.middles,
                obstacles.radii,
                self._space.margin if margin is None else margin,
                np.empty_like(self._parts),
            )
        )

    def _margin_at(self, start: Array) -> float:
        """Return the margin, or what is left of it where the body stands nearer than that to something already."""
        margin = self._space.margin
        while self._space.knows_walls and not self.free(start, margin) and margin > -0.1:
            margin -= 0.005
        return margin

    def _field(self, goal: Goal) -> Array:
        """Return the way [m] from each cell to the goal for the largest disc inside the body: a lower bound."""
        if not (self._options.around and self._space.knows_walls):
            return np.zeros(self._shape)
        key = float(goal.pose[0]), float(goal.pose[1])
        if key not in self._fields:
            self._fields[key] = ways(self._blocked(), np.array(key), self._space.lower, self._options.cell)
        return self._fields[key]

    def _blocked(self) -> NDArray[np.bool_]:
        """Return (nx, ny) the cells in which the disc about the centre of mass cannot be."""
        outline = shapely.Polygon(self._thing.footprint)
        inside = (
            float(outline.exterior.distance(shapely.Point(0.0, 0.0))) if outline.contains(shapely.Point(0, 0)) else 0.0
        )
        # A cell is blocked only where all of it is: the bound must not be above the truth.
        clearance = max(inside - self._options.cell, 0.0)
        middles = [self._space.lower[k] + self._options.cell * (np.arange(self._shape[k]) + 0.5) for k in range(2)]
        points = shapely.points(*np.meshgrid(*middles, indexing="ij"))
        obstacles = self._space.obstacles
        shapes = [
            shapely.LineString(corners[:n]) if n == 2 else shapely.Polygon(corners[:n])
            for corners, n in zip(obstacles.corners, obstacles.counts, strict=True)
        ]
        if not shapes:
            return np.zeros(self._shape, dtype=bool)
        return np.asarray(shapely.distance(points, shapely.union_all(shapes)) < clearance)


def reaches(motions: Motions) -> tuple[float, float]:
    """Return the most metres and the most radians that a unit of cost can bring."""
    ends = np.abs(motions.table[:, :, -1])
    way = float((np.hypot(ends[..., 0], ends[..., 1]) / motions.cost).max())
    turn = float((ends[..., 2] / motions.cost).max())
    return max(way, 1e-9), max(turn, 1e-9)


def ways(blocked: NDArray[np.bool_], goal: Array, lower: Array, cell: float) -> Array:
    """Return (nx, ny) lower bounds of the way [m] from the middles of cells to a goal (2,); infinite where shut off."""
    out = np.full(blocked.shape, np.inf)
    first = tuple(int(value) for value in np.floor((goal - lower) / cell))
    if not all(0 <= first[k] < blocked.shape[k] for k in range(2)):
        return out
    steps = [(i, j, math.hypot(i, j) * cell / DIAGONAL) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    out[first] = 0.0
    heap = [(0.0, first)]
    while heap:
        way, (i, j) = heapq.heappop(heap)
        if way > out[i, j]:
            continue
        for di, dj, length in steps:
            k, m = i + di, j + dj
            if (
                0 <= k < blocked.shape[0]
                and 0 <= m < blocked.shape[1]
                and not blocked[k, m]
                and way + length < out[k, m]
            ):
                out[k, m] = way + length
                heapq.heappush(heap, (way + length, (k, m)))
    # Blocked cells have no way of their own, but a pose in one may be legal at its rim: as the crow flies.
    return np.where(blocked & np.isinf(out), 0.0, out)
