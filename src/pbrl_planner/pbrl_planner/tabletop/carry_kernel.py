"""Compiled: one item is brought to a pose, the others stand still: weighted A* over its pushes.

A tree of whole layouts is deadlocked where every nearest push is blocked; one item at a time finds its way round.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_planner.tabletop.tree_kernel import TWO_PI, PushTables, after, apart, push_fault, wrapped

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CELL, TURNS = 0.012, 24
"""Poses in one cell of the floor [m] and one of so many turns count as one."""
GREED = 2.0
"""Weight of the way that is left over the way made."""


@njit(cache=True, error_model="numpy")
def carry(
    layout: Array, item: int, goal: Array, weight: float, within: float, most: int, tables: PushTables, via: Index
) -> int:
    """Find pushes of one item towards a pose.

    Args:
        layout: (n, 3) of all items.
        item: which is pushed.
        goal: (3,) where it is to be.
        weight: of an angle in the metric (11) [m/rad].
        within: distance at which it is there [m].
        most: poses that are looked at.
        tables: what pushes do.
        via: (most,) out: pushes in order.

    Returns:
        How many pushes lead to the pose nearest to the goal; 0: none leads nearer than where it is.
    """
    pushes = tables.clearance.shape[1]
    columns = int((tables.high[0] - tables.low[0]) / CELL) + 3
    rows = int((tables.high[1] - tables.low[1]) / CELL) + 3
    met = np.zeros((columns, rows, TURNS), dtype=np.uint8)
    poses, parent, by, made = (
        np.empty((most, 3)),
        np.empty(most, dtype=np.int64),
        np.empty(most, dtype=np.int64),
        np.empty(most),
    )
    there, new = layout.copy(), np.empty(3)
    poses[0], parent[0], by[0], made[0] = layout[item], -1, -1, 0.0
    left = math.sqrt(apart(layout[item], goal, weight))
    best, least, count = 0, left, 1
    heap = [(GREED * left, 0)]
    while len(heap) > 0 and least > within and count < most:
        _, here = heapq.heappop(heap)
        there[item] = poses[here]
        for push in range(pushes):
            if count == most:
                break
            after(poses[here], tables.mean[item, push], 1.0, new)
            column = int((new[0] - tables.low[0]) / CELL) + 1
            row = int((new[1] - tables.low[1]) / CELL) + 1
            turn = int((wrapped(new[2]) + math.pi) / TWO_PI * TURNS) % TURNS
            if column < 0 or row < 0 or column >= columns or row >= rows or met[column, row, turn]:
                continue
            if push_fault(there, item, push, tables, new) != 0:
                continue
            met[column, row, turn] = 1
            poses[count], parent[count], by[count] = new, here, push
            made[count] = made[here] + math.sqrt(apart(poses[here], new, weight))
            left = math.sqrt(apart(new, goal, weight))
            if left < least:
                best, least = count, left
            heapq.heappush(heap, (made[count] + GREED * left, count))
            count += 1
    length, at = 0, best
    while parent[at] >= 0:
        length += 1
        at = parent[at]
    at = best
    for k in range(length - 1, -1, -1):
        via[k] = by[at]
        at = parent[at]
    return length
