"""The floor that is known: the room and what stands in it, as polygons in `world`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pbrl_control.errors import ControlError
from pbrl_control.percept import BodyShape
from pbrl_control.planar import Array, rotation

BEYOND = 5.0  # [m] of free floor around everything known, where no room is given


@dataclass(frozen=True)
class FloorMap:
    """Free floor and obstacles.

    Attributes:
        room: where the base may be at all.
        obstacles: by name, in `world`.
        free: the room without the obstacles, prepared for many questions.
    """

    room: Polygon
    obstacles: Mapping[str, Polygon]
    free: BaseGeometry = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        free = self.room.difference(shapely.union_all(list(self.obstacles.values())))
        shapely.prepare(free)
        object.__setattr__(self, "free", free)

    @classmethod
    def of(cls, room: Array | None, obstacles: Mapping[str, Array]) -> FloorMap:
        """Make a map from corner arrays (k, 2) in `world` [m]; without a room the floor reaches 5 m past everything.

        Raises:
            ControlError: an outline is no simple polygon.
        """
        polygons = {name: as_polygon(corners, name) for name, corners in obstacles.items()}
        if room is not None:
            return cls(as_polygon(room, "room"), polygons)
        bounds = shapely.total_bounds(list(polygons.values())) if polygons else np.zeros(4)
        return cls(shapely.box(*(bounds + BEYOND * np.array([-1.0, -1.0, 1.0, 1.0]))), polygons)

    @classmethod
    def of_scene(
        cls, room: Array | None, bodies: Mapping[str, BodyShape], poses: Mapping[str, Array], leave_out: str = ""
    ) -> FloorMap:
        """Make a map from the known bodies and where they are seen now: poses (3,) in `world` by name.

        Args:
            room: corners (k, 2) of the free floor, or None.
            bodies: geometry by name.
            poses: by name; every body needs one.
            leave_out: a body that is no obstacle, for instance because it is held.

        Raises:
            ControlError: a body has no pose, or the pose is not finite.
        """
        placed = {}
        for name, shape in bodies.items():
            pose = np.asarray(poses.get(name, np.full(3, np.nan)), dtype=float)
            if name == leave_out:
                continue
            if pose.shape != (3,) or not np.isfinite(pose).all():
                raise ControlError(f"map: expected a finite pose (x, y, theta) of {name!r}, got {poses.get(name)}")
            placed[name] = np.asarray(shape.footprint) @ rotation(float(pose[2])).T + pose[:2]
        return cls.of(room, placed)

    def fault(self, covered: BaseGeometry) -> str:
        """Return what is in the way of what the robot covers, in words; empty where nothing is."""
        if self.free.covers(covered):
            return ""
        if not self.room.covers(covered):
            return "the walls" if self.room.intersects(covered) else "the border: it lies outside the map"
        return next((repr(name) for name, thing in self.obstacles.items() if thing.intersects(covered)), "an obstacle")


def as_polygon(corners: Array, name: str) -> Polygon:
    """Return the polygon of corners (k, 2) [m].

    Raises:
        ControlError: they make no simple polygon.
    """
    points = np.asarray(corners, dtype=float)
    shaped = points.ndim == 2 and points.shape[1:] == (2,) and len(points) >= 3
    if not shaped or not np.isfinite(points).all():
        raise ControlError(f"outline of {name!r}: expected finite corners (k, 2) with k >= 3, got shape {points.shape}")
    polygon = Polygon(points)
    if not polygon.is_valid or polygon.area <= 0.0:
        raise ControlError(f"outline of {name!r}: expected a simple polygon with an area; order its corners")
    return polygon
