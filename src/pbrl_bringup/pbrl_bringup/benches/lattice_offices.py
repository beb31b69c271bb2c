"""Offices for a cart: a corridor, rooms on both sides behind doors hardly wider than the robot, desks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.lattice import CostGrid

CELL = 0.025
"""[m]"""
WALL = 4
"""[cells] thick."""
DOOR = 28
"""[cells]: 0.70 m, 10 cm more than the cart is wide; the PR2 is 0.668 m."""
CLEAR = 2.1
"""[m] in front of a door, across and deep, in which no desk stands: robot and cart are 1.9 m long."""
NEAR, NEAREST = 0.3, 3
"""What is near obstacles costs up to three times more."""


@dataclass(frozen=True)
class Office:
    """A floor, and where robot and cart start and should get to.

    Attributes:
        grid: the floor.
        start, goal: (x, y, heading, articulation) [m, m, rad, rad].
        corridor: its width [m].
    """

    grid: CostGrid
    start: tuple[float, float, float, float]
    goal: tuple[float, float, float, float]
    corridor: float


def turn_into_door(corridor: float) -> Office:
    """Return a corridor with one door: a turn of 90 degrees from the middle of the one through the other.

    Args:
        corridor: width of it [m].
    """
    width, height = 5.0, 6.5
    occupied = _box(width, height)
    top = _cells(corridor) + WALL // 2
    occupied[top : top + WALL] = True
    left = _cells(3.0)
    occupied[top : top + WALL, left : left + DOOR] = False
    middle = (left + DOOR / 2) * CELL
    begin, end = (top + WALL // 2) * CELL - corridor / 2.0, (top + WALL) * CELL + 0.4
    grid = CostGrid.of_occupied(occupied, CELL, near=NEAR, nearest=NEAREST)
    return Office(grid, (1.2, begin - 0.05, 0.0, 0.0), (middle, end, math.pi / 2.0, 0.0), corridor)


def random_office(corridor: float, rng: np.random.Generator, door: int = DOOR) -> Office:
    """Return a corridor between two rows of rooms with a door and desks each, start in it and goal in one of them.

    Args:
        corridor: width of it [m].
        rng: of doors, desks, start and goal.
        door: width of each [cells].
    """
    rooms, room_width, depth = 3, 4.0, 3.6
    width, height = rooms * room_width, 2 * depth + corridor
    occupied = _box(width, height)
    low, high = _cells(depth), _cells(depth + corridor)
    occupied[low - WALL : low] = occupied[high : high + WALL] = True
    goals = []
    for row in (-1, 1):
        for room in range(rooms):
            left = _cells(room * room_width)
            if room:
                occupied[: low if row < 0 else None, left : left + WALL][0 if row < 0 else high :] = True
            jamb = left + _cells(rng.uniform(1.2, room_width - 1.2 - door * CELL))
            wall = low - WALL if row < 0 else high
            occupied[wall : wall + WALL, jamb : jamb + door] = False
            _furnish(occupied, left, _cells(room_width), low if row < 0 else high, row, jamb + door // 2, rng)
            middle = (jamb + door / 2) * CELL
            inside = (low * CELL - 0.9) if row < 0 else ((high + WALL) * CELL + 0.7)
            goals.append((middle, inside, row * math.pi / 2.0, 0.0))
    start = (rng.uniform(0.8, width - 2.2), (low + high) / 2.0 * CELL, 0.0, 0.0)
    grid = CostGrid.of_occupied(occupied, CELL, near=NEAR, nearest=NEAREST)
    return Office(grid, start, goals[int(rng.integers(len(goals)))], corridor)


def _furnish(
    occupied: NDArray[np.bool_], left: int, width: int, door_row: int, row: int, door: int, rng: np.random.Generator
) -> None:
    """Put up to three desks into a room, none in front of its door."""
    clear = _cells(CLEAR)
    for _ in range(3):
        long, deep = (_cells(1.5), _cells(0.75)) if rng.random() < 0.5 else (_cells(0.75), _cells(1.5))
        x = left + WALL + int(rng.integers(max(1, width - 2 * WALL - long)))
        away = int(rng.integers(_cells(3.4) - deep))
        beside = x > door + clear // 2 or x + long < door - clear // 2
        if not beside and away < clear + 3 * WALL:
            continue
        y = door_row + WALL + away if row > 0 else door_row - WALL - away - deep
        occupied[max(y, 0) : max(y + deep, 0), x : x + long] = True


def _box(width: float, height: float) -> NDArray[np.bool_]:
    """Return an empty floor with walls around."""
    occupied = np.zeros((_cells(height), _cells(width)), dtype=bool)
    half = WALL // 2
    occupied[:half] = occupied[-half:] = True
    occupied[:, :half] = occupied[:, -half:] = True
    return occupied


def _cells(length: float) -> int:
    return round(length / CELL)
