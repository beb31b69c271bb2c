"""The floor as the lattice sees it: square cells, each with a cost from 0 to what is not to be entered."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_planner.errors import PlannerError

MOST_CELLS = 64_000_000
FINEST = 1e-6
"""Side of a cell at least [m]: places are counted in cells."""
LETHAL = 254
"""Cost of a cell with something in it, as in ROS and SBPL."""
DEAREST = 252
"""Cost of a free cell at most."""


@dataclass(frozen=True)
class CostGrid:
    """Costs of cells.

    Attributes:
        cells: (rows, columns) uint8; row 0 is at the lowest y.
        resolution: of a cell [m].
        origin: (2,) corner of cell (0, 0) with the lowest x and y, in `world` [m].
        blocked: cost from which the robot's centre is not to enter a cell.
        lethal: cost from which something stands in a cell, so that no body may touch it.

    Raises:
        PlannerError: a size or number is not what it should be.
    """

    cells: NDArray[np.uint8]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)
    blocked: int = 253
    lethal: int = LETHAL

    def __post_init__(self) -> None:
        cells = np.ascontiguousarray(self.cells)
        if cells.dtype != np.uint8 or cells.ndim != 2 or not 1 <= cells.size <= MOST_CELLS:
            raise PlannerError(
                f"map: expected (rows, columns) of uint8, at most {MOST_CELLS} cells, got {cells.dtype} {cells.shape}"
            )
        if not FINEST <= self.resolution < math.inf:
            raise PlannerError(f"map: expected a resolution of {FINEST:g} m at least, got {self.resolution} m")
        if not (len(self.origin) == 2 and np.isfinite(self.origin).all()):
            raise PlannerError(f"map: expected a finite origin (x, y), got {self.origin}")
        if not 1 <= self.blocked <= 255 or not 1 <= self.lethal <= 255:
            raise PlannerError(f"map: expected thresholds from 1 to 255, got {self.blocked} and {self.lethal}")
        object.__setattr__(self, "cells", cells)

    @property
    def size(self) -> tuple[float, float]:
        """Along x and y [m]."""
        rows, columns = self.cells.shape
        return columns * self.resolution, rows * self.resolution

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Return the column and row of a point in `world` [m], which may lie outside."""
        # What lies on a border but for rounding belongs to the upper cell, as everything on a border does.
        return (
            math.floor((x - self.origin[0]) / self.resolution + 1e-9),
            math.floor((y - self.origin[1]) / self.resolution + 1e-9),
        )

    def centre_of(self, column: int, row: int) -> tuple[float, float]:
        """Return the centre of a cell in `world` [m]."""
        return self.origin[0] + (column + 0.5) * self.resolution, self.origin[1] + (row + 0.5) * self.resolution

    @classmethod
    def of_occupied(
        cls,
        occupied: NDArray[np.bool_],
        resolution: float,
        origin: tuple[float, float] = (0.0, 0.0),
        *,
        near: float = 0.0,
        nearest: int = 20,
    ) -> Self:
        """Make a grid whose cost falls from what stands there to nothing (thesis 4.5.3: edges near it cost more).

        Args:
            occupied: (rows, columns) where something stands.
            resolution: [m].
            origin: as the grid's.
            near: distance from obstacles at which their cost ends [m]; 0: only what is occupied costs.
            nearest: cost right beside them, 0 to 252; it falls linearly.

        Raises:
            PlannerError: a number is out of its range.
        """
        if not (math.isfinite(near) and near >= 0.0 and 0 <= nearest <= DEAREST):
            raise PlannerError(f"map: expected near >= 0 and nearest from 0 to {DEAREST}, got {near} and {nearest}")
        taken = np.asarray(occupied, dtype=bool)
        cells = np.zeros(taken.shape, dtype=np.uint8)
        if near > 0.0 and taken.any():
            far = distance_transform_edt(~taken) * resolution
            cells = np.round(nearest * np.clip(1.0 - far / near, 0.0, 1.0)).astype(np.uint8)
        cells[taken] = LETHAL
        return cls(cells, resolution, origin)

    @classmethod
    def of_floor(cls, floor: FloorMap, resolution: float, *, near: float = 0.0, nearest: int = 20) -> Self:
        """Make a grid of polygons: a cell is occupied where it is not all free floor.

        Raises:
            PlannerError: as `of_occupied`, or there would be too many cells.
        """
        low_x, low_y, high_x, high_y = floor.room.bounds
        columns, rows = (math.ceil(span / resolution - 1e-6) for span in (high_x - low_x, high_y - low_y))
        if not 1 <= columns * rows <= MOST_CELLS:
            raise PlannerError(f"map: expected at most {MOST_CELLS} cells, got {columns} by {rows}; take larger ones")
        x, y = np.meshgrid(low_x + np.arange(columns) * resolution, low_y + np.arange(rows) * resolution)
        slack = 1e-6 * resolution
        boxes = shapely.box(x + slack, y + slack, x + resolution - slack, y + resolution - slack)
        free = shapely.covers(floor.free, boxes)
        return cls.of_occupied(~free, resolution, (low_x, low_y), near=near, nearest=nearest)

    def resampled(self, resolution: float) -> CostGrid:
        """Return the same floor in cells of another size: a new cell costs what the dearest old one in it does.

        Raises:
            PlannerError: there would be too many cells.
        """
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise PlannerError(f"map: expected a resolution above zero, got {resolution}")
        ratio = resolution / self.resolution
        rows, columns = (math.ceil(count / ratio - 1e-6) for count in self.cells.shape)
        if not 1 <= rows * columns <= MOST_CELLS:
            raise PlannerError(f"map: expected at most {MOST_CELLS} cells, got {columns} by {rows}; take larger ones")
        found = self.cells
        for axis, count in enumerate((rows, columns)):
            begin = np.floor(np.arange(count) * ratio + 1e-6).astype(int)
            end = np.minimum(np.ceil((np.arange(count) + 1) * ratio - 1e-6).astype(int), found.shape[axis])
            bounds = np.stack((begin, np.maximum(end, begin + 1)), axis=1)
            parts = [np.take(found, range(a, b), axis=axis).max(axis=axis) for a, b in bounds]
            found = np.stack(parts, axis=axis)
        return CostGrid(found, resolution, self.origin, self.blocked, self.lethal)
