"""What is known of a room among whose furniture the robot has to find a way: geometry, never physics."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pbrl_control.navigation.floor_map import FloorMap, as_polygon
from pbrl_control.navigation.footprint import KRANG_STOWED, Footprint
from pbrl_control.planar import Array, placed
from pbrl_namo.errors import NamoError


@dataclass(frozen=True)
class Movable:
    """A thing that may be moved, as far as can be seen.

    Attributes:
        footprint: (k, 2) outline in its own frame [m].
        height: of its top above the floor [m].
        mass: what a person would guess [kg]; NaN where nobody says.
    """

    footprint: Array
    height: float = 0.75
    mass: float = math.nan

    def at(self, pose: Array) -> Polygon:
        """Return the outline in `world` with its frame at a pose (3,) [m, rad]."""
        return Polygon(placed(self.footprint, pose))


@dataclass(frozen=True)
class NamoScene:
    """A room, what stands in it, where the robot is and where it is to go.

    Attributes:
        room: free floor's outline, in `world`.
        fixed: what cannot be moved, by name, in `world`.
        movable: what may be moved, by name.
        poses: (3,) of each of those in `world` [m, rad].
        start: (3,) where the base is [m, rad].
        goal: (3,) where the base is to be; a heading of NaN: any [m, rad].
        robot: what the base covers while it drives, arms stowed.
    """

    room: Polygon
    fixed: Mapping[str, Polygon]
    movable: Mapping[str, Movable]
    poses: Mapping[str, Array]
    start: Array
    goal: Array
    robot: Footprint = KRANG_STOWED

    @classmethod
    def of(
        cls,
        room: Array,
        fixed: Mapping[str, Array],
        movable: Mapping[str, Movable],
        poses: Mapping[str, Array],
        start: Array,
        goal: Array,
        robot: Footprint = KRANG_STOWED,
    ) -> Self:
        """Make a scene from corner arrays (k, 2) in `world` [m], and check it.

        Raises:
            NamoError: a pose is missing or not finite, or a name is used twice.
            ControlError: an outline is no simple polygon.
        """
        polygons = {name: as_polygon(corners, name) for name, corners in fixed.items()}
        for name, thing in movable.items():
            as_polygon(thing.footprint, name)
        finite = {name: _pose(poses.get(name), f"pose of {name!r}") for name in movable}
        doubled = set(polygons) & set(movable)
        if doubled:
            raise NamoError(f"scene: expected one thing a name, got {sorted(doubled)[0]!r} as fixed and as movable")
        end = np.asarray(goal, dtype=float)
        if end.shape != (3,) or not np.isfinite(end[:2]).all() or math.isinf(end[2]):
            raise NamoError(f"goal: expected (x, y, theta) with finite x and y, theta may be NaN, got {goal}")
        return cls(as_polygon(room, "room"), polygons, dict(movable), finite, _pose(start, "start"), end, robot)

    def outline(self, name: str) -> Polygon:
        """Return the outline of a movable thing in `world`."""
        return self.movable[name].at(self.poses[name])

    @cached_property
    def outlines(self) -> Mapping[str, Polygon]:
        """Return the outlines of all movable things in `world`, by name."""
        return {name: self.outline(name) for name in self.movable}

    @cached_property
    def walls(self) -> BaseGeometry:
        """Return the floor that nothing fixed covers."""
        return self.room.difference(shapely.union_all(list(self.fixed.values())))

    def floor(self, leave_out: str = "") -> FloorMap:
        """Return the map for navigation and grasping, with everything in it as it stands, less one thing."""
        things = {name: outline for name, outline in self.outlines.items() if name != leave_out}
        return FloorMap(self.room, {**self.fixed, **things})

    def without(self, names: Collection[str]) -> NamoScene:
        """Return the scene with some movable things gone; what is none of them changes nothing."""
        left = {name: thing for name, thing in self.movable.items() if name not in names}
        return replace(self, movable=left, poses={name: self.poses[name] for name in left})

    def moved(self, poses: Mapping[str, Array], start: Array | None = None) -> NamoScene:
        """Return the scene with some things, or the robot, elsewhere.

        Raises:
            NamoError: there is no thing of a name, or a pose is not finite.
        """
        for name in poses:
            if name not in self.movable:
                raise NamoError(f"scene: expected one of {', '.join(self.movable) or 'no things'}, got {name!r}")
        where = {**self.poses, **{name: _pose(pose, f"pose of {name!r}") for name, pose in poses.items()}}
        return replace(self, poses=where, start=self.start if start is None else _pose(start, "start"))


def _pose(pose: Array | None, what: str) -> Array:
    """Return a pose (3,) that is finite.

    Raises:
        NamoError: it is not.
    """
    found = np.asarray(np.full(3, np.nan) if pose is None else pose, dtype=float)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise NamoError(f"{what}: expected a finite (x, y, theta), got {pose}")
    return found
