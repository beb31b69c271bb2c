"""What has stopped the base though no map shows it: remembered as an obstacle, so that the next way goes round it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import shapely
from shapely import Polygon

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.navigation.footprint import Footprint
from pbrl_control.planar import Array

GAP = 0.02  # [m] between robot and what it struck: it has to be able to set out from there
DEPTH = 0.08  # [m] of it that is remembered; how far it goes on nobody has felt
KNOWN = 0.03  # [m] from the robot, within which something known will have been it
SHAVED = 0.002  # [m] off its border
LEAST = 1e-3  # [m^2] that is worth remembering


class Struck:
    """Obstacles that nobody sees, where they were struck.

    Attributes:
        outlines: in `world`, by the names that people are told; another mapping each time one is added.
    """

    def __init__(self) -> None:
        self.outlines: Mapping[str, Polygon] = {}

    def add(self, floor: FloorMap, robot: Footprint, pose: Array, direction: float) -> str:
        """Remember what stopped the robot; return its name, or none where something known will have done so.

        Which part of the robot it touches is not known: it is taken to lie along all that goes ahead.

        Args:
            floor: what is known, with what was struck before.
            robot: that was stopped.
            pose: (3,) of `base` in `world` [m, rad].
            direction: above zero: it drove forwards, below: backwards.
        """
        heading = float(pose[2])
        ahead = math.copysign(1.0, direction) * np.array([math.cos(heading), math.sin(heading)])

        def covered(way: float) -> Polygon:
            return robot.swept(pose[:2], pose[:2] + way * ahead, heading)

        near = covered(GAP)
        if not floor.free.covers(near.buffer(KNOWN - GAP)):
            return ""
        # What is known keeps its room: a thing that may be moved must not stand in what nobody can move.
        clear = floor.free.buffer(-KNOWN)
        outline = covered(GAP + DEPTH).difference(near).intersection(clear)
        parts = shapely.get_parts(outline.buffer(-SHAVED))  # its tips touch the robot's sides
        outline = max(parts, key=shapely.area, default=Polygon())
        if outline.area < LEAST:
            return ""
        name = f"something unseen {len(self.outlines) + 1}"
        self.outlines = {**self.outlines, name: outline}
        return name

    def forget(self) -> None:
        """Forget all of it: it may be gone."""
        self.outlines = {}
