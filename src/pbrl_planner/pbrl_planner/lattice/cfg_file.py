"""SBPL's `.cfg` files: a floor of costs, speeds, start and goal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.grid import MOST_CELLS, CostGrid
from pbrl_planner.lattice.primitives import Pace
from pbrl_planner.lattice.tokens import Tokens

EIGHTH = 3.141592653589793 / 4.0  # of a turn [rad]
QUICKEST = 1e-6  # [s] for an eighth of a turn: faster is no number of turns a second


@dataclass(frozen=True)
class Environment:
    """What a `.cfg` file says.

    Attributes:
        grid: the floor.
        pace: speeds.
        headings: bins of heading.
        start: (x, y, theta) [m, rad].
        goal: likewise.
    """

    grid: CostGrid
    pace: Pace
    headings: int
    start: tuple[float, float, float]
    goal: tuple[float, float, float]


def read_environment(path: Path | str) -> Environment:
    """Read a `.cfg` file, packed with gzip if it ends in .gz.

    Raises:
        PlannerError: the file is not what it should be: file, line, what was expected and got.
    """
    return parse_environment(Tokens.of_file(Path(path)))


def parse_environment(tokens: Tokens) -> Environment:
    """Read the words of such a file.

    Raises:
        PlannerError: as `read_environment`.
    """
    tokens.key("discretization(cells)")
    columns, rows = (tokens.whole(f"discretization(cells) {axis}", 1, MOST_CELLS) for axis in "xy")
    if columns * rows > MOST_CELLS:
        raise tokens.refuse(f"at most {MOST_CELLS} cells", f"{columns} x {rows}")
    headings = 16
    if tokens.peek() == "NumThetaDirs:":
        tokens.key("NumThetaDirs")
        headings = tokens.whole("NumThetaDirs", 1, 256)
    tokens.key("obsthresh")
    lethal = tokens.whole("obsthresh", 1, 255)
    tokens.key("cost_inscribed_thresh")
    inscribed = tokens.whole("cost_inscribed_thresh", 1, 255)
    tokens.key("cost_possibly_circumscribed_thresh")
    tokens.whole("cost_possibly_circumscribed_thresh", -1, 255)
    tokens.key("cellsize(meters)")
    resolution = tokens.number("cellsize(meters)", 0.0, 100.0)
    tokens.key("nominalvel(mpersecs)")
    speed = tokens.number("nominalvel(mpersecs)", 0.0, 1e3)
    tokens.key("timetoturn45degsinplace(secs)")
    eighth = tokens.number("timetoturn45degsinplace(secs)", 0.0, 1e6)
    if eighth < QUICKEST:
        raise tokens.refuse(f"timetoturn45degsinplace(secs): {QUICKEST:g} s at least", f"{eighth:g}")
    poses = []
    for name in ("start", "end"):
        tokens.key(f"{name}(meters,rads)")
        x, y, theta = (tokens.number(f"{name}(meters,rads) {what}", -1e6, 1e6) for what in ("x", "y", "theta"))
        poses.append((x, y, theta))
    tokens.key("environment")
    cells = _cells(tokens, rows, columns)
    try:
        grid = CostGrid(cells, resolution, blocked=min(inscribed, lethal), lethal=lethal)
    except PlannerError as error:
        raise PlannerError(f"{tokens.name}: {error}") from None
    pace = Pace(speed=speed, yaw_rate=EIGHTH / eighth, articulation_rate=EIGHTH / eighth)
    for name, (x, y, _) in zip(("start", "end"), poses, strict=True):
        column, row = grid.cell_of(x, y)
        if not (0 <= column < columns and 0 <= row < rows):
            raise PlannerError(
                f"{tokens.name}: expected {name}(meters,rads) on the map of {grid.size[0]:g} x {grid.size[1]:g} m, "
                f"got ({x:g}, {y:g})"
            )
    return Environment(grid, pace, headings, poses[0], poses[1])


def _cells(tokens: Tokens, rows: int, columns: int) -> NDArray[np.uint8]:
    lines, begin = tokens.rest()
    flat: list[str] = []
    for number, line in enumerate(lines):
        words = line.split()
        if any(not (word.isascii() and word.isdigit() and len(word) <= 3 and int(word) <= 255) for word in set(words)):
            tokens.line = begin + number
            wrong = next(w for w in words if not (w.isascii() and w.isdigit() and len(w) <= 3 and int(w) <= 255))
            raise tokens.refuse("a cost from 0 to 255", repr(wrong))
        flat += words
        if len(flat) > rows * columns:
            tokens.line = begin + number
            raise tokens.refuse(f"{rows * columns} costs ({columns} x {rows})", f"{len(flat)} or more")
    if len(flat) < rows * columns:
        raise tokens.refuse(f"{rows * columns} costs ({columns} x {rows})", f"the end of the file after {len(flat)}")
    return np.array(flat, dtype=np.int64).astype(np.uint8).reshape(rows, columns)
