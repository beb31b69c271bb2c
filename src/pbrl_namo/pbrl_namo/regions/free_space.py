"""Free-space regions: where the middle of a disc that stands for the robot may be (thesis 6.2.1).

The free space is the room, shrunk by the disc's radius, without everything that stands in it, grown by the same radius.
Its connected components are the regions: the robot can go from anywhere to anywhere in one, and to no other. This is
exact but for the arcs about corners, which are `ARC` chords a quarter turn: they bulge 0.6 mm less than true ones at a
radius of 0.52 m.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pbrl_control.navigation.footprint import Footprint
from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.settings import MARGIN
from pbrl_namo.scene import NamoScene

Indices = NDArray[np.int64]

ARC = 16
"""Chords that a quarter of an arc about a corner is made of."""

SMALLEST = 1e-6
"""Area [m^2] of a region below which it is no region but rounding."""


@dataclass(frozen=True)
class FreeSpace:
    """Where the middle of a disc may be.

    Attributes:
        radius: of the disc [m].
        regions: connected components in `world`, largest first.
    """

    radius: float
    regions: tuple[Polygon, ...]

    def __post_init__(self) -> None:
        shapely.prepare(list(self.regions))

    @cached_property
    def bounds(self) -> Array:
        """Return the regions' boxes (n, 4): x and y from, x and y to [m]."""
        return shapely.bounds(np.array(self.regions, dtype=object)).reshape(-1, 4)

    def index(self, point: Array) -> int | None:
        """Return which region a point (2,) in `world` [m] is in, border included; None if in none."""
        x, y = float(point[0]), float(point[1])
        low_x, low_y, high_x, high_y = self.bounds.T
        near = np.flatnonzero((low_x <= x) & (x <= high_x) & (low_y <= y) & (y <= high_y))
        return next((int(i) for i in near if shapely.intersects_xy(self.regions[i], x, y)), None)

    def indices(self, points: Array) -> Indices:
        """Return which region each point (n, 2) in `world` [m] is in, as (n,); -1 where in none."""
        found = np.full(len(points), -1)
        x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
        for number, (low_x, low_y, high_x, high_y) in enumerate(self.bounds):
            near = np.flatnonzero((low_x <= x) & (x <= high_x) & (low_y <= y) & (y <= high_y) & (found < 0))
            found[near[shapely.intersects_xy(self.regions[number], x[near], y[near])]] = number
        return found


def drive_radius(robot: Footprint, margin: float = MARGIN) -> float:
    """Return the radius [m] of the disc that stands for a driving robot: half its width, and a margin [m].

    A robot that is longer than wide needs more room than that to turn on the spot; the free space does not tell where.
    """
    return float(np.abs(robot.outline[:, 1]).max()) + margin


def free_space(scene: NamoScene, radius: float | None = None, leave_out: str | Collection[str] = "") -> FreeSpace:
    """Return the free space of a scene, things where they stand.

    Args:
        scene: what is known.
        radius: of the disc [m]; None: `drive_radius` of the scene's robot.
        leave_out: a movable thing, or several, that are taken away.

    Raises:
        NamoError: the radius is not positive, or there is no movable thing of a name.
    """
    size = check_radius(drive_radius(scene.robot) if radius is None else radius)
    names = {leave_out} - {""} if isinstance(leave_out, str) else set(leave_out)
    unknown = sorted(names - set(scene.movable))
    if unknown:
        raise NamoError(f"leave out: expected one of {', '.join(scene.movable) or 'no things'}, got {unknown[0]!r}")
    things = [outline for name, outline in scene.outlines.items() if name not in names]
    blocked = shapely.union_all(grow([*scene.fixed.values(), *things], size))
    return FreeSpace(size, as_regions(shrink(scene.room, size).difference(blocked)))


def check_radius(radius: float) -> float:
    """Return the radius [m]; raise NamoError where it is not positive and finite."""
    if not (math.isfinite(radius) and radius > 0.0):
        raise NamoError(f"free space: expected a positive radius of the robot, got {radius} m")
    return radius


def grow(outlines: list[Polygon], radius: float) -> NDArray[np.object_]:
    """Return where the middle of a disc of a radius [m] touches each of some outlines: (n,) polygons."""
    return shapely.buffer(np.array(outlines, dtype=object), radius, quad_segs=ARC)


def shrink(room: BaseGeometry, radius: float) -> BaseGeometry:
    """Return where a disc of a radius [m] is inside a room."""
    return room.buffer(-radius, quad_segs=ARC)


def as_regions(area: BaseGeometry) -> tuple[Polygon, ...]:
    """Return the components of an area, largest first; of equal ones the one further left, then further down."""
    parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon) and part.area > SMALLEST]
    return tuple(sorted(parts, key=lambda part: (-part.area, *part.bounds)))
