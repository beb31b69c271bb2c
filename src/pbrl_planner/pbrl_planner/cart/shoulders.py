"""Room for shoulders: a laser low over the floor sees somebody's legs, and the body above reaches further."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_planner.costmap import LETHAL, CostField, StaticMap

BEYOND = 0.10
"""[m] that a body reaches beyond its legs."""
WALL = 0.12
"""[m] from a wall of the map within which what is seen is that wall: laser and localiser are off by less."""

Mask = NDArray[np.bool_]


def with_shoulders(field: CostField, static: StaticMap | None, own: Sequence[Array] = ()) -> CostField:
    """Return a field in which everything that is not in the map is larger by what shoulders need.

    Args:
        field: in `map`.
        static: the map; None: nothing is known of walls.
        own: outlines (k, 2) of robot and cart [m]. Inside, only what is really seen stays marked: who has come that
            near is no reason not to go away.
    """
    lethal = field.cells == LETHAL
    strange = lethal.copy()
    if static is not None:
        known = static.onto(field.cells.shape, field.resolution, field.origin) == 1
        strange &= ~_dilated(known, WALL, field.resolution)
    if not strange.any():
        return field
    added = _dilated(strange, BEYOND, field.resolution) & ~lethal & ~_covered(field, own)
    cells = field.cells.copy()
    cells[added] = LETHAL
    return replace(field, cells=cells)


def _dilated(mask: Mask, by: float, resolution: float) -> Mask:
    """Return a mask grown by a distance [m] to all sides."""
    reach = math.floor(by / resolution + 1e-9)
    x, y = np.meshgrid(*[np.arange(-reach, reach + 1)] * 2)
    disc = (np.hypot(x, y) * resolution <= by + 1e-9).astype(np.uint8)
    return cv2.dilate(mask.astype(np.uint8), disc) == 1


def _covered(field: CostField, own: Sequence[Array]) -> Mask:
    """Return the cells (rows, columns) that outlines touch, and one more around."""
    found = np.zeros(field.cells.shape, dtype=np.uint8)
    for ring in own:
        corners = np.floor((ring - field.origin) / field.resolution).astype(np.int32)
        cv2.fillConvexPoly(found, cv2.convexHull(corners), (1,))
    return cv2.dilate(found, np.ones((3, 3), np.uint8)) == 1
