"""Anytime Repairing A* (thesis 4.5.4): a plan soon, then better ones, each with how far from the best it can be."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import search_kernel as kernel
from pbrl_planner.lattice.lower_bound import LowerBound
from pbrl_planner.lattice.plan import Improvement, LatticePlan
from pbrl_planner.lattice.problem import LatticeProblem
from pbrl_planner.lattice.reach import Reached, reach
from pbrl_planner.lattice.settings import LatticeSettings

AT_ONCE = 20_000
"""Expansions between two looks at the clock."""
LARGEST_HEAP = 1 << 28
FURTHER = 1.1
"""Times the bound of the start, up to which the lower bound is made before there is a plan."""
NEAR = 8
"""Cells from either end of the way within which no state is left out: there is little room where a robot stops."""
SCOUTED = (30_000, 10_000, 20_000)
"""Expansions of a search that leaves states out, at most, before it leaves out fewer: in blocks of 2, 4 and 8 cells a
side. To turn round in a room takes up to 20,000 in blocks of 0.2 m, and ten times as many where none is left out."""
PLAIN = 600_000
"""Expansions of the search that leaves nothing out after those that did, before it is asked whether there is any way:
where robot and cart are hemmed in only few states are free, and that is soon over. They take half of what the answer
would."""
ROOM = 1 << 14
"""Entries of the heap to begin with."""


def plan(
    problem: LatticeProblem,
    settings: LatticeSettings | None = None,
    improved: Callable[[LatticePlan], bool | None] | None = None,
) -> LatticePlan:
    """Find a way from start to goal, and make it cheaper until it is the cheapest or the time is up.

    The same problem and settings give the same plan, to the bit, unless the time limit is hit.

    Args:
        problem: what is asked.
        settings: epsilons and patience.
        improved: is given each solution as soon as it is there, the first one too; returns True: it is good enough.

    Raises:
        PlannerError: costs are too large to be added up.
    """
    search = _Search(problem, settings or LatticeSettings(), improved)
    try:
        return search.run()
    finally:
        search.give_back()


class _Search:
    """One query: the arrays of the search, and what is known so far."""

    def __init__(
        self,
        problem: LatticeProblem,
        settings: LatticeSettings,
        improved: Callable[[LatticePlan], bool | None] | None,
    ) -> None:
        self._began = time.perf_counter()
        self._problem, self._settings, self._improved = problem, settings, improved
        lattice = self._lattice = problem.lattice
        self._tables, self._sweeps = lattice.tables(settings.direction), lattice.sweeps(settings.direction)
        ends = [lattice.number_of(state) for state in (problem.start_state, problem.goal_state)]
        self._root, self._goal = ends if settings.direction == "forward" else ends[::-1]
        self._history: list[Improvement] = []
        self._best: tuple[int, NDArray[np.int64]] | None = None
        self._epsilon, self._least = math.inf, 1
        self._bins = lattice.primitives.bins
        self._any: Reached | None = None
        self._bound = LowerBound(lattice, self._goal, settings.direction)
        self._bound.reach(self._root, FURTHER)
        self._radius = self._bound.radius
        self._to_bound = self._elapsed()
        self._taken = lattice.motions.shelf.take_records(lattice.cells * self._bins)
        self._records = self._taken.array
        self._heap = np.empty(ROOM, dtype=np.int64)
        self._waiting = np.empty(ROOM, dtype=np.int64)
        self._numbers = np.zeros(11, dtype=np.int64)
        self._thin_out(settings.thinned.bit_length() - 1)

    def give_back(self) -> None:
        """Leave the large arrays to the next search; this one is over."""
        self._lattice.motions.shelf.give_back(self._taken)

    def _record(self, cost: int, rest: int) -> int:
        return (self._taken.stamp << kernel.STAMP) | ((kernel.LIMIT - cost) << 16) | rest

    def run(self) -> LatticePlan:
        """Lower epsilon round by round."""
        if self._root == self._goal:
            self._best, self._epsilon = (0, np.zeros(0, dtype=np.int64)), 1.0
            self._tell()
            return self._result(False, "")
        if self._bound.at(self._root) >= kernel.LIMIT:
            return self._result(True, "there is no way for the robot's centre, or none to turn so, whatever it does")
        numerators = self._settings.numerators
        self._open(numerators[0])
        place = -1 if self._thin else 0
        while True:
            status = self._round()
            if self._thin and status != kernel.DONE:
                place = self._scout_closer(numerators[0])
                continue
            if status == kernel.BUDGET and self._in_doubt:
                if self._look_for_any():
                    return self._result(self._best is None, self._reason())
                continue
            if status == kernel.BUDGET:
                return self._stopped()
            if status == kernel.EXHAUSTED:
                return self._result(True, "everything that can be reached from the start was searched: there is no way")
            place = self._next(numerators, place)
            if self._tell() or place >= len(numerators):
                return self._result(False, "")
            self._complete(numerators[place])

    def _thin_out(self, thin: int) -> None:
        """Leave out states from now on, but one in a block of 2^thin by 2^thin cells for each bin; 0: none."""
        lattice = self._lattice
        rows, columns = lattice.cells // lattice.stride, lattice.stride
        blocks = ((rows >> thin) + 1) * ((columns >> thin) + 1) if thin else 0
        self._thin, self._marks = thin, np.zeros((blocks, self._bins), dtype=np.uint8)
        more = SCOUTED[thin - 1] if thin else PLAIN
        self._most = min(self._settings.expansions, int(self._numbers[kernel.EXPANDED]) + more)

    @property
    def _in_doubt(self) -> bool:
        """Whether searches that left states out have failed, and nothing else has shown yet that there is a way."""
        return self._settings.thinned > 1 and self._best is None and self._any is None

    def _look_for_any(self) -> bool:
        """Find out whether there is any way at all; return whether that, or the way itself, is answer enough."""
        ends = self._root, self._goal
        start, goal = ends if self._settings.direction == "forward" else ends[::-1]
        self._any = reach(self._lattice, start, goal, self._settings.time_limit - self._elapsed())
        if self._any.primitives is None:
            return self._any.connected is False
        cost = self._lattice.cost_along(self._problem.start_state, self._any.primitives)
        self._best = (cost, self._any.primitives)
        self._epsilon = cost / max(1, self._bound.at(self._root))
        return self._tell()

    def _reason(self) -> str:
        assert self._any is not None, "called after that was found out"
        return f"everything that can be reached from the {self._any.side} was looked at" if self._any.side else ""

    def _scout_closer(self, numerator: int) -> int:
        """Go over to smaller blocks, or to a search that leaves nothing out; return the place of its epsilon."""
        thin = self._thin - 1
        self._bound.finish()
        self._merge(numerator)
        self._thin_out(thin)
        return -1 if thin else 0

    def _open(self, numerator: int) -> None:
        shift = int(self._lattice.cells * self._bins).bit_length()
        numbers = self._numbers
        numbers[kernel.GOAL], numbers[kernel.NUMERATOR] = self._goal, numerator
        numbers[kernel.DENOMINATOR] = self._settings.denominator
        numbers[kernel.SHIFT], numbers[kernel.ROUND] = shift, 1
        numbers[kernel.MOST] = min(kernel.LIMIT, (1 << (62 - shift)) // numerator)
        numbers[kernel.BEARS] = self._taken.stamp
        self._records[self._root] = self._record(0, 0)
        numbers[kernel.TOUCHED] = 1
        self._heap[0] = ((numerator * self._bound.at(self._root)) << shift) | self._root
        numbers[kernel.HEAP] = 1

    def _round(self) -> int:
        """Expand states until this epsilon's plan is there, nothing is left, or patience is at an end."""
        lattice, tables, sweeps = self._lattice, self._tables, self._sweeps
        cost = lattice.cost.ravel()
        while True:
            most = self._most if self._thin or self._in_doubt else self._settings.expansions
            left = most - int(self._numbers[kernel.EXPANDED])
            if left <= 0 or self._elapsed() >= self._settings.time_limit:
                return kernel.BUDGET
            status = kernel.improve(
                tables.first,
                tables.step,
                tables.cell_step,
                tables.base,
                tables.cells_first,
                tables.cells,
                tables.rank,
                tables.target,
                cost,
                lattice.grid.blocked,
                self._bins,
                self._bound.toward,
                self._radius,
                self._bound.turning,
                self._records,
                self._heap,
                self._waiting,
                self._numbers,
                min(left, AT_ONCE),
                lattice.stride,
                sweeps,
                self._thin,
                self._root,
                NEAR,
                self._marks,
            )
            if status == kernel.TOO_COSTLY:
                raise PlannerError(
                    f"costs: expected sums below {self._numbers[kernel.MOST]}, got more; lower the multipliers or "
                    "the map's costs"
                )
            if status == kernel.FULL:
                self._heap, self._waiting = _grown(self._heap), _grown(self._waiting)
            elif status != kernel.BUDGET:
                return status

    def _next(self, numerators: list[int], place: int) -> int:
        """Note the plan, prove its bound, and make ready for the next epsilon that is below it; return its place."""
        moves, cost = self._way()
        if self._best is None or cost < self._best[0]:
            self._best = (cost, moves)
        # What is ahead of the goal on its way may have got cheaper since the goal was reached from there.
        self._records[self._goal] = self._record(cost, int(self._records[self._goal]) & 0xFFFF)
        while True:
            place += 1
            numerator = numerators[min(place, len(numerators) - 1)]
            least = self._merge(numerator)
            self._least = max(1, self._least, min(least, self._best[0]))
            proved = max(1.0, self._best[0] / self._least)
            # A round that left states out promises nothing by itself.
            asked = numerators[place - 1] / self._settings.denominator if place > 0 else math.inf
            self._epsilon = min(self._epsilon, proved, asked)
            if place >= len(numerators) or self._epsilon <= self._settings.last_epsilon:
                return len(numerators)
            if numerator < self._epsilon * self._settings.denominator:
                return place

    def _merge(self, numerator: int) -> int:
        """Put all states that are not as good as they could be into one heap for an epsilon; return the least g + h."""
        entries = int(self._numbers[kernel.HEAP] + self._numbers[kernel.WAITING])
        while len(self._heap) < entries + self._bins:
            self._heap = _grown(self._heap)
        least = kernel.next_round(
            self._bins,
            self._bound.toward,
            self._radius,
            self._bound.radius,
            self._bound.turning,
            self._records,
            self._heap,
            self._waiting,
            self._numbers,
            numerator,
        )
        self._radius, self._thin = self._bound.radius, 0
        return int(least)

    def _complete(self, numerator: int) -> None:
        """See to it that the lower bound is there on the whole floor: the first plan needs less of it."""
        if self._radius < kernel.LIMIT:
            self._bound.finish()
            self._least = max(self._least, min(self._merge(numerator), self._cost_so_far()))

    def _cost_so_far(self) -> int:
        return kernel.LIMIT if self._best is None else self._best[0]

    def _way(self) -> tuple[NDArray[np.int64], int]:
        """Return the primitives (k,) from start to goal and what they cost together."""
        tables, state, found = self._tables, self._goal, []
        while state != self._root:
            m = tables.into[state % self._bins][int(self._records[state]) & 255]
            found.append(int(tables.primitive[m]))
            state -= int(tables.step[m])
        primitives = np.array(found, dtype=np.int64)
        if self._settings.direction == "forward":
            primitives = primitives[::-1]
        return primitives, self._lattice.cost_along(self._problem.start_state, primitives)

    def _tell(self) -> bool:
        """Note the solution, give it away, and return whether it is good enough."""
        assert self._best is not None, "called after a plan was found"
        self._history.append(
            Improvement(self._epsilon, self._best[0], int(self._numbers[kernel.EXPANDED]), self._elapsed())
        )
        return self._improved is not None and self._improved(self._result(False, "")) is True

    def _stopped(self) -> LatticePlan:
        """Return what there is when patience is at an end: a plan that got better since the last round, too."""
        settings = self._settings
        if self._best is None:
            spent = int(self._numbers[kernel.EXPANDED]) >= settings.expansions
            effort = f"with {settings.expansions} expansions" if spent else f"in {settings.time_limit:g} s"
            return self._result(False, f"no plan found {effort}; there may be one: allow more")
        if int(self._records[self._goal]) >> kernel.STAMP != self._taken.stamp:
            return self._result(False, "")
        moves, cost = self._way()
        if cost < self._best[0]:
            self._best = (cost, moves)
            self._epsilon = min(self._epsilon, cost / self._least)
            self._tell()
        return self._result(False, "")

    def _result(self, exhausted: bool, reason: str) -> LatticePlan:
        cost, moves = self._best or (-1, np.zeros(0, dtype=np.int64))
        found = self._best is not None
        waypoints = poses = np.zeros((0, 4))
        if found:
            waypoints, poses = self._lattice.poses_along(self._problem.start_state, moves)
        return LatticePlan(
            poses,
            moves,
            waypoints,
            cost,
            self._epsilon,
            int(self._numbers[kernel.EXPANDED]),
            int(self._numbers[kernel.TOUCHED]),
            self._elapsed(),
            self._history[0].seconds if self._history else math.inf,
            self._to_bound,
            tuple(self._history),
            exhausted,
            reason,
        )

    def _elapsed(self) -> float:
        return time.perf_counter() - self._began


def _grown(array: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return an array twice as long that begins with this one.

    Raises:
        PlannerError: it would be beyond all measure.
    """
    if 2 * len(array) > LARGEST_HEAP:
        raise PlannerError(f"search: expected at most {LARGEST_HEAP} open states, got more; take larger cells")
    return np.concatenate((array, np.empty_like(array)))
