"""Compiled: where an outline stands free on a grid, and the search over places and headings of a differential base."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
Lengths = NDArray[np.uint16]


@njit(cache=True)
def erode(blocked: Flags, runs: Index, reach: int) -> Flags:
    """Return where (R, C) none of the cells under a mask is blocked; beyond the grid all are.

    Args:
        blocked: (R, C)
        runs: (n, 3) the mask in its rows: row and first cell of a run relative to the middle, and its cells.
        reach: rows and columns from the middle of the mask to its border.
    """
    rows, columns = blocked.shape
    ahead = np.zeros((rows + 2 * reach, columns + 2 * reach), np.uint16)  # free cells from each on, to the right
    for r in range(rows):
        count = 0
        for c in range(columns - 1, -1, -1):
            count = 0 if blocked[r, c] else min(count + 1, 2 * reach + 1)
            ahead[r + reach, c + reach] = count
    clear = np.ones((rows, columns), np.bool_)
    for k in range(len(runs)):
        row, first, cells = reach + runs[k, 0], reach + runs[k, 1], np.uint16(runs[k, 2])
        for r in range(rows):
            # One row at a time, without a branch: the compiler takes many cells at once.
            there, here = ahead[r + row, first : first + columns], clear[r]
            for c in range(columns):
                here[c] &= there[c] >= cells
    return clear


@njit(cache=True)
def reaches(free: Flags, turns: Flags, moves: Index, seeds: Index, ends: Index) -> bool:
    """Say whether there is a way at all, whatever it costs: a tenth of the time that `search` takes to find none.

    Args: see `search`. Every step can be undone, so it does not matter which side is asked from.
    """
    headings, rows, columns = free.shape
    seen = np.zeros(free.shape, np.uint8)  # 1: to be arrived at, 2: has been
    for k in range(len(ends)):
        seen[ends[k, 0], ends[k, 1], ends[k, 2]] = 1
    waiting = np.empty((free.size + len(seeds), 3), np.int32)
    count = 0
    for k in range(len(seeds)):
        h, r, c = seeds[k]
        if seen[h, r, c] == 1:
            return True
        seen[h, r, c] = 2
        waiting[count] = h, r, c
        count += 1
    while count > 0:
        count -= 1
        h, r, c = waiting[count]
        for way in range(4):
            nh, nr, nc = h, r, c
            if way < 2:
                sign = 1 if way == 0 else -1
                nr, nc = r + sign * moves[h, 0], c + sign * moves[h, 1]
                if nr < 0 or nc < 0 or nr >= rows or nc >= columns:
                    continue
            else:
                nh = (h + 1) % headings if way == 2 else (h - 1) % headings
                if not turns[h if way == 2 else nh, r, c]:
                    continue
            if not free[nh, nr, nc] or seen[nh, nr, nc] == 2:
                continue
            if seen[nh, nr, nc] == 1:
                return True
            seen[nh, nr, nc] = 2
            waiting[count] = nh, nr, nc
            count += 1
    return False


@njit(cache=True)
def search(
    free: Flags,
    turns: Flags,
    moves: Index,
    angles: Array,
    seeds: Index,
    seed_costs: Array,
    ends: Index,
    end_costs: Array,
    reverse: float,
    turning: float,
    corner: float,
) -> Index:
    """Return the cheapest way as states (n, 3) of heading, row and column; empty where there is none.

    Args:
        free: (H, R, C) where the robot stands free at each heading.
        turns: (H, R, C) where it can turn on from each heading to the next.
        moves: (H, 2) rows and columns of one step forward at each heading.
        angles: (H,) from each heading to the next [rad].
        seeds: (s, 3) states to begin with.
        seed_costs: (s,) of those.
        ends: (e, 3) states to end with.
        end_costs: (e,) of what follows from there.
        reverse: cost of a cell driven backwards, over that forward.
        turning: of a turn [cells/rad].
        corner: of stopping to turn [cells].
    """
    headings, rows, columns = free.shape
    size = headings * rows * columns
    cost = np.full(size, np.inf)
    before = np.full(size, -1, np.int64)
    leave = np.full(size, np.inf)
    low_r, high_r, low_c, high_c = rows, -1, columns, -1
    for k in range(len(ends)):
        h, r, c = ends[k]
        leave[(h * rows + r) * columns + c] = end_costs[k]
        low_r, high_r = min(low_r, r), max(high_r, r)
        low_c, high_c = min(low_c, c), max(high_c, c)
    keys, states = np.empty(1024), np.empty(1024, np.int64)
    count = 0
    for k in range(len(seeds)):
        h, r, c = seeds[k]
        state = (h * rows + r) * columns + c
        if seed_costs[k] < cost[state]:
            cost[state] = seed_costs[k]
            keys, states, count = _push(keys, states, count, seed_costs[k], state)
    best, last = np.inf, -1
    done = np.zeros(size, np.bool_)
    while count > 0:
        key, state, count = _pop(keys, states, count)
        if key >= best:
            break
        if done[state]:
            continue
        done[state] = True
        if cost[state] + leave[state] < best:
            best, last = cost[state] + leave[state], state
        h, rest = state // (rows * columns), state % (rows * columns)
        r, c = rest // columns, rest % columns
        length = math.hypot(moves[h, 0], moves[h, 1])
        for way in range(4):
            nh, nr, nc = h, r, c
            if way < 2:
                sign = 1 if way == 0 else -1
                nr, nc = r + sign * moves[h, 0], c + sign * moves[h, 1]
                spent = length if way == 0 else reverse * length
            else:
                nh = (h + 1) % headings if way == 2 else (h - 1) % headings
                over = h if way == 2 else nh
                if not turns[over, r, c]:
                    continue
                spent = turning * angles[over]
                # The first of several turns on one spot pays for the stop.
                if before[state] < 0 or before[state] % (rows * columns) != rest:
                    spent += corner
            if nr < 0 or nc < 0 or nr >= rows or nc >= columns or not free[nh, nr, nc]:
                continue
            there = (nh * rows + nr) * columns + nc
            total = cost[state] + spent
            if not done[there] and total < cost[there] - 1e-12:
                cost[there] = total
                before[there] = state
                dr = max(low_r - nr, nr - high_r, 0)
                dc = max(low_c - nc, nc - high_c, 0)
                keys, states, count = _push(keys, states, count, total + math.hypot(dr, dc), there)
    length = 0
    state = last
    while state >= 0:
        length += 1
        state = before[state]
    found = np.empty((length, 3), np.int64)
    state = last
    for k in range(length - 1, -1, -1):
        rest = state % (rows * columns)
        found[k, 0], found[k, 1], found[k, 2] = state // (rows * columns), rest // columns, rest % columns
        state = before[state]
    return found


@njit(cache=True)
def _push(keys: Array, states: Index, count: int, key: float, state: int) -> tuple[Array, Index, int]:
    if count == len(keys):
        keys, states = np.concatenate((keys, np.empty(count))), np.concatenate((states, np.empty(count, np.int64)))
    k = count
    while k > 0 and keys[(k - 1) // 2] > key:
        keys[k], states[k] = keys[(k - 1) // 2], states[(k - 1) // 2]
        k = (k - 1) // 2
    keys[k], states[k] = key, state
    return keys, states, count + 1


@njit(**LEAF)
def _pop(keys: Array, states: Index, count: int) -> tuple[float, int, int]:
    key, state = keys[0], states[0]
    count -= 1
    last, moved = keys[count], states[count]
    k = 0
    while 2 * k + 1 < count:
        child = 2 * k + 1
        if child + 1 < count and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= last:
            break
        keys[k], states[k] = keys[child], states[child]
        k = child
    keys[k], states[k] = last, moved
    return key, state, count
