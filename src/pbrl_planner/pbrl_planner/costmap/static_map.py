"""The map that was there before: occupancy of cells, anywhere, turned any way, of any resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array, compose, inverse
from pbrl_planner.costmap.static_kernel import sample_map
from pbrl_planner.errors import PlannerError

MOST_CELLS = 64_000_000
OCCUPIED_FROM = 65  # of 100


@dataclass(frozen=True)
class StaticMap:
    """Occupancy, as `nav_msgs/OccupancyGrid` has it.

    Attributes:
        cells: (rows, columns) whole numbers, 0 free to 100 occupied, -1 unknown; row 0 is at the lowest y.
        resolution: of a cell [m].
        origin: x, y and yaw of the corner of cell (0, 0), in `map` [m, rad]; the yaw may be left out.

    Raises:
        PlannerError: a number or shape is not what it should be.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or not 1 <= cells.size <= MOST_CELLS or not np.issubdtype(cells.dtype, np.integer):
            raise PlannerError(
                f"map: expected (rows, columns) of whole numbers, at most {MOST_CELLS}, got {cells.dtype} {cells.shape}"
            )
        if int(cells.min()) < -1 or int(cells.max()) > 100:
            raise PlannerError(f"map: expected cells from -1 to 100, got {cells.min()} to {cells.max()}")
        if not (math.isfinite(self.resolution) and 1e-4 <= self.resolution <= 100.0):
            raise PlannerError(f"map: expected a resolution from 0.0001 to 100 m, got {self.resolution}")
        origin = tuple(float(value) for value in self.origin)
        if len(origin) not in (2, 3) or not np.isfinite(origin).all():
            raise PlannerError(f"map: expected a finite origin (x, y) or (x, y, yaw), got {self.origin}")
        object.__setattr__(self, "cells", np.ascontiguousarray(cells, dtype=np.int8))
        object.__setattr__(self, "origin", (*origin, 0.0)[:3])

    def onto(
        self, shape: tuple[int, int], resolution: float, origin: tuple[float, float], map_pose: Array | None = None
    ) -> NDArray[np.int8]:
        """Return the map as another grid sees it: 1 occupied, 0 free, -1 unknown, (rows, columns).

        A cell is looked at in so many places that no occupied cell of the map falls between them; it is occupied if
        one of them is, else unknown if one is.

        Args:
            shape: rows and columns of the other grid.
            resolution: of it [m].
            origin: its corner, in its frame [m].
            map_pose: (3,) of `map` in that frame; None: it is that frame.
        """
        corner = np.array(self.origin)
        placed = corner if map_pose is None else compose(np.asarray(map_pose, dtype=float), corner)
        x, y, yaw = inverse(placed)
        samples = math.ceil(resolution * math.sqrt(2.0) / self.resolution)
        found = np.empty(shape, dtype=np.int8)
        sample_map(self.cells, self.resolution, OCCUPIED_FROM, resolution, *origin, x, y, yaw, min(samples, 200), found)
        return found
