"""Compiled: search over the cells of the floor, from one cell outwards, to be stopped and gone on with.

It is Dijkstra's, or A*'s towards a cell that is asked for: then cells come in the order of their cost plus a bound of
what is left to there (`left_over`), and fewer that are out of the way are settled before it. Costs, or those sums, fall
into buckets no wider than the least by which a move makes them greater, so that what is in the first bucket cannot be
improved any more (Denardo and Fox 1979), in whatever order it is taken out. An entry is a place in a pool; places that
have become free are used again, so that the pool stays as small as the front of the search.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int = NDArray[np.int32]
Long = NDArray[np.int64]
Byte = NDArray[np.uint8]
Array = NDArray[np.float64]
Whole = int | np.int64

DONE, REACHED, FULL, TOO_COSTLY = range(4)
"""Why a call returned: all that can be reached is settled, what was asked for is, the pool needs room, a cost came to
the limit."""
(BUCKET, WAITING, SPARE, USED) = range(4)
"""Places in `numbers`: the first bucket in which something may wait, entries that wait, the first of the places that
are free again (-1: none), places used so far, cells settled."""
RADIUS, LOW, ROW, COLUMN, UNIT = range(5)
"""Places in `edge`, which tells how far the search has come: what is not settled has at least RADIUS as its sum; what
is less than LOW is settled; the cell that the search is directed to, and the bound of what is left to there for each
cell of distance from it, 0 for Dijkstra's search."""


@njit(cache=True)
def left_over(cell: Whole, stride: int, edge: Array) -> int:
    """Return a lower bound of the cost between a cell and the one that the search is directed to."""
    if edge[UNIT] == 0.0:
        return 0
    row = cell // stride
    y, x = row - edge[ROW], cell - row * stride - edge[COLUMN]
    return int(edge[UNIT] * math.sqrt(x * x + y * y))


@njit(cache=True)
def bounded(known: Whole, cell: Whole, stride: int, edge: Array) -> Whole:
    """Return a lower bound of a cell's cost: the cost itself where it is settled, given what is `known` of it.

    On the edge it is consistent: what is not settled has a sum of at least the radius.
    """
    if known < edge[LOW]:
        return known
    return min(known, max(int(edge[RADIUS]) - left_over(cell, stride, edge), 0))


@njit(cache=True)
def spread(
    cost: Byte,
    blocked: int,
    step: Int,
    base: Int,
    cells_first: Int,
    cells: Int,
    limit: int,
    shift: int,
    until: int,
    radius: int,
    stride: int,
    edge: Array,
    out: Int,
    head: Int,
    pool: Int,
    numbers: Long,
) -> int:
    """Settle cells in the order of their buckets: their least costs to the goal's.

    Args:
        cost: (cells,) of the grid with its border.
        blocked: cost from which a cell is not to be entered.
        step: (m,) difference of cell of each move.
        base: (m,) its cost on floor of cost 0.
        cells_first: (m + 1,) where each move's cells begin.
        cells: that it crosses, without source and end, relative to its source.
        limit: as good as infinite; costs have to stay below.
        shift: a bucket is 2^shift wide, at most the least by which a move makes the sum greater.
        until: cell that is to be settled; below zero: none.
        radius: sum up to which all has to be settled.
        stride: cells of a row of the grid with its border.
        edge: (5,) what the search is directed to; places above.
        out: (cells,) least cost so far, `limit` where none is known. What has a sum below 2^shift times the first
            bucket is settled, the rest has no less than that.
        head: (buckets,) first entry of each, -1 where none is; used in a circle, a power of two that is
            wider than the dearest move.
        pool: (p, 2) each entry's cell, and the next entry of its bucket.
        numbers: (4,) what is carried from call to call; places above.

    Returns:
        DONE, REACHED, FULL or TOO_COSTLY.
    """
    bucket, waiting, spare, used = numbers[BUCKET], numbers[WAITING], numbers[SPARE], numbers[USED]
    count, circle = len(step), len(head) - 1
    most = len(pool) - count
    status = DONE
    left = 0 if until < 0 else left_over(until, stride, edge)
    while waiting > 0:
        place = bucket & circle
        entry = head[place]
        if entry < 0:
            bucket += 1
            if bucket << shift > radius and (until < 0 or out[until] + left < bucket << shift):
                status = REACHED
                break
            continue
        if used >= most:
            status = FULL
            break
        here = pool[entry, 0]
        head[place] = pool[entry, 1]
        pool[entry, 1] = spare
        spare = entry
        waiting -= 1
        now = np.int64(out[here])
        # It was improved, and taken out, since it was put here.
        if (now + left_over(here, stride, edge)) >> shift != bucket:
            continue
        end_cost = np.int64(cost[here])
        for m in range(count):
            source = here - step[m]
            known = np.int64(out[source])
            # Most are settled: what the least cost of this move says needs no look at the floor.
            if now + base[m] * (1 + end_cost) >= known and known < limit:
                continue
            dearest = max(end_cost, np.int64(cost[source]))
            if dearest >= blocked:
                continue
            for k in range(cells_first[m], cells_first[m + 1]):
                dearest = max(dearest, np.int64(cost[source + cells[k]]))
            total = now + base[m] * (1 + dearest)
            if dearest >= blocked or (total >= known and known < limit):
                continue
            if total >= limit:
                status = TOO_COSTLY
                continue
            out[source] = total
            if spare >= 0:
                entry = spare
                spare = pool[entry, 1]
            else:
                entry = used
                used += 1
            place = ((total + left_over(source, stride, edge)) >> shift) & circle
            pool[entry, 0], pool[entry, 1] = source, head[place]
            head[place] = entry
            waiting += 1
        if status == TOO_COSTLY:
            break
    numbers[BUCKET], numbers[WAITING], numbers[SPARE], numbers[USED] = bucket, waiting, spare, used
    return status
