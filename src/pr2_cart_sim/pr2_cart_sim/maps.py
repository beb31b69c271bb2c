"""Grid maps as ROS's map server reads and writes them, and the walls in them as few boxes."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import Field

from bullet_sim.settings import Positive, Settings, read_settings
from pr2_cart_sim.bare_png import PNG, bare_png
from pr2_cart_sim.errors import Pr2Error

Array = NDArray[np.float64]
Cells = NDArray[np.int8]

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""Values of cells, as `nav_msgs/OccupancyGrid` has them."""

LARGEST = 20_000_000
"""Cells in a map at most."""
HEAD = 4096
"""[bytes] in which a PGM says how large it is."""


@dataclass(frozen=True)
class GridMap:
    """A map.

    Attributes:
        resolution: side of a cell [m].
        origin: (2,) [m] lower left corner of cell (0, 0) in `map`.
        cells: (rows, columns), `FREE`, `OCCUPIED` or `UNKNOWN`; row 0 is the lowest y.
    """

    resolution: float
    origin: tuple[float, float]
    cells: Cells

    @property
    def outline(self) -> Array:
        """Corners (4, 2) [m] of the whole map, counter-clockwise."""
        rows, columns = self.cells.shape
        x, y = self.origin
        right, top = x + columns * self.resolution, y + rows * self.resolution
        return np.array([[x, y], [right, y], [right, top], [x, top]])

    def value(self, x: float, y: float) -> int:
        """Give the value of the cell at a place [m]; `UNKNOWN` outside."""
        row = math.floor((y - self.origin[1]) / self.resolution)
        column = math.floor((x - self.origin[0]) / self.resolution)
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return int(self.cells[row, column]) if inside else UNKNOWN

    def boxes(self) -> Array:
        """Give what is occupied as rectangles (n, 4) [m]: left, bottom, right, top, in `map`.

        They cover the occupied cells exactly, and do not overlap.
        """
        runs = _merged_runs(self.cells == OCCUPIED)
        corner = np.array([*self.origin, *self.origin])
        return corner + self.resolution * np.array(runs, dtype=float).reshape(-1, 4)


def _merged_runs(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Cover a mask with rectangles (left, bottom, right, top): runs along rows, those alike in next rows put together.

    Of rows first and columns first, what needs fewer is taken.
    """
    rows = _cover(occupied)
    columns = [(left, bottom, right, top) for bottom, left, top, right in _cover(occupied.T)]
    return rows if len(rows) <= len(columns) else columns


def _cover(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    done: list[tuple[int, int, int, int]] = []
    growing: dict[tuple[int, int], int] = {}  # (left, right) of a run to the row in which it began
    for row in range(len(occupied) + 1):
        runs: set[tuple[int, int]] = set()
        if row < len(occupied):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], occupied[row].astype(np.int8), [0]])))
            runs = set(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        for left, right in [run for run in growing if run not in runs]:
            done.append((left, growing.pop((left, right)), right, row))
        for run in sorted(runs - growing.keys()):
            growing[run] = row
    return done


class MapFile(Settings):
    """What a map's YAML file says; the words are those of ROS's map server."""

    image: str
    resolution: Positive
    origin: tuple[float, float, float]
    negate: Annotated[int, Field(ge=0, le=1)] = 0
    occupied_thresh: Annotated[float, Field(ge=0, le=1)] = 0.65
    free_thresh: Annotated[float, Field(ge=0, le=1)] = 0.196
    mode: str = "trinary"


def load_map(path: Path) -> GridMap:
    """Read a map.

    Args:
        path: its YAML file; the image is beside it or where it says.

    Raises:
        SimError: a file that cannot be read, or a map that is turned or not of mode `trinary`.
    """
    said = read_settings(path, MapFile)
    if said.mode != "trinary":
        raise Pr2Error(f"{path}: mode: expected trinary, got {said.mode!r}; write the map again in that mode")
    if said.origin[2] != 0:
        raise Pr2Error(f"{path}: origin: expected a yaw of 0, got {said.origin[2]}; turn the image instead")
    image = _picture(path, said.image)
    dark = image[::-1] / 255.0 if said.negate else 1.0 - image[::-1] / 255.0
    cells = np.full(image.shape, UNKNOWN, np.int8)
    cells[dark < said.free_thresh] = FREE
    cells[dark > said.occupied_thresh] = OCCUPIED
    return GridMap(said.resolution, said.origin[:2], cells)


def _picture(path: Path, name: str) -> NDArray[np.uint8]:
    """Return the grey levels of a map's image."""
    file = path.parent / name
    try:
        data = file.read_bytes() if file.is_file() and file.stat().st_size <= 4 * LARGEST else b""
    except (OSError, ValueError):
        data = b""
    width, height = _size(data[:HEAD])
    if width * height > LARGEST:
        raise Pr2Error(f"{file}: expected at most {LARGEST} cells, got {width} x {height}; use a coarser map")
    try:
        data = bare_png(data) if data.startswith(PNG) else data
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if width and height else None
    except (cv2.error, ValueError):
        image = None
    if image is None or image.shape != (height, width):
        raise Pr2Error(f"{path}: image: expected a picture, a whole PGM or PNG, got {name[:60]!r}; give its path")
    return np.asarray(image, dtype=np.uint8)


def _size(head: bytes) -> tuple[int, int]:
    """Return the width and height that a PNG or PGM says it has, before anything is unpacked; 0, 0: it is neither."""
    if head.startswith(PNG) and len(head) >= 24:
        return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
    words = re.sub(rb"#[^\n]*", b" ", head[2:]).split()
    if head[:2] in (b"P2", b"P5") and len(words) >= 2 and all(word.isdigit() and len(word) < 10 for word in words[:2]):
        return int(words[0]), int(words[1])
    return 0, 0


def save_map(grid: GridMap, path: Path) -> None:
    """Write a map as a YAML file and, beside it, a PNG image of the same name.

    Args:
        grid: the map.
        path: of the YAML file.

    Raises:
        Pr2Error: the image cannot be written.
    """
    grey = np.full(grid.cells.shape, 205, np.uint8)
    grey[grid.cells == FREE] = 254
    grey[grid.cells == OCCUPIED] = 0
    image = path.with_suffix(".png")
    if not cv2.imwrite(str(image), grey[::-1]):
        raise Pr2Error(f"{image}: expected to write the map's image there, could not; check the folder")
    said = {
        "image": image.name,
        "mode": "trinary",
        "resolution": grid.resolution,
        "origin": [*grid.origin, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,  # just below what 205 is
    }
    path.write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")
