"""Where a body of the catalogue stands before anything has moved."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from bullet_sim.catalogue import Block, Fixture, OfficeTable, PlainTable, UtilityCart


def placed_footprint(body: OfficeTable | UtilityCart | PlainTable | Block | Fixture) -> Polygon:
    """Give a body's footprint at its starting pose in `world`."""
    x, y, theta = body.pose
    cos, sin = np.cos(theta), np.sin(theta)
    return Polygon(body.footprint @ np.array([[cos, sin], [-sin, cos]]) + [x, y])
