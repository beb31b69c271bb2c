"""Ways of a disc with something taken out: what a new place of that thing has to leave open.

A cell is free where the disc, anywhere in it, touches nothing: ways over free cells, and straight lines within them,
are ways of the disc. Passages less than about a cell and a half wider than the disc are not seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_namo.manipulation.pieces import Indices, Pieces
from pbrl_namo.manipulation.plane_kernel import point_distance
from pbrl_namo.manipulation.reference_kernel import UNSEEN, mark, spread, straightened

Counts = NDArray[np.int16]
Flags = NDArray[np.bool_]

SHIFT = (0.381966, 0.236068)
"""By which share of a cell the grid is off round numbers: the ways' corners are in no line with those of furniture."""
SNAP = 6
"""Cells around a point among which the nearest free one is looked for."""


@dataclass(frozen=True)
class ReferenceGrid:
    """How many pieces are too near, for each cell.

    Attributes:
        pieces: of everything.
        origin: (2,) corner of the grid in `world` [m].
        cell: [m]
        radius: of the disc [m].
        counts: (rows, columns); rows go with y.
    """

    pieces: Pieces
    origin: Array
    cell: float
    radius: float
    counts: Counts

    @classmethod
    def of(cls, pieces: Pieces, bounds: Sequence[float], radius: float, cell: float) -> ReferenceGrid:
        """Mark a grid over bounds (least x, least y, greatest x, greatest y) [m]."""
        low, high = np.array(bounds[:2]), np.array(bounds[2:])
        origin = low - cell * np.array(SHIFT)
        columns, rows = (int(n) for n in np.ceil((high - origin) / cell).astype(int) + 1)
        grid = cls(pieces, origin, cell, radius, np.zeros((rows, columns), dtype=np.int16))
        grid._mark(0, len(pieces.owners), grid.counts)
        return grid

    @property
    def reach(self) -> float:
        """Distance from a cell's middle within which nothing may be, for the disc to fit anywhere in the cell [m]."""
        return self.radius + self.cell / math.sqrt(2.0)

    def marks_of(self, taken: Flags) -> Counts:
        """Return the counts (rows, columns) of some pieces, flagged (m,), alone."""
        own = np.zeros_like(self.counts)
        for k in np.flatnonzero(taken):
            self._mark(int(k), int(k) + 1, own)
        return own

    def ways(self, taken: Flags, target: Array, starts: Sequence[Array]) -> list[Array | None]:
        """Return ways (n, 2) of the disc from each start (2,) to the target (2,) [m], some pieces taken out.

        Args:
            taken: (m,) which pieces are taken out.
            target: in `world`.
            starts: in `world`.

        Returns:
            None where there is no way, or none that is wide enough for the grid.
        """
        own = self.marks_of(taken)
        end, ends = self._cell(target, own, taken), [self._cell(start, own, taken) for start in starts]
        wanted = np.array([cell for cell in ends if cell is not None], dtype=np.int64)
        if end is None or not len(wanted):
            return [None] * len(starts)
        parents, queue, corners = (np.empty(self.counts.size, dtype=np.int32) for _ in range(3))
        spread(self.counts, own, end, wanted, parents, queue)
        ways: list[Array | None] = []
        for start, cell in zip(starts, ends, strict=True):
            if cell is None or parents[cell] == UNSEEN:
                ways.append(None)
                continue
            count = straightened(self.counts, own, parents, cell, queue, corners)
            ways.append(np.vstack((start, self._middles(corners[:count].astype(np.int64)), target)))
        return ways

    def field(self, taken: Flags, target: Array) -> WayField | None:
        """Return ways to the target (2,) from everywhere [m], some pieces (m,) taken out; None where it is not free."""
        own = self.marks_of(taken)
        end = self._cell(target, own, taken)
        if end is None:
            return None
        parents, queue = (np.empty(self.counts.size, dtype=np.int32) for _ in range(2))
        spread(self.counts, own, end, np.array([UNSEEN - 1]), parents, queue)  # no cell: it comes everywhere
        return WayField(self, taken, own, parents, np.asarray(target, dtype=float))

    def _mark(self, first: int, last: int, counts: Counts) -> None:
        pieces = self.pieces
        mark(pieces.points, pieces.starts, pieces.boxes, first, last, self.origin, self.cell, self.reach, counts)

    def _middles(self, cells: Indices) -> Array:
        columns = self.counts.shape[1]
        return self.origin + self.cell * (np.column_stack((cells % columns, cells // columns)) + 0.5)

    def _cell(self, point: Array, own: Counts, taken: Flags) -> int | None:
        """Return the nearest free cell that the disc gets to straight from a point (2,), or None."""
        rows, columns = self.counts.shape
        j, i = (int(n) for n in np.floor((point - self.origin) / self.cell))
        near = [(y, x) for y in range(i - SNAP, i + SNAP + 1) for x in range(j - SNAP, j + SNAP + 1)]
        inside = [(y, x) for y, x in near if 0 <= y < rows and 0 <= x < columns and self.counts[y, x] <= own[y, x]]
        for y, x in sorted(inside, key=lambda each: (each[0] - i) ** 2 + (each[1] - j) ** 2):
            cell = y * columns + x
            if (y, x) == (i, j) or self._straight(point, self._middles(np.array([cell]))[0], taken):
                return cell
        return None

    def _straight(self, a: Array, b: Array, taken: Flags) -> bool:
        """Say whether the disc gets from a (2,) to b (2,), looked at every millimetre, some pieces taken out."""
        pieces = self.pieces
        length = float(np.hypot(*(b - a)))
        middle, far = 0.5 * (a + b), 0.5 * length + self.radius
        low, high = pieces.boxes[:, :2] - far, pieces.boxes[:, 2:] + far
        near = ~taken & (middle >= low).all(axis=1) & (middle <= high).all(axis=1)
        for x, y in a + np.linspace(0.0, 1.0, max(math.ceil(length / 1e-3), 1) + 1)[:, None] * (b - a):
            for k in np.flatnonzero(near):
                if point_distance(x, y, pieces.points, pieces.starts[k], pieces.starts[k + 1]) < self.radius:
                    return False
        return True


@dataclass(frozen=True)
class WayField:
    """Ways to one point.

    Attributes:
        grid: it is of.
        taken: (m,) pieces that are taken out.
        own: (rows, columns) their counts.
        parents: (rows * columns,) the next cell on the way from each.
        target: (2,) in `world` [m].
    """

    grid: ReferenceGrid
    taken: Flags
    own: Counts
    parents: NDArray[np.int32]
    target: Array

    def way(self, start: Array) -> Array | None:
        """Return a way (n, 2) from a start (2,) to the target [m]; None where none is wide enough for the grid."""
        cell = self.grid._cell(start, self.own, self.taken)
        if cell is None or self.parents[cell] == UNSEEN:
            return None
        chain, corners = (np.empty(self.grid.counts.size, dtype=np.int32) for _ in range(2))
        count = straightened(self.grid.counts, self.own, self.parents, cell, chain, corners)
        return np.vstack((start, self.grid._middles(corners[:count].astype(np.int64)), self.target))
