"""Compiled: what bodies cover of the floor while they move, and where that is free, 64 neighbouring cells at once.

A sweep is a set of cells, cut into pieces: in one row a run of 2^level of them. `levels[level]` are the bits of the
floor where anything stands within the 2^level cells that begin there. Whether a sweep is free from each of 64 places
side by side is then one OR of shifted words over its pieces, and the answer is kept.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int = NDArray[np.int32]
Word = NDArray[np.uint64]
Byte = NDArray[np.uint8]
Array = NDArray[np.float64]
ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


@njit(cache=True)
def is_free(
    here: int,
    m: int,
    stride: int,
    shape: Int,
    pieces_first: Int,
    pieces: Int,
    levels: Word,
    free: Word,
    known: Byte,
) -> bool:
    """Say whether the sweep of move `m` from a cell is free.

    Args:
        here: cell, on the grid with its border.
        m: move.
        stride: cells of a row of the grid.
        shape: (2,) rows and columns by which the bits' border is wider than the grid's.
        pieces_first: (m + 1,) where each move's pieces begin.
        pieces: (p, 3) row and first cell relative to the source, level.
        levels: (levels, rows, words) bits of the floor, first cell in the lowest bit.
        free: (grid's rows, words, m) answers.
        known: (grid's rows, words, m) whether an answer is there.
    """
    row = here // stride
    column = here - row * stride
    word, bit = column >> 6, np.uint64(column & 63)
    if not known[row, word, m]:
        top, left = row + shape[0], (word << 6) + shape[1]
        free[row, word, m] = ~taken_word(top, left, pieces[pieces_first[m] : pieces_first[m + 1]], levels)
        known[row, word, m] = 1
    return (free[row, word, m] >> bit) & np.uint64(1) != 0


@njit(cache=True)
def taken_word(top: int, left: int, pieces: Int, levels: Word) -> np.uint64:
    """Return the bits of where a sweep, begun at 64 places side by side, would meet something.

    Args:
        top: row of those places in the bits of the floor.
        left: first column of them.
        pieces: (p, 3) row and first cell relative to them, level.
        levels: (levels, rows, words) bits of the floor.
    """
    taken = np.uint64(0)
    for k in range(len(pieces)):
        at = left + pieces[k, 1]
        low, rest = at >> 6, np.uint64(at & 63)
        level, row = pieces[k, 2], top + pieces[k, 0]
        taken |= levels[level, row, low] >> rest
        # Shifted in two steps: a shift by 64 is undefined.
        taken |= (levels[level, row, low + 1] << np.uint64(1)) << (np.uint64(63) - rest)
        if taken == ALL:
            break
    return taken


@njit(cache=True)
def cover_all(rings: Array, resolution: float, margin: float, reach: int, mask: Byte) -> None:
    """Mark the cells that any of several convex outlines (n, k, 2) touches; see `cover`."""
    for k in range(len(rings)):
        cover(rings[k], resolution, margin, reach, mask)


@njit(cache=True)
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
