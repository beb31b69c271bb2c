"""A path of the base through narrow places: a search over places and headings, complete at its resolution.

Where a robot that is longer than wide has to pass between two things, samples of the plane seldom lie on the few lines
that lead through, and none of them where it has room to turn all round. Here every place and heading of a grid is
looked at: where the outline at a heading fits is an erosion of the free floor by that outline, likewise where it can
turn from one heading to the next. Legs are checked as exact swept polygons afterwards, with no margin: the margin is
wider than a cell. No random draw, no clock: the same question has the same answer.
"""

from __future__ import annotations

import itertools
import math
import weakref
from collections.abc import Iterable
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from pbrl_control.navigation.grid_kernel import erode, reaches, search
from pbrl_control.navigation.motion import MotionChecker
from pbrl_control.navigation.path import BasePath, Leg
from pbrl_control.planar import Array, rotation, wrap

Flags = NDArray[np.bool_]
Mask = tuple[NDArray[np.int64], int]
States = list[tuple[int, int, int]]

CELLS = (0.04, 0.025)
"""[m], tried one after the other; half a diagonal is less than the usual margin."""
HALF_DIAGONAL = math.sqrt(0.5)
"""Of a cell: so much is lost between the grid and what is exact, and kept as a margin where that is less."""
OCTANT = ((1, 0), (5, 1), (5, 2), (3, 2), (1, 1))
"""Steps (columns, rows) whose directions are the headings of the first 45 degrees."""
BETWEEN = 4
"""Outlines looked at in a turn from one heading to the next."""
REVERSE, TURNING, CORNER = 2.0, 0.3, 0.1
"""Costs: of a metre backwards over one forward, of a radian turned [m], of a stop to turn [m]."""
EXIT_STEP, EXIT_MOST = 0.05, 1.5
"""Straight ways out of a pose that begin or end a path [m]."""


def grid_path(checker: MotionChecker, start: Array, goal: Array) -> BasePath | None:
    """Return a path between two poses (3,) in `world` [m, rad]; None where the grid has none.

    Args:
        checker: robot, map and margin; the start needs only to be free of collision.
        start: where the base is.
        goal: where it is to be, reached exactly.
    """
    start, goal = np.asarray(start, float), np.asarray(goal, float)
    for cell in CELLS:
        grid = _grid(checker, cell)
        if not grid.bare.connected(start[:2], goal[:2]):
            return None
        found = _on_grid(grid, grid.bare, start, goal)
        if found is not None:
            return found
    return None


def _on_grid(grid: _Grid, bare: MotionChecker, start: Array, goal: Array) -> BasePath | None:
    seeds, seed_costs = _exits(grid, bare, start)
    ends, end_costs = _exits(grid, bare, goal)
    if not seeds or not ends:
        return None
    begin, finish = np.array(seeds), np.array(ends)
    if not reaches(grid.free, grid.turns, grid.moves, begin, finish):
        return None
    found = search(
        grid.free,
        grid.turns,
        grid.moves,
        grid.angles,
        begin,
        np.array(seed_costs) / grid.size,
        finish,
        np.array(end_costs) / grid.size,
        REVERSE,
        TURNING / grid.size,
        CORNER / grid.size,
    )
    corners, backwards = _corners(grid, found, start, goal)
    for first, last in itertools.product((True, False), repeat=2):
        # Out of a tight place the robot goes exactly straight; a cell lies a little beside that line.
        points = list(corners)
        if first:
            points[1] = _ahead(start, points[1])
        if last:
            points[-2] = _ahead(goal, points[-2])
        ways = (_shortened(bare, start, goal, points, backwards), (points, backwards))
        path = next((way for way in (_path(each, start, goal) for each in ways) if _free(bare, way)), None)
        if path is not None:
            return path
    return None


_KEPT: dict[float, tuple[weakref.ref[MotionChecker], _Grid]] = {}
"""The last grid of each cell size, and whose it is: who looks for a grasp asks one checker for many ways."""


def _grid(checker: MotionChecker, size: float) -> _Grid:
    """Return the grid of a checker, made anew unless it was the last to ask."""
    whose, grid = _KEPT.get(size, (None, None))
    if whose is None or grid is None or whose() is not checker:
        grid = _Grid(checker, size)
        _KEPT[size] = (weakref.ref(checker), grid)
    return grid


def _ahead(pose: Array, point: Array) -> Array:
    """Return the point (2,) straight ahead of a pose, or behind it, that is nearest to a point (2,)."""
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    return np.asarray(pose[:2] + ((point - pose[:2]) @ ahead) * ahead)


class _Grid:
    """Where the robot stands free at each heading.

    Args:
        checker: robot, map and margin.
        size: of a cell [m].

    Attributes:
        size: of a cell [m].
        bare: checks without a margin what the grid finds.
        headings: (H,) [rad], growing from 0.
        moves: (H, 2) rows and columns of one step forward.
        angles: (H,) from each heading to the next [rad].
        free, turns: (H, R, C), see `search`.
    """

    def __init__(self, checker: MotionChecker, size: float) -> None:
        self.size, self.bare = size, checker.bare()
        self.headings, self.moves, self.angles = _compass()
        low_x, low_y, high_x, high_y = checker.floor.room.bounds
        self.origin = np.array([low_x, low_y])
        columns, rows = math.ceil((high_x - low_x) / size) + 1, math.ceil((high_y - low_y) / size) + 1
        x, y = np.meshgrid(low_x + size * np.arange(columns), low_y + size * np.arange(rows))
        roomy = checker.floor.free.buffer(-max(checker.margin, HALF_DIAGONAL * size))
        shapely.prepare(roomy)
        blocked = ~shapely.contains_xy(roomy, x.ravel(), y.ravel()).reshape(rows, columns)
        standing, turning = _masks(checker.footprint.outline.tobytes(), size)
        self.free = np.stack([erode(blocked, *mask) for mask in standing])
        self.turns = np.stack([erode(blocked, *mask) for mask in turning])

    def place(self, row: int, column: int) -> Array:
        """Return the point (2,) of a cell in `world` [m]."""
        return self.origin + self.size * np.array([column, row])

    def cell(self, point: Array) -> tuple[int, int]:
        """Return row and column next to a point (2,)."""
        column, row = np.rint((point - self.origin) / self.size).astype(int)
        return int(row), int(column)


@cache
def _compass() -> tuple[Array, NDArray[np.int64], Array]:
    """Return headings (H,) [rad], steps (H, 2) of rows and columns, and angles (H,) to the next heading."""
    eighth = list(OCTANT) + [(row, column) for column, row in reversed(OCTANT[1:-1])]
    steps = []
    for quarter in range(4):
        for column, row in eighth:
            for _ in range(quarter):
                column, row = -row, column
            steps.append((row, column))
    moves = np.array(steps, dtype=np.int64)
    headings = np.mod(np.arctan2(moves[:, 0], moves[:, 1]), 2.0 * math.pi)
    return headings, moves, np.mod(np.roll(headings, -1) - headings, 2.0 * math.pi)


@lru_cache(maxsize=8)
def _masks(corners: bytes, size: float) -> tuple[tuple[Mask, ...], tuple[Mask, ...]]:
    """Return what an outline (k, 2), given as its bytes, covers at each heading, and in the turn to the next."""
    outline = np.frombuffer(corners).reshape(-1, 2)
    headings, _, angles = _compass()
    standing = tuple(_mask(outline, (heading,), size) for heading in headings)
    shares = np.linspace(0.0, 1.0, BETWEEN + 1)
    turning = tuple(
        _mask(outline, heading + shares * angle, size) for heading, angle in zip(headings, angles, strict=True)
    )
    return standing, turning


def _mask(outline: Array, headings: Iterable[float], size: float) -> Mask:
    """Return the runs of cells that an outline (k, 2) covers at some headings, the base in the middle; see `erode`."""
    placed = [outline @ rotation(float(heading)).T for heading in headings]
    reach = math.ceil(max(float(np.abs(each).max()) for each in placed) / size)
    x, y = np.meshgrid(*(size * np.arange(-reach, reach + 1),) * 2)
    covered = shapely.union_all([Polygon(each) for each in placed])
    inside = shapely.intersects_xy(covered, x.ravel(), y.ravel()).reshape(x.shape)
    edges = np.diff(np.pad(inside, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    return np.column_stack((row - reach, first - reach, np.nonzero(edges == -1)[1] - first)), reach


def _exits(grid: _Grid, bare: MotionChecker, pose: Array) -> tuple[States, list[float]]:
    """Return states where a path can leave a pose straight ahead or back, or come to it so, and what that costs [m]."""
    states: States = []
    costs: list[float] = []
    heading = float(pose[2])
    ahead = np.array([math.cos(heading), math.sin(heading)])
    off = np.abs([wrap(float(each) - heading) for each in grid.headings])
    for sign in (1.0, -1.0):
        for distance in np.arange(0.0 if sign > 0 else EXIT_STEP, EXIT_MOST + 1e-9, EXIT_STEP):
            point = pose[:2] + sign * distance * ahead
            if distance > 0.0 and bare.drive_fault(pose[:2], point, heading):
                break
            row, column = grid.cell(point)
            if not (0 <= row < grid.free.shape[1] and 0 <= column < grid.free.shape[2]):
                break
            for k in np.argsort(off, kind="stable")[:2]:
                if grid.free[k, row, column] and bare.can_swing(point, heading, heading + _way(grid, k, heading)):
                    states.append((int(k), row, column))
                    costs.append(distance * (1.0 if sign > 0 else REVERSE) + TURNING * float(off[k]))
    return states, costs


def _way(grid: _Grid, k: int, heading: float) -> float:
    return wrap(float(grid.headings[k]) - heading)


def _corners(grid: _Grid, found: NDArray[np.int64], start: Array, goal: Array) -> tuple[list[Array], list[bool]]:
    """Return the corners of a way, both poses' places included, and which legs between them are driven backwards."""
    points, backwards = [grid.place(row, column) for _, row, column in found], []
    corners: list[Array] = [points[0]]
    before: tuple[int, bool] | None = None
    for (a, b), (here, there) in zip(pairwise(found), pairwise(points), strict=True):
        if a[0] != b[0]:
            continue
        step = (int(a[0]), bool((b[1:] - a[1:]) @ grid.moves[a[0]] < 0))
        if step != before:
            if before is not None:
                corners.append(here)
            backwards.append(step[1])
            before = step
        last = there
    if before is not None:
        corners.append(last)
    first, end = _side(start, corners[0]), _side(goal, corners[-1])
    return [start[:2], *corners, goal[:2]], [not first, *backwards, end]


def _side(pose: Array, point: Array) -> bool:
    """Say whether a point lies ahead of a pose."""
    return bool((point - pose[:2]) @ np.array([math.cos(pose[2]), math.sin(pose[2])]) >= 0.0)


def _shortened(
    bare: MotionChecker, start: Array, goal: Array, corners: list[Array], backwards: list[bool]
) -> tuple[list[Array], list[bool]]:
    """Return corners with those left out that can be, one after the other, as long as all turns and legs are free.

    A leg of less than two cells, back from a pose to the middle of its cell, is no reason to drive to and fro.
    """
    points, ways = list(corners), list(backwards)
    k = 1
    while k < len(points) - 1:
        before, after = (float(np.hypot(*(b - a))) for a, b in pairwise(points[k - 1 : k + 2]))
        way = ways[k - 1] if before > after else ways[k]
        fewer, other = points[:k] + points[k + 1 :], [*ways[: k - 1], way, *ways[k + 1 :]]
        alike = ways[k - 1] == ways[k] or min(before, after) < 2.0 * CELLS[0]
        if alike and _free(bare, _path((fewer, other), start, goal)):
            points, ways, k = fewer, other, max(k - 1, 1)
        else:
            k += 1
    return points, ways


def _path(way: tuple[list[Array], list[bool]], start: Array, goal: Array) -> BasePath:
    points, backwards = way
    legs = [
        Leg(a, b, reverse)
        for (a, b), reverse in zip(pairwise(points), backwards, strict=True)
        if float(np.hypot(*(b - a))) > 1e-6
    ]
    return BasePath(start, goal, tuple(legs))


def _free(bare: MotionChecker, path: BasePath) -> bool:
    """Say whether all legs of a path, and all turns between them, are free."""
    headings = [float(path.start[2]), *(leg.heading for leg in path.legs), float(path.goal[2])]
    places = [path.start[:2], *(leg.end for leg in path.legs)]
    return all(bare.can_drive(leg.start, leg.end, reverse=leg.reverse) for leg in path.legs) and all(
        bare.can_turn(*place) or bare.can_swing(place, a, b)
        for place, (a, b) in zip(places, pairwise(headings), strict=True)
    )
