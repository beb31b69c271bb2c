"""Compiled: which states can be reached at all, 64 neighbouring cells at once, costs left aside.

That a state is reached needs no order: a set of states is one bit each, a move shifts the bits of a word and keeps
those from which it is free. What a search in the order of cost takes minutes to exhaust is exhausted in a second.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_planner.lattice.sweep_kernel import (
    ALL,
    NONE,
    SweepTables,
    move_word,
    taken_word,
)

Int = NDArray[np.int32]
Long = NDArray[np.int64]
Word = NDArray[np.uint64]

EXHAUSTED, BUDGET, FULL = range(3)
"""Why a call returned: nothing is left to go on from, the words that were allowed are done, the log needs room."""
(HEAD, WAITING, LOGGED) = range(3)
"""Places in `numbers`: the queue's first entry, entries in it, entries of the log."""


@njit(**LEAF)
def flood(
    first: Int,
    ahead: Int,
    target: Int,
    border: int,
    crossed_first: Int,
    crossed: Int,
    closed: Word,
    sweeps: SweepTables,
    seen: Word,
    fresh: Word,
    queue: Int,
    log_place: Int,
    log_move: Int,
    log_bits: Word,
    numbers: Long,
    allowed: int,
) -> int:
    """Go on from all states that were reached and not gone on from, in the order in which they were.

    Args:
        first: (bins + 1,) where each bin's moves begin.
        ahead: (m, 2) columns and rows that each goes.
        target: (m,) bin that it ends in.
        border: by which the bits of `closed` are wider than the grid.
        crossed_first: (m + 1,) where each move's pieces begin.
        crossed: (p, 3) the cells whose cost counts, ends included, cut up.
        closed: (levels, rows, words) bits of where a cell is not to be entered.
        sweeps: see there.
        seen: (rows, words, bins) bits of states that were reached.
        fresh: those not gone on from.
        queue: (n,) in a circle, places in `fresh` that are not empty; n: their number.
        log_place: (l,) place in `seen` of which bits were set.
        log_move: (l,) by what move.
        log_bits: (l,) which.
        numbers: (3,) what is carried from call to call; places above.
        allowed: words to be gone on from.

    Returns:
        EXHAUSTED, BUDGET or FULL.
    """
    rows, words, bins = seen.shape
    head, waiting, logged = numbers[HEAD], numbers[WAITING], numbers[LOGGED]
    moves_most = 0
    for b in range(bins):
        moves_most = max(moves_most, first[b + 1] - first[b])
    shaped = sweeps.border >= 0
    status = BUDGET
    for _ in range(allowed):
        if waiting == 0:
            status = EXHAUSTED
            break
        if logged + 2 * moves_most > len(log_place):
            status = FULL
            break
        place = np.int64(queue[head])
        head = head + 1 if head + 1 < len(queue) else 0
        waiting -= 1
        line = place // bins
        b = place - line * bins
        row = line // words
        word = line - row * words
        bits = fresh[row, word, b]
        fresh[row, word, b] = NONE
        for m in range(first[b], first[b + 1]):
            free = bits
            if shaped:
                if sweeps.known[row, word, m] != sweeps.stamp:
                    sweeps.free[row, word, m] = move_word(row, word, m, sweeps)
                    sweeps.known[row, word, m] = sweeps.stamp
                free &= sweeps.free[row, word, m]
            if free == NONE:
                continue
            pieces = crossed[crossed_first[m] : crossed_first[m + 1]]
            free = ~taken_word(row + border, (word << 6) + border, pieces, closed, ~free)
            if free == NONE:
                continue
            left = (word << 6) + ahead[m, 0]
            low, rest, there = left >> 6, np.uint64(left & 63), row + ahead[m, 1]
            for side in range(2):
                # Shifted in two steps: a shift by 64 is undefined.
                moved = free << rest if side == 0 else (free >> np.uint64(1)) >> (np.uint64(63) - rest)
                at = low + side
                if moved == NONE or at < 0 or at >= words or there < 0 or there >= rows:
                    continue
                new = moved & (ALL ^ seen[there, at, target[m]])
                if new == NONE:
                    continue
                seen[there, at, target[m]] |= new
                end = (there * words + at) * bins + target[m]
                if fresh[there, at, target[m]] == NONE:
                    behind = head + waiting
                    queue[behind if behind < len(queue) else behind - len(queue)] = end
                    waiting += 1
                fresh[there, at, target[m]] |= new
                log_place[logged], log_move[logged], log_bits[logged] = end, m, new
                logged += 1
    numbers[HEAD], numbers[WAITING], numbers[LOGGED] = head, waiting, logged
    return status
