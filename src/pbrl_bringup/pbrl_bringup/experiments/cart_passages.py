"""Corners and doorways for a robot with a cart: one floor for each width, wider ones with more room and nothing less.

Everything is in cells of the lattice, so that a width is exact. All turns are to the right, as in thesis figure 18.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.cart.outline import ARTICULATION, KEPT, pr2_with
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import (
    ArticulatedBody,
    CostGrid,
    GeneratorSettings,
    Lattice,
    LatticePlan,
    LatticeProblem,
    LatticeSettings,
    Motions,
    generate,
    plan,
)
from pbrl_planner.lattice.body import CART_LENGTH, CART_WIDTH, PR2_GRIP, PR2_HALF, rectangle

CELL = 0.025
"""[m]"""
BENT, STRAIGHT = "with articulation", "cart held straight"
PATIENCE = LatticeSettings(time_limit=600.0, direction="forward", expansions=40_000_000)
"""Until the cheapest plan, or the proof that there is none."""
LENGTH = PR2_GRIP + CART_LENGTH
"""From the middle of the robot to the front of its cart [m]."""
BESIDE = 0.50
"""From the inner wall of a corner to the middle of the robot at start and goal [m]."""
WALL = 6
"""Thickness of a wall with a door in it [cells]."""
NARROW, WIDE = 1.4, 3.0
"""Width of the room behind a door [m]: in the narrow one robot and cart cannot turn round, so that the cart has to go
in first; into the wide one they can go backwards, and turn round inside."""
DEPTH = 2.6
"""Of the room [m]."""

Pose = tuple[float, float, float, float]


@dataclass(frozen=True)
class Passage:
    """A floor, and where robot and cart start and should get to.

    Attributes:
        occupied: (rows, columns) where walls are, row 0 at the lowest y.
        origin: lowest x and y of it [m].
        start: (x, y, heading, articulation) [m, rad].
        goal: the same.
    """

    occupied: NDArray[np.bool_]
    origin: tuple[float, float]
    start: Pose
    goal: Pose

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Lowest and highest x, lowest and highest y [m]."""
        rows, columns = self.occupied.shape
        x, y = self.origin
        return x, x + columns * CELL, y, y + rows * CELL


def corner(width: int) -> Passage:
    """Return a corridor that turns to the right by 90 degrees about the origin, of one width [cells] before and after.

    Robot and cart start where the cart's front is at the corner, and end where the robot's back has left it.
    """
    far = cells_of(LENGTH + 1.5)
    free = np.zeros((far + width, far + width), dtype=bool)
    free[far:, :] = True
    free[:, far:] = True
    back = PR2_HALF + CELL
    return Passage(
        _walled(free),
        (-far * CELL - CELL, -far * CELL - CELL),
        (-LENGTH - CELL, BESIDE, 0.0, 0.0),
        (BESIDE, -back, -math.pi / 2.0, 0.0),
    )


def into_door(door: int, corridor: int, room: float = NARROW) -> Passage:
    """Return a corridor with a doorway in its right wall, in the middle of which the origin is, and a room behind.

    Args:
        door: width of the doorway [cells].
        corridor: width of the corridor [cells].
        room: width of the room [m].
    """
    free, origin = _room_and_corridor(door, corridor, room)
    return Passage(free, origin, (-2.0, BESIDE, 0.0, 0.0), (0.0, -WALL * CELL - PR2_HALF - 0.05, -math.pi / 2.0, 0.0))


def out_of_door(door: int, corridor: int, room: float = NARROW) -> Passage:
    """Return the same floor the other way: out of the room, and to the right along the corridor."""
    free, origin = _room_and_corridor(door, corridor, room)
    # The right of who comes out is where x grows.
    return Passage(free, origin, (0.0, -WALL * CELL - LENGTH - 0.05, math.pi / 2.0, 0.0), (0.9, BESIDE, 0.0, 0.0))


def open_floor(away: float) -> Passage:
    """Return a floor without walls: a turn by 90 degrees to the right, the goal as far ahead as aside [m]."""
    half = cells_of(LENGTH + away + 0.5)
    free = np.ones((2 * half, 2 * half), dtype=bool)
    low = -half * CELL - CELL
    return Passage(_walled(free), (low, low), (-away, 0.0, 0.0, 0.0), (0.0, -away, -math.pi / 2.0, 0.0))


def _room_and_corridor(door: int, corridor: int, room: float) -> tuple[NDArray[np.bool_], tuple[float, float]]:
    """Return what is occupied, and its origin: x along the corridor, y out of the room."""
    half, inside, depth = cells_of(3.6), cells_of(room / 2.0), cells_of(DEPTH)
    free = np.zeros((depth + WALL + corridor, 2 * half), dtype=bool)
    free[:depth, half - inside : half + inside] = True
    free[depth + WALL :] = True
    free[depth : depth + WALL, half - (door + 1) // 2 : half + door // 2] = True
    return _walled(free), (-half * CELL - CELL, -(depth + WALL) * CELL - CELL)


def _walled(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a floor is not free, with one cell of wall around."""
    return np.pad(~free, 1, constant_values=True)


def cells_of(length: float) -> int:
    """Return a length [m] in cells."""
    return round(length / CELL)


@cache
def thesis_motions() -> dict[str, Motions]:
    """Return motions of the PR2's base and a cart of 0.9 by 0.6 m: the outlines of the thesis' figures."""
    body = ArticulatedBody.pr2_with_cart()
    return {
        BENT: Motions(generate(), None, body),
        STRAIGHT: Motions(generate(GeneratorSettings(articulations=1)), None, body),
    }


@cache
def drive_motions() -> dict[str, Motions]:
    """Return motions as in the simulator's offices: elbows, casters and what the drive is off by take room, too."""
    body = pr2_with(rectangle(-CART_LENGTH / 2.0, CART_LENGTH / 2.0, CART_WIDTH / 2.0), KEPT)
    bent = GeneratorSettings(articulation_limit=ARTICULATION)
    return {
        BENT: Motions(generate(bent), None, body),
        STRAIGHT: Motions(generate(GeneratorSettings(articulations=1)), None, body),
    }


def solve(passage: Passage, motions: Motions) -> LatticePlan | None:
    """Return the quickest plan, or the proof that there is none; None: there is no room to start or to end."""
    grid = CostGrid.of_occupied(passage.occupied, CELL, passage.origin)
    try:
        problem = LatticeProblem(Lattice(grid, motions), passage.start, passage.goal)
    except PlannerError:
        return None
    return plan(problem, PATIENCE)


@dataclass(frozen=True)
class Least:
    """The least width with which there is a plan.

    Attributes:
        cells: it; None: not with the greatest that was tried either.
        plan: with that width; None where there is no such width.
        refused: the greatest width [cells] of which it is proved that there is no plan; None: the least had one.
        proved: whether every failure was a proof.
    """

    cells: int | None
    plan: LatticePlan | None
    refused: int | None
    proved: bool

    @property
    def width(self) -> float:
        """[m]; NaN where there is none."""
        return math.nan if self.cells is None else self.cells * CELL


def least_width(passage: Callable[[int], Passage], motions: Motions, low: int, high: int) -> Least:
    """Bisect the least width between two [cells], both of which are tried themselves.

    What is passed once is passed in all that is wider: start and goal stay, and no wall comes in.
    """
    best = solve(passage(high), motions)
    if best is None or not best.found:
        return Least(None, None, high, best is None or best.exhausted)
    refused, proved = low - 1, True
    while high - refused > 1:
        middle = (refused + high) // 2
        found = solve(passage(middle), motions)
        if found is not None and found.found:
            high, best = middle, found
        else:
            refused, proved = middle, proved and (found is None or found.exhausted)
    return Least(high, best, refused if refused >= low else None, proved)
