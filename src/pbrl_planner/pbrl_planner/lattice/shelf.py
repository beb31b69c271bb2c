"""Large arrays of searches, kept for the next: clearing them takes longer than a short search."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.lattice.search_kernel import LAST_STAMP


@dataclass(frozen=True)
class Records:
    """Records of states, and the stamp of the search that has them.

    Attributes:
        array: (n,) of at least as many as there are states; what bears another stamp counts as never seen.
        stamp: from 1.
    """

    array: NDArray[np.int64]
    stamp: int


@dataclass(frozen=True)
class Answers:
    """What was found out about sets of cells, by word of the floor.

    Attributes:
        free: flat; bits of the places where they are free.
        known: flat; stamps of the floors that the answers are of.
        stamp: of this floor, from 1.
    """

    free: NDArray[np.uint64]
    known: NDArray[np.uint16]
    stamp: int

    def shaped(self, shape: tuple[int, int, int]) -> tuple[NDArray[np.uint64], NDArray[np.uint16]]:
        """Return both arrays, as much of them as is needed, in a shape."""
        size = math.prod(shape)
        return self.free[:size].reshape(shape), self.known[:size].reshape(shape)


@dataclass
class Shelf:
    """Keeps the arrays of the last search and floor."""

    _records: Records | None = None
    _answers: dict[str, Answers] = field(default_factory=dict)

    def take_records(self, states: int) -> Records:
        """Return an array that nobody else has, for a search over so many states."""
        kept, self._records = self._records, None
        if kept is None or len(kept.array) < states or kept.stamp >= LAST_STAMP:
            return Records(np.zeros(states, dtype=np.int64), 1)
        return Records(kept.array, kept.stamp + 1)

    def have_memory(self, states: int) -> None:
        """Have memory for a search over so many states, and for the answers so far, there.

        What is only promised is cleared by whoever touches it first. Nothing that was answered is known any more.
        """
        records = self.take_records(states)
        if records.stamp == 1:
            records.array.fill(0)
        self.give_back(records)
        for each in self._answers.values():
            each.free.fill(0)
            each.known.fill(0)

    def give_back(self, records: Records) -> None:
        """Keep an array for the next search."""
        self._records = records

    def answers(self, what: str, size: int) -> Answers:
        """Return arrays for a floor of which nothing is known yet; who still uses the same for another asks again.

        Args:
            what: the answers are about.
            size: of the arrays.
        """
        kept = self._answers.get(what)
        if kept is None or len(kept.free) < size or kept.stamp >= LAST_STAMP:
            found = Answers(np.zeros(size, dtype=np.uint64), np.zeros(size, dtype=np.uint16), 1)
        else:
            found = Answers(kept.free, kept.known, kept.stamp + 1)
        self._answers[what] = found
        return found
