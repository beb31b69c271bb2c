"""Compiled: Dijkstra's search over the cells of the floor, from one cell outwards, to be stopped and gone on with.

Costs fall into buckets no wider than the cheapest move, so that what is in the first bucket cannot be improved any
more (Denardo and Fox 1979), in whatever order it is taken out. An entry is a place in a pool; places that have become
free are used again, so that the pool stays as small as the front of the search.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Int = NDArray[np.int32]
Long = NDArray[np.int64]
Byte = NDArray[np.uint8]

DONE, REACHED, FULL, TOO_COSTLY = range(4)
"""Why a call returned: all that can be reached is settled, what was asked for is, the pool needs room, a cost came to
the limit."""
(BUCKET, WAITING, SPARE, USED) = range(4)
"""Places in `numbers`: the first bucket in which something may wait, entries that wait, the first of the places that
are free again (-1: none), places used so far, cells settled."""


@njit(**LEAF)
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
        shift: a bucket is 2^shift wide, at most the least of `base`.
        until: cell that is to be settled; below zero: none.
        radius: cost up to which all has to be settled.
        out: (cells,) least cost so far, `limit` where none is known. What is below 2^shift times the first bucket is
            settled, the rest no less than that.
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
    while waiting > 0:
        place = bucket & circle
        entry = head[place]
        if entry < 0:
            bucket += 1
            if bucket << shift > radius and (until < 0 or out[until] < bucket << shift):
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
        if now >> shift != bucket:
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
            place = (total >> shift) & circle
            pool[entry, 0], pool[entry, 1] = source, head[place]
            head[place] = entry
            waiting += 1
        if status == TOO_COSTLY:
            break
    numbers[BUCKET], numbers[WAITING], numbers[SPARE], numbers[USED] = bucket, waiting, spare, used
    return status
