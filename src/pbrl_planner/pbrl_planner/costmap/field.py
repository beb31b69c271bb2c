"""What comes out of a costmap: cells of cost, and where they lie."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FREE, INSCRIBED, LETHAL, UNKNOWN = 0, 253, 254, 255
"""Costs of cells, as in ROS's navigation."""


@dataclass(frozen=True)
class CostField:
    """Costs of the cells of a window; what a controller checks its motion against, and a planner its plan.

    Attributes:
        cells: (rows, columns) uint8; row 0 is at the lowest y.
        resolution: of a cell [m].
        origin: (2,) lowest x and y of cell (0, 0), in the costmap's frame [m].
        time: of the last scan in it [s]; -inf: none.
    """

    cells: NDArray[np.uint8]
    resolution: float
    origin: tuple[float, float]
    time: float

    def cost(self, x: float, y: float) -> int:
        """Return the cost of the cell at a place [m]; `UNKNOWN` outside."""
        column = math.floor((x - self.origin[0]) / self.resolution)
        row = math.floor((y - self.origin[1]) / self.resolution)
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return int(self.cells[row, column]) if inside else UNKNOWN
