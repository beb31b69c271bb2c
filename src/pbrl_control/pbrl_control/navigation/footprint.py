"""What the robot covers of the floor, seen from above, in `base`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, rotation

CIRCLE_CORNERS = 32
HALF_PLATE = 0.045  # [m] half a gripper's width with what stands out beside its plates


@dataclass(frozen=True)
class Footprint:
    """A convex outline in `base`, whose origin is the middle of the axle.

    Attributes:
        outline: (k, 2) corners [m].
        radius: of the smallest circle about the axle's middle that the outline stays in while it turns [m].
    """

    outline: Array
    radius: float

    @property
    def inner_radius(self) -> float:
        """Radius of the largest circle about the axle's middle that is inside the outline [m]; 0 if none is."""
        middle, outline = shapely.Point(0.0, 0.0), Polygon(self.outline)
        return float(outline.exterior.distance(middle)) if outline.contains(middle) else 0.0

    @classmethod
    def polygon(cls, corners: Array) -> Footprint:
        """Make the footprint from corners (k, 2) [m]; hollows are filled, because sweeps are taken as convex.

        Raises:
            ControlError: the corners span no area.
        """
        points = np.asarray(corners, dtype=float)
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3 or not np.isfinite(points).all():
            raise ControlError(f"robot footprint: expected finite corners (k, 2) with k >= 3, got shape {points.shape}")
        hull = shapely.convex_hull(shapely.multipoints(points))
        if not isinstance(hull, Polygon) or hull.area < 1e-6:
            raise ControlError("robot footprint: expected corners that span an area, got points on one line")
        outline = np.array(hull.exterior.coords)[:-1]
        return cls(outline, float(np.hypot(*outline.T).max()))

    @classmethod
    def circle(cls, radius: float) -> Footprint:
        """Make the round footprint of a radius [m] about the axle's middle.

        Raises:
            ControlError: the radius is not positive.
        """
        if not (math.isfinite(radius) and radius > 0.0):
            raise ControlError(f"robot footprint: expected a positive radius, got {radius} m")
        angles = np.linspace(0.0, 2.0 * math.pi, CIRCLE_CORNERS, endpoint=False)
        around = radius / math.cos(math.pi / CIRCLE_CORNERS)  # circumscribed, so that the circle is covered
        return cls(around * np.column_stack((np.cos(angles), np.sin(angles))), radius)

    def at(self, pose: Array) -> Array:
        """Return the corners (k, 2) in `world` of the footprint with `base` at the pose (3,)."""
        return self.outline @ rotation(float(pose[2])).T + pose[:2]

    def swept(self, start: Array, end: Array, heading: float) -> Polygon:
        """Return what is covered while driving straight from start (2,) to end (2,) at one heading [rad]."""
        placed = self.outline @ rotation(heading).T
        return shapely.convex_hull(shapely.multipoints(np.vstack((placed + start, placed + end))))


def _mirrored(half: list[tuple[float, float]]) -> Array:
    points = np.array(half)
    return np.vstack((points, points * [1.0, -1.0]))


KRANG_STOWED = Footprint.polygon(
    _mirrored(
        [(0.45, 0.165), (0.235, 0.48), (0.195, 0.50), (0.075, 0.50), (-0.50, 0.305), (-0.605, 0.22), (-0.67, 0.07)]
    )
)
"""Krang sitting, waist at 2.73, both arms stowed: grippers in front, spine behind, elbows beside."""


def reaching_arms(lateral: float) -> Footprint:
    """Return what Krang's lowered arms cover in front of it, grippers at their home and `lateral` [m] off the middle.

    Only things as high as the grippers matter to it: walls and other tables, not the object in front.
    """
    front = lateral + HALF_PLATE
    return Footprint.polygon(_mirrored([(0.79, front), (0.35, max(0.50, front)), (0.0, 0.50)]))
