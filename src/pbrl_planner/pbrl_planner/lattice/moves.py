"""Primitives as flat tables for the compiled search, and the few of them that a lower bound on the floor needs."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.body import ArticulatedBody
from pbrl_planner.lattice.primitives import PrimitiveSet, centre_cells

Int = NDArray[np.int32]
Cells = frozenset[tuple[int, int]]
NEARLY = 0.03
"""Share of a floor move's cost by which others may be dearer that take its place."""
FEW = 2
"""Cells between a floor move's ends that need not be looked at."""


@dataclass(frozen=True)
class Move:
    """One edge from a bin, either along a primitive or, for a search from the goal, against it.

    Attributes:
        source, target: bins.
        dx, dy: cells from source to target.
        cost: on floor of cost 0.
        centre: cells that the robot's centre crosses, ends left out, relative to the source.
        dear: those whose cost counts: `centre`, and where the cart's middle comes.
        primitive: its number.
    """

    source: int
    target: int
    dx: int
    dy: int
    cost: int
    centre: Cells
    dear: Cells
    primitive: int

    def reverse(self) -> Move:
        """Return the same edge the other way round."""
        moved = [frozenset((x - self.dx, y - self.dy) for x, y in cells) for cells in (self.centre, self.dear)]
        return Move(self.target, self.source, -self.dx, -self.dy, self.cost, moved[0], moved[1], self.primitive)


def moves_of(primitives: PrimitiveSet, costs: NDArray[np.int64], body: ArticulatedBody | None) -> list[Move]:
    """Return an edge for each primitive, in their order."""
    found = []
    for number, each in enumerate(primitives.primitives):
        centre = frozenset(centre_cells(each, primitives.resolution))
        dear = centre | (cart_cells(body, each.poses, primitives.resolution) - {(0, 0), each.end[:2]})
        source, target = primitives.bin_of(*each.start), primitives.bin_of(*each.end[2:])
        found.append(Move(source, target, *each.end[:2], int(costs[number]), centre, dear, number))
    return found


def cart_cells(body: ArticulatedBody | None, poses: Array, resolution: float) -> Cells:
    """Return the cells, relative to the first pose's, that the cart's middle is in at poses (n, 4)."""
    middle = None if body is None else body.cart_middle
    if body is None or middle is None:
        return frozenset()
    places = np.floor(body.in_world(middle[None], poses, "cart")[:, 0] / resolution + 0.5).astype(int)
    return frozenset((int(x), int(y)) for x, y in places)


@dataclass(frozen=True)
class MoveTables:
    """Moves ordered by source, as `improve` takes them; see there.

    Attributes:
        primitive: (m,) number of each move's primitive.
        source: (m,) bins.
        ahead: (m, 2) columns and rows from source to target.
        into: the moves into each bin, by rank.
    """

    first: Int
    step: Int
    cell_step: Int
    base: Int
    cells_first: Int
    cells: Int
    primitive: Int
    rank: NDArray[np.uint8]
    target: Int
    source: Int
    ahead: Int
    into: tuple[Int, ...]

    @classmethod
    def of(cls, moves: list[Move], bins: int, stride: int) -> MoveTables:
        """Lay moves out for a grid whose rows have `stride` cells.

        Raises:
            PlannerError: more than 256 moves end in one bin.
        """
        ordered = sorted(moves, key=lambda move: move.source)
        counts = np.bincount([move.source for move in ordered], minlength=bins)
        cell_step = [move.dy * stride + move.dx for move in ordered]
        step = [d * bins + move.target - move.source for d, move in zip(cell_step, ordered, strict=True)]
        into: list[list[int]] = [[] for _ in range(bins)]
        rank = []
        for m, move in enumerate(ordered):
            rank.append(len(into[move.target]))
            into[move.target].append(m)
        if max(rank) > 255:
            raise PlannerError(
                f"primitives: expected at most 256 into one heading and articulation, got {max(rank) + 1}"
            )
        cells = [sorted(y * stride + x for x, y in move.dear) for move in ordered]
        return cls(
            _ints(np.concatenate(([0], np.cumsum(counts)))),
            _ints(step),
            _ints(cell_step),
            _ints([move.cost for move in ordered]),
            _ints(np.concatenate(([0], np.cumsum([len(each) for each in cells])))),
            _ints([cell for each in cells for cell in each]),
            _ints([move.primitive for move in ordered]),
            np.array(rank, dtype=np.uint8),
            _ints([move.target for move in ordered]),
            _ints([move.source for move in ordered]),
            _ints([(move.dx, move.dy) for move in ordered]),
            tuple(_ints(each) for each in into),
        )


def _ints(values: object) -> Int:
    return np.array(values, dtype=np.int32)


def reach_of(moves: list[Move]) -> int:
    """Return how many cells along an axis any move looks away from its source, or from its target."""
    seen = [(move, x, y) for move in moves for x, y in (*move.dear, (move.dx, move.dy))]
    return max(max(abs(x), abs(y), abs(x - move.dx), abs(y - move.dy)) for move, x, y in seen)


@dataclass(frozen=True)
class Relaxed:
    """Two easier problems, whose costs together never exceed the lattice's: places alone, and bins alone.

    Attributes:
        floor: moves between cells, headings forgotten; most primitives are left out, being no cheaper than a way by
            others through cells that they cross themselves.
        turning: (bins, bins) of changing from each bin to each other anywhere; a large number where that cannot be.
    """

    floor: list[Move]
    turning: NDArray[np.int64]


def relax(moves: list[Move], bins: int, limit: int) -> Relaxed:
    """Split each move's cost into a share for going there and a share for turning.

    h(a) <= cost(a, b) + h(b) then holds of the sum h of both problems' costs to the goal, for each edge: the edge is a
    move in both, at its shares. Going there gets what it would cost without turning, at most all; turning the rest.
    """
    steady = _needed([move for move in moves if move.source == move.target])
    shares = [min(move.cost, _cost_of_others(move, steady)) if _goes(move) else 0 for move in moves]
    turning = np.full((bins, bins), limit, dtype=np.int64)
    np.fill_diagonal(turning, 0)
    for move, share in zip(moves, shares, strict=True):
        turning[move.source, move.target] = min(turning[move.source, move.target], move.cost - share)
    for middle in range(bins):
        np.minimum(turning, turning[:, middle, None] + turning[None, middle], out=turning)
    going = [replace(move, cost=share) for move, share in zip(moves, shares, strict=True)]
    return Relaxed(_fewer(_needed(going)), turning)


def _goes(move: Move) -> bool:
    return (move.dx, move.dy) != (0, 0)


def _needed(moves: list[Move]) -> list[Move]:
    """Return those moves between cells that no others can take the place of, as moves of one bin."""
    cheapest: dict[tuple[int, int, Cells], Move] = {}
    for move in moves:
        key = (move.dx, move.dy, move.centre)
        if _goes(move) and (key not in cheapest or move.cost < cheapest[key].cost):
            cheapest[key] = replace(move, source=0, target=0, dear=move.centre)
    kept: list[Move] = []
    for move in sorted(cheapest.values(), key=lambda m: (m.cost, len(m.centre), m.dx, m.dy, sorted(m.centre))):
        if _cost_of_others(move, kept) > move.cost:
            kept.append(move)
    return kept


def _fewer(moves: list[Move]) -> list[Move]:
    """Leave out moves that others nearly make up for, and lower all others' costs by what is missing.

    A long move is often a little cheaper than its way by short ones, whose times are rounded up, and misses a cell that
    they cross. A bound that is a hundredth lower is worth half as many moves.
    """
    kept, share = [replace(move, centre=frozenset()) if len(move.centre) <= FEW else move for move in moves], 1.0
    for move in sorted(kept, key=lambda m: -len(m.centre)):
        others = [other for other in kept if other is not move]
        most = int(move.cost * (1.0 + NEARLY))
        cost = _cost_of_others(replace(move, cost=most), others)
        if cost <= most:
            kept, share = others, min(share, move.cost / cost)
    lowered = [replace(move, cost=int(move.cost * share)) for move in kept]
    made_up = all(_cost_of_others(move, lowered) <= move.cost for move in moves)
    return lowered if made_up and min((move.cost for move in lowered), default=1) > 0 else moves


def _cost_of_others(move: Move, others: list[Move]) -> int:
    """Return the least cost of a move's way by others through its own cells; one more than its own where it is less."""
    allowed = {*move.centre, (0, 0), (move.dx, move.dy)}
    queue, best = [(0, (0, 0))], {(0, 0): 0}
    while queue:
        cost, (x, y) = heapq.heappop(queue)
        if (x, y) == (move.dx, move.dy):
            return cost
        if cost > best[(x, y)]:
            continue
        for other in others:
            end, total = (x + other.dx, y + other.dy), cost + other.cost
            if total > move.cost or end not in allowed or total >= best.get(end, move.cost + 1):
                continue
            if all((x + cx, y + cy) in allowed for cx, cy in other.centre):
                best[end] = total
                heapq.heappush(queue, (total, end))
    return move.cost + 1
