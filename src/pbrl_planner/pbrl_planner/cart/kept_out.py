"""Places that nothing may enter: in the costmaps of planner and local controller, whatever lasers see there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.costmap import LETHAL, CostField

MOST = 1 << 14
"""Cells beyond a costmap's border at which an outline is cut off: further ones are as good."""


def with_kept_out(field: CostField, places: Sequence[Array]) -> CostField:
    """Return a field in which every cell that a place touches is lethal.

    Args:
        field: in `map`.
        places: outlines (k, 2) [m].
    """
    if not places:
        return field
    touched = np.zeros(field.cells.shape, dtype=np.uint8)
    for ring in places:
        corners = np.clip(np.floor((ring - field.origin) / field.resolution), -MOST, MOST).astype(np.int32)
        cv2.fillPoly(touched, [corners.reshape(-1, 1, 2)], (1,))
    cells = field.cells.copy()
    cells[touched == 1] = LETHAL
    return replace(field, cells=cells)
