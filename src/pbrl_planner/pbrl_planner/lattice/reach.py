"""Whether there is any way at all from start to goal: an exact answer, and a way, from both ends in turns."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.lattice import reach_kernel as kernel
from pbrl_planner.lattice.lattice import Lattice
from pbrl_planner.lattice.motions import Direction
from pbrl_planner.lattice.sweeps import WORD, Floor, cut_cells, joined

AT_ONCE = 8192
"""Words of 64 states that one end goes on from before it is the other's turn."""
ROOM = 1 << 16
"""Entries of the log to begin with."""


@dataclass(frozen=True)
class Reached:
    """What was found.

    Attributes:
        connected: whether there is a way; None: the time was up.
        primitives: (k,) of a way, in order, which costs whatever it does; None without one.
        side: of a proof that there is none: the end that is shut in, "start" or "goal"; empty otherwise.
    """

    connected: bool | None
    primitives: NDArray[np.int64] | None = None
    side: str = ""


def reach(lattice: Lattice, start: int, goal: int, time_limit: float) -> Reached:
    """Look for a way from a state to another, by number, whatever it costs.

    Exactly the edges that the search has are gone along: where nothing is left at one end, there is no way on the
    lattice.

    Args:
        lattice: floor and motions.
        start: it begins in.
        goal: it ends in.
        time_limit: [s].
    """
    until = time.perf_counter() + time_limit
    closed = Floor.of(lattice.cost, lattice.grid.blocked, max(lattice.motions.sweep_reach, 2 * lattice.border))
    floods = [_Flood(lattice, start, "forward", closed), _Flood(lattice, goal, "backward", closed)]
    while time.perf_counter() < until:
        for one, side in zip(floods, ("start", "goal"), strict=True):
            exhausted = one.go_on()
            both = floods[0].seen & floods[1].seen
            if both.any():
                place = int(np.flatnonzero(both)[0])
                word = int(both.flat[place])
                bit = (word & -word).bit_length() - 1
                ways = [each.way(place, bit) for each in floods]
                return Reached(True, np.concatenate((ways[0][::-1], ways[1])))
            if exhausted:
                return Reached(False, side=side)
    return Reached(None)


class _Flood:
    """What can be reached from one end.

    Attributes:
        seen: (rows, words, bins) bits of states.
    """

    def __init__(self, lattice: Lattice, root: int, direction: Direction, closed: Floor) -> None:
        self._tables, self._sweeps = lattice.tables(direction), lattice.sweeps(direction)
        self._closed, self._bins = closed, lattice.primitives.bins
        rows, columns = lattice.cost.shape
        self._words = -(-columns // WORD)
        self.seen = np.zeros((rows, self._words, self._bins), dtype=np.uint64)
        self._fresh = np.zeros_like(self.seen)
        self._queue = np.empty(self.seen.size, dtype=np.int32)
        self._log_place: NDArray[np.int32] = np.empty(ROOM, dtype=np.int32)
        self._log_move: NDArray[np.int32] = np.empty(ROOM, dtype=np.int32)
        self._log_bits: NDArray[np.uint64] = np.empty(ROOM, dtype=np.uint64)
        self._numbers = np.zeros(3, dtype=np.int64)
        moves = lattice.motions.moves
        cells = []
        for number in self._tables.primitive:
            move = moves[number] if direction == "forward" else moves[number].reverse()
            cells.append(cut_cells({(0, 0), (move.dx, move.dy), *move.dear}))
        self._crossed_first, self._crossed = joined(cells)
        cell, bin_ = divmod(root, self._bins)
        row, column = divmod(cell, lattice.stride)
        place = (row * self._words + column // WORD) * self._bins + bin_
        bit = np.uint64(1) << np.uint64(column % WORD)
        self.seen.flat[place] = self._fresh.flat[place] = bit
        self._queue[0], self._numbers[kernel.WAITING] = place, 1
        self._root = (place, column % WORD)

    def go_on(self) -> bool:
        """Go on for a while; return whether nothing is left."""
        tables = self._tables
        while True:
            status = kernel.flood(
                tables.first,
                tables.ahead,
                tables.target,
                self._closed.border,
                self._crossed_first,
                self._crossed,
                self._closed.levels,
                self._sweeps,
                self.seen,
                self._fresh,
                self._queue,
                self._log_place,
                self._log_move,
                self._log_bits,
                self._numbers,
                AT_ONCE,
            )
            if status != kernel.FULL:
                return bool(status == kernel.EXHAUSTED)
            self._log_place = np.concatenate((self._log_place, np.empty_like(self._log_place)))
            self._log_move = np.concatenate((self._log_move, np.empty_like(self._log_move)))
            self._log_bits = np.concatenate((self._log_bits, np.empty_like(self._log_bits)))

    def way(self, place: int, bit: int) -> NDArray[np.int64]:
        """Return the primitives (k,) by which a state was reached, the last first."""
        count = int(self._numbers[kernel.LOGGED])
        places, moves, bits = self._log_place[:count], self._log_move[:count], self._log_bits[:count]
        order = np.argsort(places, kind="stable")
        ordered, found = places[order], []
        while (place, bit) != self._root:
            entries = order[np.searchsorted(ordered, place) : np.searchsorted(ordered, place, side="right")]
            (by,) = entries[(bits[entries] >> np.uint64(bit)) & np.uint64(1) != 0]
            move = int(moves[by])
            found.append(int(self._tables.primitive[move]))
            line = place // self._bins
            row, word = divmod(line, self._words)
            dx, dy = (int(value) for value in self._tables.ahead[move])
            column = word * WORD + bit - dx
            place = ((row - dy) * self._words + column // WORD) * self._bins + int(self._tables.source[move])
            bit = column % WORD
        return np.array(found, dtype=np.int64)
