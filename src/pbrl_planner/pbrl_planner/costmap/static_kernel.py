"""Compiled: a grid looked at through the cells of another."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Cells = NDArray[np.int8]


@njit(**LEAF)
def sample_map(
    cells: Cells,
    cell: float,
    occupied_from: int,
    resolution: float,
    left: float,
    bottom: float,
    x: float,
    y: float,
    yaw: float,
    samples: int,
    found: Cells,
) -> None:
    """Write what each cell of a grid sees of a map.

    Args:
        cells: (rows, columns) of the map, -1 to 100.
        cell: its resolution [m].
        occupied_from: value from which a cell of it is occupied.
        resolution: of the grid [m].
        left: lowest x of the grid, in its frame [m].
        bottom: lowest y of it [m].
        x: of the grid's frame, in the axes of the map's corner [m].
        y: the same [m].
        yaw: the same [rad].
        samples: along each side of a cell of the grid.
        found: (rows, columns) of the grid, out: 1 occupied, 0 free, -1 unknown.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    rows, columns = cells.shape
    spacing = resolution / samples
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            seen = 0
            for k in range(samples * samples):
                px = left + j * resolution + (k % samples + 0.5) * spacing
                py = bottom + i * resolution + (k // samples + 0.5) * spacing
                mx = math.floor((x + c * px - s * py) / cell)
                my = math.floor((y + s * px + c * py) / cell)
                if not (0 <= mx < columns and 0 <= my < rows) or cells[my, mx] < 0:
                    seen = -1
                elif cells[my, mx] >= occupied_from:
                    seen = 1
                    break
            found[i, j] = seen
