"""Which cells motions sweep, as the compiled search looks them up, and the floor's bits that they are held against."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.lattice.moves import Move
from pbrl_planner.lattice.sweep_kernel import SweepTables, lay_out

Int = NDArray[np.int32]
Word = NDArray[np.uint64]
Mask = NDArray[np.bool_]
Cut = list[Int]
WORD = 64


@dataclass(frozen=True)
class Floor:
    """Where something stands, the map's outside included, with a border that no sweep leaves.

    Attributes:
        border: cells of it, to each side of the search's grid.
        levels: (levels, rows, words) bits; see `is_free`.
    """

    border: int
    levels: Word

    @classmethod
    def of(cls, cost: NDArray[np.uint8], lethal: int, border: int) -> Floor:
        """Put a border around the search's grid (rows, columns), and lay out its bits.

        Args:
            cost: of its cells; all that is outside of the map has to be lethal already.
            lethal: cost from which something stands there.
            border: cells that a sweep reaches from where it begins.
        """
        rows, columns = cost.shape
        words = -(-columns // WORD)
        wide = words * WORD + 2 * border + 2 * WORD
        count = (2 * border + 1).bit_length()
        levels = np.empty((count, rows + 2 * border, -(-wide // WORD)), dtype=np.uint64)
        lay_out(cost, lethal, border, levels)
        return cls(border, levels)


@dataclass(frozen=True)
class Shapes:
    """What moves cover, cut up: what all moves from or into a bin have in common, and what each covers beside that.

    Attributes:
        stays: of each bin, relative to the state's cell.
        forward, backward: of each move, relative to the cell that it begins in, or ends in.
    """

    stays: Cut
    forward: Cut
    backward: Cut

    @classmethod
    def of(cls, moves: Sequence[Move], masks: Sequence[Mask], bins: int) -> Shapes:
        """Split moves' masks, each relative to where its move begins.

        Args:
            moves: as the masks.
            masks: (2 r + 1, 2 r + 1) each.
            bins: of heading and articulation.
        """
        reach = max(len(mask) // 2 + max(abs(move.dx), abs(move.dy)) for mask, move in zip(masks, moves, strict=True))
        common: list[Mask | None] = [None] * bins
        for move, mask in zip(moves, masks, strict=True):
            for bin_, dx, dy in ((move.source, 0, 0), (move.target, move.dx, move.dy)):
                seen = _framed(mask, reach, -dx, -dy)
                before = common[bin_]
                common[bin_] = seen if before is None else before & seen
        stays = [np.zeros((1, 1), dtype=bool) if each is None else each for each in common]
        forward, backward = [], []
        for move, mask in zip(moves, masks, strict=True):
            both = _framed(stays[move.source], reach, 0, 0) | _framed(stays[move.target], reach, move.dx, move.dy)
            left = _framed(mask, reach, 0, 0) & ~both
            forward.append(cut_up(left))
            backward.append(cut_up(left, move.dx, move.dy))
        return cls([cut_up(each) for each in stays], forward, backward)


def _framed(mask: Mask, reach: int, dx: int, dy: int) -> Mask:
    """Return a mask, moved by (dx, dy), in a frame of another reach; what lies beyond that is left out."""
    found = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=bool)
    y, x = np.nonzero(mask)
    y, x = y - len(mask) // 2 + dy + reach, x - len(mask) // 2 + dx + reach
    inside = (y >= 0) & (y <= 2 * reach) & (x >= 0) & (x <= 2 * reach)
    found[y[inside], x[inside]] = True
    return found


def point_sweeps() -> SweepTables:
    """Return the tables of a point, which sweeps nothing."""
    ints, words, stamps = np.zeros(0, np.int32), np.zeros((1, 1, 1), np.uint64), np.zeros((1, 1, 1), np.uint16)
    none = ints.reshape(0, 3)
    return SweepTables(
        -1, ints, ints, ints.reshape(0, 2), ints, none, ints, none, words, words, stamps, words, stamps, 1, 1
    )


def joined(cut: Cut) -> tuple[Int, Int]:
    """Return where each set's pieces begin (n + 1,), and all pieces (p, 3)."""
    first = np.concatenate(([0], np.cumsum([len(each) for each in cut]))).astype(np.int32)
    return first, np.ascontiguousarray(np.concatenate(cut), dtype=np.int32)


def cut_up(mask: Mask, dx: int = 0, dy: int = 0) -> Int:
    """Return a mask's cells as pieces (p, 3): row and first column relative to (dx, dy) from its middle, and level.

    A run of n cells becomes two pieces of 2^level cells that overlap, level the largest that fits.
    """
    reach = len(mask) // 2
    edges = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    rows, begins = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    lengths = ends - begins
    level = np.floor(np.log2(lengths)).astype(int)
    row, left = rows - reach - dy, begins - reach - dx
    one = np.stack((row, left, level), axis=1)
    two = np.stack((row, left + lengths - (1 << level), level), axis=1)
    return np.concatenate((one, two[lengths != 1 << level])).astype(np.int32)


def cut_cells(cells: Collection[tuple[int, int]]) -> Int:
    """Return cells (x, y), relative to one of them, as pieces (p, 3); see `cut_up`."""
    reach = max(max(abs(x), abs(y)) for x, y in cells)
    mask = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=bool)
    for x, y in cells:
        mask[y + reach, x + reach] = True
    return cut_up(mask)
