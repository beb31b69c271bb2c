"""Which cells motions sweep, as the compiled search looks them up, and the floor's bits that they are held against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Int = NDArray[np.int32]
Word = NDArray[np.uint64]
Mask = NDArray[np.bool_]
WORD = 64


@dataclass(frozen=True)
class Floor:
    """Where something stands, the map's outside included, with a border that no sweep leaves.

    Attributes:
        taken: (rows, columns) with the border.
        border: cells of it, to each side of the search's grid.
        levels: (levels, rows, words) bits; see `is_free`.
    """

    taken: Mask
    border: int
    levels: Word

    @classmethod
    def of(cls, taken: Mask, border: int) -> Floor:
        """Put a border around the search's grid (rows, columns), and lay out its bits.

        Args:
            taken: where something stands; all that is outside of the map has to be so already.
            border: cells that a sweep reaches from where it begins.
        """
        rows, columns = taken.shape
        words = -(-columns // WORD)
        wide = words * WORD + 2 * border + 2 * WORD
        held = np.ones((rows + 2 * border, -(-wide // WORD) * WORD), dtype=bool)
        held[border : border + rows, border : border + columns] = taken
        levels = [held]
        while (1 << len(levels)) <= 2 * border + 1:
            half = 1 << (len(levels) - 1)
            level = np.ones_like(held)
            level[:, :-half] = levels[-1][:, :-half] | levels[-1][:, half:]
            levels.append(level)
        packed = [np.packbits(level, axis=1, bitorder="little").view(np.uint64) for level in levels]
        return cls(held, border, np.ascontiguousarray(np.stack(packed)))


@dataclass(frozen=True)
class Sweeps:
    """What `improve` needs to know whether a move's sweep is free; see there.

    Attributes:
        shape: (2,) rows and columns of the floor's border; (0,) where a point moves.
        pieces_first: (m + 1,).
        pieces: (p, 3) row, column, level.
        levels: of the floor.
        free: (rows, words, m) answers so far.
        known: (rows, words, m) which are there.
    """

    shape: Int
    pieces_first: Int
    pieces: Int
    levels: Word
    free: Word
    known: NDArray[np.uint8]

    @classmethod
    def none(cls) -> Sweeps:
        """Return those of a point."""
        empty = np.zeros((1, 1, 1), dtype=np.uint64)
        ints = np.zeros(0, dtype=np.int32)
        return cls(ints, np.zeros(1, dtype=np.int32), ints.reshape(0, 3), empty, empty, empty.astype(np.uint8))

    @classmethod
    def of(cls, cut: list[Int], floor: Floor, rows: int, columns: int) -> Sweeps:
        """Lay out sweeps, cut into pieces and in the order of the moves, on a search's grid."""
        first = np.concatenate(([0], np.cumsum([len(each) for each in cut]))).astype(np.int32)
        answers = (rows, -(-columns // WORD), len(cut))
        return cls(
            np.full(2, floor.border, dtype=np.int32),
            first,
            np.ascontiguousarray(np.concatenate(cut), dtype=np.int32),
            floor.levels,
            np.zeros(answers, dtype=np.uint64),
            np.zeros(answers, dtype=np.uint8),
        )


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
