"""Cost that falls off from obstacles, by exact distances."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_planner.costmap.field import INSCRIBED, LETHAL, UNKNOWN
from pbrl_planner.costmap.inflation_kernel import distances, spread
from pbrl_planner.costmap.settings import InflationSettings

Mask = NDArray[np.bool_]
FAR = np.iinfo(np.int32).max
"""Squared distance where there is no obstacle at all."""


def squared_distances(lethal: Mask) -> NDArray[np.int32]:
    """Return squared distances (rows, columns) to the nearest lethal cell, between centres [cells^2]; exact.

    Meijster, Roerdink and Hesselink (2000): down and up the columns, then along the rows by lower envelopes.
    """
    found = np.full(lethal.shape, FAR, dtype=np.int32)
    if lethal.any():
        distances(np.ascontiguousarray(lethal).view(np.uint8), found)
    return found


def inflate(lethal: Mask, unknown: Mask, resolution: float, settings: InflationSettings) -> NDArray[np.uint8]:
    """Return costs (rows, columns): 254 lethal, 253 within the inscribed radius, exponentially less, 0; 255 unknown.

    An unknown cell is where a cost of 253 or more would be no less than that; what is beyond stays unknown.

    Args:
        lethal: (rows, columns) where something stands.
        unknown: the same, where nothing is known.
        resolution: of a cell [m].
        settings: see there.
    """
    cells = np.where(unknown, UNKNOWN, 0).astype(np.uint8)
    if lethal.any():
        spread(squared_distances(lethal), cost_table(resolution, settings), INSCRIBED, cells)
    return cells


def cost_table(resolution: float, settings: InflationSettings) -> NDArray[np.uint8]:
    """Return costs by squared distance [cells^2], up to the last that costs anything."""
    # The last bit of a radius that is so many cells long must not decide.
    reach = settings.radius / resolution + 1e-9
    away = np.sqrt(np.arange(math.floor(reach * reach) + 1)) * resolution
    costs = np.floor((INSCRIBED - 1) * np.exp(-settings.decay * np.maximum(away - settings.inscribed, 0.0)))
    costs[away <= settings.inscribed + 1e-9 * resolution] = INSCRIBED
    costs[0] = LETHAL
    return costs.astype(np.uint8)
