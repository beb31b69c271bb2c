"""Compiled: what bodies cover of the floor while they move, and where that is free, 64 neighbouring cells at once.

A set of cells is cut into pieces: in one row a run of 2^level of them. `levels[level]` are the bits of the floor where
anything stands within the 2^level cells that begin there. Whether a set is free from each of 64 places side by side is
then one OR of shifted words over its pieces, and the answer is kept. What every sweep from or into a bin of heading and
articulation covers, robot and cart standing there, is looked up once for all of them; few cells are left to each.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Int = NDArray[np.int32]
Word = NDArray[np.uint64]
Byte = NDArray[np.uint8]
Stamp = NDArray[np.uint16]
Array = NDArray[np.float64]
ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
NONE = np.uint64(0)


class SweepTables(NamedTuple):
    """What is looked up, and what is known so far.

    Attributes:
        border: rows and columns by which the bits' border is wider than the grid's; -1 where a point moves.
        source, target: (m,) bins of each move.
        ahead: (m, 2) columns and rows that it goes.
        pieces_first: (m + 1,) where each move's pieces begin.
        pieces: (p, 3) row and first cell relative to the source, level.
        stays_first: (bins + 1,) likewise of what all moves from or into a bin cover.
        stays: (s, 3)
        levels: (levels, rows, words) bits of the floor, first cell in the lowest bit.
        free, known: (grid's rows, words, m) answers of moves, and whose they are: the floor's that bears the stamp.
        stays_free, stays_known: (grid's rows, words, bins) those of bins.
        stamp, stays_stamp: of this floor.
    """

    border: int
    source: Int
    target: Int
    ahead: Int
    pieces_first: Int
    pieces: Int
    stays_first: Int
    stays: Int
    levels: Word
    free: Word
    known: Stamp
    stays_free: Word
    stays_known: Stamp
    stamp: int
    stays_stamp: int


@njit(**LEAF)
def is_free(here: int, m: int, stride: int, tables: SweepTables) -> bool:
    """Say whether the sweep of move `m` from a cell is free.

    Args:
        here: cell, on the grid with its border.
        m: move.
        stride: cells of a row of the grid.
        tables: see there.
    """
    row = here // stride
    column = here - row * stride
    word = column >> 6
    if tables.known[row, word, m] != tables.stamp:
        tables.free[row, word, m] = move_word(row, word, m, tables)
        tables.known[row, word, m] = tables.stamp
    return (tables.free[row, word, m] >> np.uint64(column & 63)) & np.uint64(1) != 0


@njit(**LEAF)
def move_word(row: int, word: int, m: int, tables: SweepTables) -> np.uint64:
    """Return the bits of where the sweep of move `m` is free, begun at 64 places side by side."""
    found = stay_word(row, word, tables.source[m], tables)
    if found == NONE:
        return found
    left = (word << 6) + tables.ahead[m, 0]
    low, rest, there = left >> 6, np.uint64(left & 63), row + tables.ahead[m, 1]
    rows, words = tables.stays_known.shape[:2]
    if there < 0 or there >= rows:
        return NONE
    end = NONE
    if 0 <= low < words:
        end |= stay_word(there, low, tables.target[m], tables) >> rest
    if 0 <= low + 1 < words:
        # Shifted in two steps: a shift by 64 is undefined.
        end |= (stay_word(there, low + 1, tables.target[m], tables) << np.uint64(1)) << (np.uint64(63) - rest)
    found &= end
    if found == NONE:
        return found
    pieces = tables.pieces[tables.pieces_first[m] : tables.pieces_first[m + 1]]
    return ~taken_word(row + tables.border, (word << 6) + tables.border, pieces, tables.levels, ~found)


@njit(**LEAF)
def stay_word(row: int, word: int, b: int, tables: SweepTables) -> np.uint64:
    """Return the bits of where robot and cart may stand in bin `b`, at 64 places side by side."""
    if tables.stays_known[row, word, b] != tables.stays_stamp:
        pieces = tables.stays[tables.stays_first[b] : tables.stays_first[b + 1]]
        taken = taken_word(row + tables.border, (word << 6) + tables.border, pieces, tables.levels, NONE)
        tables.stays_free[row, word, b] = ~taken
        tables.stays_known[row, word, b] = tables.stays_stamp
    return tables.stays_free[row, word, b]


@njit(**LEAF)
def taken_word(top: int, left: int, pieces: Int, levels: Word, taken: np.uint64) -> np.uint64:
    """Return the bits of where a set of cells, put at 64 places side by side, would meet something.

    Args:
        top: row of those places in the bits of the floor.
        left: first column of them.
        pieces: (p, 3) row and first cell relative to them, level.
        levels: (levels, rows, words) bits of the floor.
        taken: bits that are set to begin with: of places that nobody asks for.
    """
    for k in range(len(pieces)):
        if taken == ALL:
            break
        at = left + pieces[k, 1]
        low, rest = at >> 6, np.uint64(at & 63)
        level, row = pieces[k, 2], top + pieces[k, 0]
        taken |= levels[level, row, low] >> rest
        taken |= (levels[level, row, low + 1] << np.uint64(1)) << (np.uint64(63) - rest)
    return taken


@njit(**LEAF)
def lay_out(cost: Byte, lethal: int, border: int, levels: Word) -> None:
    """Write the bits of the floor.

    Args:
        cost: (rows, columns) of the grid.
        lethal: cost from which something stands in a cell.
        border: cells around the grid, in which something stands everywhere.
        levels: (levels, rows, words) to be written; all that is beyond the grid counts as taken.
    """
    rows, columns = cost.shape
    levels[0] = ALL
    for row in range(rows):
        for column in range(columns):
            if cost[row, column] < lethal:
                at = column + border
                levels[0, row + border, at >> 6] &= ~(np.uint64(1) << np.uint64(at & 63))
    words = levels.shape[2]
    for level in range(1, len(levels)):
        half = 1 << (level - 1)
        skip, rest = half >> 6, np.uint64(half & 63)
        for row in range(levels.shape[1]):
            for word in range(words):
                low = levels[level - 1, row, word + skip] if word + skip < words else ALL
                high = levels[level - 1, row, word + skip + 1] if word + skip + 1 < words else ALL
                beside = (low >> rest) | ((high << np.uint64(1)) << (np.uint64(63) - rest))
                levels[level, row, word] = levels[level - 1, row, word] | beside


@njit(**LEAF)
def close_near(pieces: Int, border: int, levels: Word, closed: int, cost: Byte) -> None:
    """Write `closed` into the cells (rows, columns) of a grid from which a set of cells, cut up, meets something."""
    rows, columns = cost.shape
    for row in range(rows):
        for word in range((columns + 63) >> 6):
            taken = taken_word(row + border, (word << 6) + border, pieces, levels, NONE)
            for k in range(min(64, columns - (word << 6))):
                if (taken >> np.uint64(k)) & np.uint64(1) != 0:
                    cost[row, (word << 6) + k] = closed


@njit(**LEAF)
def cover_all(rings: Array, resolution: float, margin: float, reach: int, mask: Byte) -> None:
    """Mark the cells that any of several convex outlines (n, k, 2) touches; see `cover`."""
    for k in range(len(rings)):
        cover(rings[k], resolution, margin, reach, mask)


@njit(**LEAF)
def cover(corners: Array, resolution: float, margin: float, reach: int, mask: Byte) -> None:
    """Mark the cells that a convex outline touches, give or take a margin.

    Args:
        corners: (k, 2) in order [m], relative to the centre of the middle cell.
        resolution: of a cell [m].
        margin: by which the outline is grown, along both axes [m].
        reach: cells from the middle of the mask to its border.
        mask: (2 reach + 1, 2 reach + 1) rows are y.
    """
    lowest, highest = math.inf, -math.inf
    for k in range(len(corners)):
        lowest, highest = min(lowest, corners[k, 1]), max(highest, corners[k, 1])
    # Cell j covers ((j - 0.5) resolution, (j + 0.5) resolution).
    begin = max(math.floor((lowest - margin) / resolution + 0.5), -reach)
    end = min(math.floor((highest + margin) / resolution + 0.5), reach)
    for j in range(begin, end + 1):
        bottom, top = (j - 0.5) * resolution - margin, (j + 0.5) * resolution + margin
        left, right = math.inf, -math.inf
        for k in range(len(corners)):
            ax, ay = corners[k, 0], corners[k, 1]
            other = k + 1 if k + 1 < len(corners) else 0
            bx, by = corners[other, 0], corners[other, 1]
            if max(ay, by) < bottom or min(ay, by) > top:
                continue
            for y, x in ((ay, ax), (by, bx)):
                if bottom <= y <= top:
                    left, right = min(left, x), max(right, x)
            if ay != by:
                for y in (bottom, top):
                    if min(ay, by) <= y <= max(ay, by):
                        x = ax + (bx - ax) * (y - ay) / (by - ay)
                        left, right = min(left, x), max(right, x)
        if left > right:
            continue
        first = max(math.floor((left - margin) / resolution + 0.5), -reach)
        last = min(math.floor((right + margin) / resolution + 0.5), reach)
        for i in range(first, last + 1):
            mask[j + reach, i + reach] = 1
