"""What lies along primitives that follow one another: poses, and cells whose costs count. Looked up, not walked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_planner.lattice.moves import Move
from pbrl_planner.lattice.primitives import TURN, PrimitiveSet

Long = NDArray[np.int64]


@dataclass(frozen=True)
class Along:
    """Tables of all primitives, in their order.

    Attributes:
        steps: (p, 2) cells that each goes along x and y.
        bins: (p, 2) of heading and articulation that each ends in.
        base: (p,) cost on floor of cost 0.
        crossed_first: (p + 1,) where each one's cells begin.
        crossed: (c, 2) its ends and the cells whose cost counts, relative to its first one.
        poses_first: (p + 1,) where each one's poses begin.
        poses: (n, 4) without the first, relative to the first cell's centre.
        headings: (h,) of each bin [rad].
        articulations: (a,) [rad].
    """

    steps: Long
    bins: Long
    base: Long
    crossed_first: Long
    crossed: Long
    poses_first: Long
    poses: Array
    headings: Array
    articulations: Array

    @classmethod
    def of(cls, primitives: PrimitiveSet, moves: Sequence[Move]) -> Self:
        """Make them of primitives and their moves."""
        crossed = [np.array([(0, 0), (move.dx, move.dy), *sorted(move.dear)], dtype=np.int64) for move in moves]
        poses = [each.poses[1:] for each in primitives.primitives]
        ends = np.array([each.end for each in primitives.primitives], dtype=np.int64)
        turns = [math.remainder(k * TURN / primitives.headings, TURN) for k in range(primitives.headings)]
        return cls(
            ends[:, :2],
            ends[:, 2:],
            np.array([move.cost for move in moves], dtype=np.int64),
            _begins(crossed),
            np.concatenate(crossed),
            _begins(poses),
            np.concatenate(poses),
            np.array(turns),
            np.array(primitives.articulations),
        )

    def cost(self, cost: NDArray[np.uint8], stride: int, cell: int, numbers: Long) -> int:
        """Return what primitives (k,) cost, one after the other from a cell of a grid with `stride` cells a row."""
        if not len(numbers):
            return 0
        steps = self.steps[numbers] @ np.array([1, stride])
        cells = cell + np.concatenate(([0], np.cumsum(steps)[:-1]))
        rows, owners, begins = _ranges(self.crossed_first, numbers)
        dearest = np.maximum.reduceat(cost[cells[owners] + self.crossed[rows] @ np.array([1, stride])], begins)
        return int(np.sum(self.base[numbers] * (1 + dearest.astype(np.int64))))

    def poses_along(
        self, place: tuple[float, float], size: float, bins: tuple[int, int], numbers: Long
    ) -> tuple[Array, Array]:
        """Return the poses between primitives (k + 1, 4) and along them (n, 4) in `world`, headings without jumps.

        Args:
            place: middle of the cell that they begin in [m].
            size: of a cell [m].
            bins: of heading and articulation that they begin in.
            numbers: (k,) of the primitives.
        """
        cells = np.vstack([np.zeros((1, 2), dtype=np.int64), np.cumsum(self.steps[numbers], axis=0)])
        states = np.vstack([bins, self.bins[numbers]])
        between = np.column_stack([place + size * cells, self.headings[states[:, 0]], self.articulations[states[:, 1]]])
        rows, owners, begins = _ranges(self.poses_first, numbers)
        way = np.vstack([between[:1], self.poses[rows]])
        way[1:, :2] += between[owners, :2]
        ends = np.append(0, begins + np.diff(self.poses_first)[numbers])
        way[ends] = between  # files round: the ends are exact
        way[:, 2] = np.unwrap(way[:, 2])
        return way[ends], way


def _begins(parts: Sequence[NDArray[np.generic]]) -> Long:
    return np.concatenate(([0], np.cumsum([len(part) for part in parts])))


def _ranges(first: Long, numbers: Long) -> tuple[Long, Long, Long]:
    """Return the rows (n,) of numbers (k,) one after the other, whose each is (n,), and where each number's begin (k,).

    Number i has the rows first[i] to first[i + 1] - 1.
    """
    counts = first[numbers + 1] - first[numbers]
    begins = np.concatenate(([0], np.cumsum(counts)[:-1]))
    owners = np.repeat(np.arange(len(numbers)), counts)
    return first[numbers][owners] + np.arange(int(counts.sum())) - begins[owners], owners, begins
