"""Compiled: one round of ARA* (Likhachev et al.; thesis 4.5.4) over a lattice in flat arrays, to be gone on with.

States are numbered cell * bins + bin, on a grid with a border of blocked cells, so that a move is one addition and no
move needs a test of the map's edge. A state's record is one number, LIMIT - g in its middle bits and the search's
stamp in its upper ones: what bears another stamp was never seen, so that large arrays are used again without being
cleared. Keys are `denominator * g + numerator * h`, whole numbers, so that the bound of epsilon = numerator /
denominator holds to the last unit of cost.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_planner.lattice.heap_kernel import heap_pop, heap_push, heapify
from pbrl_planner.lattice.sweep_kernel import SweepTables, is_free

Long = NDArray[np.int64]
Int = NDArray[np.int32]
Byte = NDArray[np.uint8]

LIMIT = 1 << 30
"""Costs end here."""
DONE, EXHAUSTED, BUDGET, FULL, TOO_COSTLY = range(5)
"""Why a call returned: the goal is as good as this epsilon asks, nothing is left to expand, the expansions that were
allowed are used up, the heap or the list of inconsistent states needs room, a cost has become too large."""
(HEAP, WAITING, EXPANDED, GOAL, NUMERATOR, DENOMINATOR, SHIFT, ROUND, MOST, TOUCHED, BEARS) = range(11)
"""Places in `numbers`: entries in the heap, inconsistent states, expansions so far, the goal's state, epsilon as a
fraction, bits of a state in an entry, which round this is (1 to 127), what g + h has to stay below, states seen, this
search's stamp."""
STAMP, LAST_STAMP = 47, (1 << 16) - 1
"""The lowest bit of a record's stamp, and the largest stamp."""
COST = (1 << 31) - 1
"""Mask of LIMIT - g, which begins at bit 16."""
WAITS = 1 << 15
"""Set in a state's record while it waits in the list of inconsistent states."""


@njit(**LEAF)
def improve(
    first: Int,
    step: Int,
    cell_step: Int,
    base: Int,
    cells_first: Int,
    cells: Int,
    rank: Byte,
    target: Int,
    cost: Byte,
    blocked: int,
    bins: int,
    toward: Int,
    radius: int,
    turning: Int,
    records: Long,
    heap: Long,
    waiting: Long,
    numbers: Long,
    allowed: int,
    stride: int,
    sweeps: SweepTables,
    thin: int,
    root: int,
    near: int,
    marks: Byte,
) -> int:
    """Expand states in the order of g + epsilon h until the goal is next, nothing is left, or `allowed` are expanded.

    Args:
        first: (bins + 1,) where each bin's moves begin.
        step: (m,) difference of state of each move.
        cell_step: (m,) difference of cell.
        base: (m,) cost of each move on floor of cost 0.
        cells_first: (m + 1,) where each move's cells begin.
        cells: cells that its centre lines cross, without source and end, relative to the source.
        rank: (m,) number of each move among those into its bin.
        cost: (cells,) of the grid with its border.
        blocked: cost from which a cell is not to be entered.
        bins: of heading and articulation together.
        toward: (cells,) lower bound of the cost to the goal's cell; LIMIT: there is no way.
        radius: what is taken for `toward` where that is more.
        turning: (bins,) what is added to it for heading and articulation.
        target: (m,) bin that each move ends in.
        records: (states,) bits 0 to 7: the rank of the move that it was reached by; 8 to 14: the round in which it was
            expanded last; 15: it waits in the list of inconsistent states; 16 to 46: LIMIT - g; from 47: stamp.
        heap: of open states.
        waiting: inconsistent states: improved after they were expanded in this round.
        numbers: (11,) what is carried from call to call; places above.
        allowed: expansions of this call.
        stride: cells of a row of the grid with its border.
        sweeps: see there.
        thin: of the states of a block of 2^thin by 2^thin cells, in each bin, one is expanded; the others wait in the
            list of inconsistent states. 0: all are expanded.
        root: number of the state that the search begins in.
        near: cells from there or from the goal, along either axis, within which all are.
        marks: (blocks, bins) where one was.

    Returns:
        DONE, EXHAUSTED, BUDGET, FULL or TOO_COSTLY.
    """
    size, wait = numbers[HEAP], numbers[WAITING]
    goal, shift, round_ = numbers[GOAL], numbers[SHIFT], numbers[ROUND]
    numerator, denominator = numbers[NUMERATOR], numbers[DENOMINATOR]
    mask, most = (np.int64(1) << shift) - 1, numbers[MOST]
    moves_most = 0
    for b in range(bins):
        moves_most = max(moves_most, first[b + 1] - first[b])
    full, wait_full = len(heap) - moves_most, len(waiting) - moves_most
    shaped = sweeps.border >= 0
    expanded = 0
    status = BUDGET
    stamp = numbers[BEARS]
    best = np.int64(LIMIT)
    if records[goal] >> STAMP == stamp:
        best = LIMIT - ((records[goal] >> 16) & COST)
    goal_row = goal // bins // stride
    goal_column = goal // bins - goal_row * stride
    root_row = root // bins // stride
    root_column = root // bins - root_row * stride
    blocks = (stride >> thin) + 1
    while expanded < allowed:
        if size == 0:
            status = EXHAUSTED if best == LIMIT else DONE
            break
        top = heap[0]
        if best < LIMIT and top >> shift >= denominator * best:
            status = DONE
            break
        if size >= full or wait >= wait_full:
            status = FULL
            break
        size = heap_pop(heap, size)
        state = top & mask
        record = records[state]
        if (record >> 8) & 127 == round_:
            continue
        here = state // bins
        b = state - here * bins
        if thin > 0:
            row = here // stride
            column = here - row * stride
            off = max(abs(row - root_row), abs(column - root_column))
            if min(off, max(abs(row - goal_row), abs(column - goal_column))) > near:
                block = (row >> thin) * blocks + (column >> thin)
                if marks[block, b]:
                    if not record & WAITS:
                        records[state] = record | WAITS
                        waiting[wait] = state
                        wait += 1
                    continue
                marks[block, b] = 1
        records[state] = (record & ~np.int64(0x7F00)) | (round_ << 8)
        expanded += 1
        g = LIMIT - ((record >> 16) & COST)
        source = np.int64(cost[here])
        for m in range(first[b], first[b + 1]):
            end = here + cell_step[m]
            dearest = max(source, np.int64(cost[end]))
            if dearest >= blocked:
                continue
            ahead = min(np.int64(toward[end]), np.int64(radius)) + np.int64(turning[target[m]])
            if ahead >= LIMIT:
                continue
            there = state + step[m]
            old = records[there]
            if old >> STAMP != stamp:
                old = np.int64(0)
            before = LIMIT - ((old >> 16) & COST)
            unit = np.int64(base[m])
            total = g + unit * (1 + dearest)
            if total >= before or total + ahead >= best:
                continue
            for k in range(cells_first[m], cells_first[m + 1]):
                dearest = max(dearest, np.int64(cost[here + cells[k]]))
            if dearest >= blocked:
                continue
            total = g + unit * (1 + dearest)
            if total >= before or total + ahead >= best:
                continue
            if shaped and not is_free(here, m, stride, sweeps):
                continue
            if total + ahead >= most:
                status = TOO_COSTLY
                continue
            if before == LIMIT:
                numbers[TOUCHED] += 1
            records[there] = (stamp << STAMP) | ((LIMIT - total) << 16) | (old & 0xFF00) | np.int64(rank[m])
            if there == goal:
                best = total
            if (old >> 8) & 127 == round_:
                if not old & WAITS:
                    records[there] |= WAITS
                    waiting[wait] = there
                    wait += 1
            else:
                size = heap_push(heap, size, ((denominator * total + numerator * ahead) << shift) | there)
        if status == TOO_COSTLY:
            break
    numbers[HEAP], numbers[WAITING] = size, wait
    numbers[EXPANDED] += expanded
    return status


@njit(**LEAF)
def next_round(
    bins: int,
    toward: Int,
    before: int,
    radius: int,
    turning: Int,
    records: Long,
    heap: Long,
    waiting: Long,
    numbers: Long,
    numerator: int,
) -> int:
    """Make one heap of the open and the inconsistent states, for another epsilon, with `radius` instead of `before`.

    Along a cheapest way the first state of that heap has been reached at its least cost, so that the least g + h in it
    is a lower bound of the cheapest plan's cost: it is returned; LIMIT where nothing is left that could improve.
    `heap` needs room for all of them.
    """
    shift, round_ = numbers[SHIFT], numbers[ROUND]
    denominator = numbers[DENOMINATOR]
    mask = (np.int64(1) << shift) - 1
    old = numbers[NUMERATOR]
    best = np.int64(LIMIT)
    if records[numbers[GOAL]] >> STAMP == numbers[BEARS]:
        best = LIMIT - ((records[numbers[GOAL]] >> 16) & COST)
    least = np.int64(LIMIT)
    count = 0
    for k in range(numbers[HEAP]):
        entry = heap[k]
        state = entry & mask
        record = records[state]
        if (record >> 8) & 127 == round_:
            continue
        g = LIMIT - ((record >> 16) & COST)
        floor, turn = np.int64(toward[state // bins]), np.int64(turning[state % bins])
        if entry >> shift != denominator * g + old * (min(floor, np.int64(before)) + turn):
            continue
        h = min(floor, np.int64(radius)) + turn
        if g + h >= best:
            continue
        heap[count] = ((denominator * g + numerator * h) << shift) | state
        count += 1
        least = min(least, g + h)
    for k in range(numbers[WAITING]):
        state = waiting[k]
        records[state] &= ~np.int64(WAITS)
        g = LIMIT - ((records[state] >> 16) & COST)
        h = min(np.int64(toward[state // bins]), np.int64(radius)) + np.int64(turning[state % bins])
        if g + h >= best:
            continue
        heap[count] = ((denominator * g + numerator * h) << shift) | state
        count += 1
        least = min(least, g + h)
    heapify(heap, count)
    numbers[HEAP], numbers[WAITING], numbers[NUMERATOR] = count, 0, numerator
    numbers[ROUND] = round_ + 1
    return int(least)
