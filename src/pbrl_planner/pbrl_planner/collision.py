"""Whether outlines that move together stay on the free floor: shapely's prepared polygons, many poses at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from pbrl_control.errors import ControlError
from pbrl_control.navigation.floor_map import FloorMap, as_polygon
from pbrl_control.planar import Array, rotation
from pbrl_planner.errors import PlannerError

TOUCH = 1e-6  # [m] that outlines may be in something: what stands exactly against a wall is not in it


class MovingOutlines:
    """Outlines in one body's frame, and the floor that they have to stay on.

    Args:
        outlines: (k, 2) corners each, by name, in the body's frame [m].
        floor: room and obstacles, the body itself left out.

    Attributes:
        corners: (c, 2) of all rings, each closed, one after the other [m].
        floor: as given.

    Raises:
        PlannerError: there is no outline, or one is no simple polygon.
    """

    def __init__(self, outlines: dict[str, Array], floor: FloorMap) -> None:
        if not outlines:
            raise PlannerError("collision: expected an outline at least, got none")
        self.floor = floor
        self._names = tuple(outlines)
        rings = [_closed(corners, name) for name, corners in outlines.items()]
        ends = np.cumsum([len(ring) for ring in rings])
        self.corners: Array = np.ascontiguousarray(np.vstack(rings))
        self._parts = [slice(int(end) - len(ring), int(end)) for ring, end in zip(rings, ends, strict=True)]
        self._free = floor.free.buffer(TOUCH, join_style="mitre")
        shapely.prepare(self._free)

    def are_free(self, placed: Array, box: Array) -> bool:
        """Say whether every outline stays on the free floor in each of several poses.

        Args:
            placed: (n, c, 2) `corners` in `world`, for each pose [m].
            box: (4,) lowest x and y, highest x and y of all those [m]: in the open it settles the question
                at a fifth of the price.
        """
        if self._free.covers(shapely.box(*box)):
            return True
        # Where something is in the way, it mostly is at the end.
        for poses in (placed[-1:], placed[:-1]):
            for part in self._parts:
                if not shapely.covers(self._free, shapely.polygons(poses[:, part])).all():
                    return False
        return True

    def valid(self, poses: Array) -> NDArray[np.bool_]:
        """Say of each pose (n, 3) of the frame in `world` [m, rad] whether every outline is on the free floor."""
        placed = np.array([self.corners @ rotation(float(pose[2])).T + pose[:2] for pose in poses])
        each = [shapely.covers(self._free, shapely.polygons(placed[:, part])) for part in self._parts]
        return np.logical_and.reduce(each)

    def fault(self, pose: Array) -> str:
        """Return which outline would be in what at a pose (3,) in `world`, in words; empty where nothing is."""
        if bool(self.valid(np.asarray(pose, dtype=float)[None])[0]):
            return ""
        for name, part in zip(self._names, self._parts, strict=True):
            outline = Polygon(self.corners[part] @ rotation(float(pose[2])).T + pose[:2])
            if not self._free.covers(outline):
                return f"{name} would be in {self.floor.fault(outline.buffer(-TOUCH)) or 'an obstacle'}"
        return ""


def _closed(corners: Sequence[Sequence[float]] | Array, name: str) -> Array:
    """Return a ring (k + 1, 2) whose last corner is its first.

    Raises:
        PlannerError: the corners make no simple polygon.
    """
    try:
        return np.array(as_polygon(np.asarray(corners, dtype=float), name).exterior.coords)
    except ControlError as error:
        raise PlannerError(str(error)) from error
