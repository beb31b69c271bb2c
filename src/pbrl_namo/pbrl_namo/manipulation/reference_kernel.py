"""Compiled: a grid of where a disc can be, the way over it, and the way drawn straight."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_namo.manipulation.plane_kernel import point_distance

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Counts = NDArray[np.int16]
Marks = NDArray[np.int32]

UNSEEN, ROOT = -2, -1


@njit(**LEAF)
def mark(
    points: Array,
    starts: Indices,
    boxes: Array,
    first: int,
    last: int,
    origin: Array,
    cell: float,
    reach: float,
    counts: Counts,
) -> None:
    """Add one to each cell whose middle is nearer than `reach` [m] to a piece, for each of the pieces first..last - 1.

    Args:
        points: (n, 2) corners of the pieces.
        starts: (m + 1,) where each begins.
        boxes: (m, 4) around each.
        first: piece.
        last: piece, that one not.
        origin: (2,) of the grid's corner.
        cell: [m]
        reach: [m]
        counts: (rows, columns), changed; rows go with y.
    """
    rows, columns = counts.shape
    for k in range(first, last):
        left = max(math.floor((boxes[k, 0] - reach - origin[0]) / cell), 0)
        right = min(math.ceil((boxes[k, 2] + reach - origin[0]) / cell), columns)
        low = max(math.floor((boxes[k, 1] - reach - origin[1]) / cell), 0)
        high = min(math.ceil((boxes[k, 3] + reach - origin[1]) / cell), rows)
        for i in range(low, high):
            y = origin[1] + (i + 0.5) * cell
            for j in range(left, right):
                x = origin[0] + (j + 0.5) * cell
                if point_distance(x, y, points, starts[k], starts[k + 1]) < reach:
                    counts[i, j] += 1


@njit(cache=True, error_model="numpy")
def spread(counts: Counts, own: Counts, target: int, wanted: Indices, parents: Marks, queue: Marks) -> None:
    """Find ways from one free cell to others, breadth first over the four neighbours, until all wanted are reached.

    A cell is free where `counts` is no more than `own`: what is taken out marked it and nothing else.

    Args:
        counts: (rows, columns) of pieces that are near.
        own: likewise, of the thing that is taken out.
        target: cell to start from, row * columns + column.
        wanted: (k,) cells.
        parents: (rows * columns,) out: the cell before each, ROOT of the target, UNSEEN where it did not come.
        queue: (rows * columns,) work space.
    """
    rows, columns = counts.shape
    parents[:] = UNSEEN
    parents[target] = ROOT
    queue[0] = target
    head, tail = 0, 1
    left = 0
    for cell in wanted:
        left += cell != target
    while head < tail and left > 0:
        here = queue[head]
        head += 1
        i, j = here // columns, here % columns
        for side in range(4):
            y, x = i + (side == 0) - (side == 1), j + (side == 2) - (side == 3)
            if 0 <= y < rows and 0 <= x < columns:
                there = y * columns + x
                if parents[there] == UNSEEN and counts[y, x] <= own[y, x]:
                    parents[there] = here
                    queue[tail] = there
                    tail += 1
                    for cell in wanted:
                        left -= cell == there


@njit(**LEAF)
def in_sight(counts: Counts, own: Counts, a: int, b: int) -> bool:
    """Say whether all cells that the segment between the middles of two cells touches are free (Amanatides and Woo)."""
    columns = counts.shape[1]
    i, j, end_i, end_j = a // columns, a % columns, b // columns, b % columns
    down, right = end_i - i, end_j - j
    step_i, step_j = (1 if down > 0 else -1), (1 if right > 0 else -1)
    n_i, n_j = abs(down), abs(right)
    done_i, done_j = 0, 0
    while done_i < n_i or done_j < n_j:
        ahead = (2 * done_i + 1) * n_j - (2 * done_j + 1) * n_i  # which border of the cell comes first
        if ahead == 0:  # through a corner: both cells beside it are touched
            if counts[i + step_i, j] > own[i + step_i, j] or counts[i, j + step_j] > own[i, j + step_j]:
                return False
            i, j = i + step_i, j + step_j
            done_i, done_j = done_i + 1, done_j + 1
        elif ahead < 0:
            i, done_i = i + step_i, done_i + 1
        else:
            j, done_j = j + step_j, done_j + 1
        if counts[i, j] > own[i, j]:
            return False
    return True


@njit(**LEAF)
def straightened(counts: Counts, own: Counts, parents: Marks, start: int, chain: Marks, corners: Marks) -> int:
    """Write the cells at the corners of a straightened way from a reached cell to the target; return how many.

    Args:
        counts: as of `spread`.
        own: likewise.
        parents: as it left them.
        start: the cell; reached.
        chain: (rows * columns,) work space.
        corners: (rows * columns,) out.
    """
    count = 0
    here = start
    while here != ROOT:
        chain[count] = here
        count += 1
        here = parents[here]
    corners[0] = start
    kept, at = 1, 0
    while at < count - 1:
        step, best = 1, at + 1
        while best + step < count and in_sight(counts, own, chain[at], chain[best + step]):
            best += step
            step *= 2
        while step > 1:
            step //= 2
            if best + step < count and in_sight(counts, own, chain[at], chain[best + step]):
                best += step
        corners[kept] = chain[best]
        kept += 1
        at = best
    return kept
