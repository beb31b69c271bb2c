"""Compiled: Dijkstra's search over the cells of the floor with a bucket for each cost (Dial), from one cell to all."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int = NDArray[np.int32]
Byte = NDArray[np.uint8]


@njit(cache=True)
def cell_costs(
    cost: Byte, blocked: int, goal: int, step: Int, base: Int, cells_first: Int, cells: Int, limit: int, out: Int
) -> int:
    """Write the least cost of getting from each cell to the goal's; `limit` where there is no way.

    Args:
        cost: (cells,) of the grid with its border.
        blocked: cost from which a cell is not to be entered.
        goal: its cell.
        step: (m,) difference of cell of each move.
        base: (m,) its cost on floor of cost 0.
        cells_first: (m + 1,) where each move's cells begin.
        cells: that it crosses, without source and end, relative to its source.
        limit: as good as infinite; costs have to stay below.
        out: (cells,) to be written.

    Returns:
        Cells that can reach the goal, itself included; -1: a cost came to the limit, so that nothing is known.
    """
    out[:] = limit
    if cost[goal] >= blocked:
        return 0
    count, dearest_base = len(step), 0
    for m in range(count):
        dearest_base = max(dearest_base, base[m])
    buckets = dearest_base * blocked + 1
    head = np.full(buckets, -1, np.int32)
    after, before = np.empty(len(cost), np.int32), np.empty(len(cost), np.int32)
    out[goal] = 0
    head[0], after[goal], before[goal] = goal, -1, -1
    waiting, reached, now, place = 1, 0, 0, 0
    while waiting > 0:
        while head[place] < 0:
            now += 1
            place = place + 1 if place + 1 < buckets else 0
        here = head[place]
        head[place] = after[here]
        if after[here] >= 0:
            before[after[here]] = -1
        waiting -= 1
        reached += 1
        end_cost = np.int64(cost[here])
        for m in range(count):
            source = here - step[m]
            dearest = max(end_cost, np.int64(cost[source]))
            if dearest >= blocked:
                continue
            known = out[source]
            if known < limit and now + base[m] * (1 + dearest) >= known:
                continue
            for k in range(cells_first[m], cells_first[m + 1]):
                dearest = max(dearest, np.int64(cost[source + cells[k]]))
            total = now + base[m] * (1 + dearest)
            if dearest >= blocked:
                continue
            if total >= limit:
                return -1
            if total >= known:
                continue
            if known < limit:
                if before[source] >= 0:
                    after[before[source]] = after[source]
                else:
                    head[known % buckets] = after[source]
                if after[source] >= 0:
                    before[after[source]] = before[source]
            else:
                waiting += 1
            out[source] = total
            bucket = total % buckets
            after[source], before[source] = head[bucket], -1
            if head[bucket] >= 0:
                before[head[bucket]] = source
            head[bucket] = source
    return reached
