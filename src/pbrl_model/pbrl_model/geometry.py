"""Footprints: polygons seen from above, and what uniform density makes of them (thesis section 5.3.1).

Points are (k, 2) [m] in the body's frame. Every function refuses outlines that are not simple polygons.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.validation import explain_validity

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

MIN_AREA = 1e-6  # [m^2] a square millimetre: less is a line or a slip of units


@dataclass(frozen=True)
class MassProperties:
    """What the footprint says of a body of uniform density.

    Attributes:
        area: [m^2].
        com: (2,) centre of mass in the body's frame [m].
        inertia_per_mass: moment of inertia about the centre of mass over the mass [m^2].
    """

    area: float
    com: Array
    inertia_per_mass: float


def check_polygon(points: ArrayLike) -> Array:
    """Return the outline counter-clockwise and without a repeated last point.

    Raises:
        ModelError: fewer than three corners, a value that is not finite, no area, or edges that cross.
    """
    outline = np.array(points, dtype=float)
    if outline.ndim != 2 or outline.shape[1] != 2 or outline.shape[0] < 3:
        raise ModelError(f"footprint: expected (k, 2) corners with k >= 3, got shape {outline.shape}")
    if not np.isfinite(outline).all():
        raise ModelError(f"footprint: expected finite corners, got {outline[~np.isfinite(outline).all(axis=1)][0]}")
    if np.array_equal(outline[0], outline[-1]):
        outline = outline[:-1]
    polygon = shapely.Polygon(outline) if len(outline) >= 3 else shapely.Polygon()
    if not polygon.is_valid:
        raise ModelError(f"footprint: expected edges that do not cross, got {explain_validity(polygon)}")
    if not polygon.area > MIN_AREA:
        raise ModelError(f"footprint: expected an area above {MIN_AREA:g} m^2, got {polygon.area:g} m^2")
    return outline if shapely.is_ccw(polygon.exterior) else outline[::-1].copy()


def mass_properties(points: ArrayLike) -> MassProperties:
    """Compute area, centroid and moment of inertia of a footprint of uniform density.

    With the cross products c_i = p_i x p_i+1 of the edges: area = sum c / 2, centroid =
    sum c (p_i + p_i+1) / (6 area), and the polar second moment = sum c (p_i.p_i + p_i.p_i+1 + p_i+1.p_i+1) / 12.
    """
    outline = check_polygon(points)
    middle = outline.mean(axis=0)  # the sums cancel less near the origin
    here = outline - middle
    there = np.roll(here, -1, axis=0)
    cross = here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]
    area = 0.5 * float(cross.sum())
    centroid = (cross[:, None] * (here + there)).sum(axis=0) / (6.0 * area)
    squares = (here * here + here * there + there * there).sum(axis=1)
    about_middle = float((cross * squares).sum()) / (12.0 * area)
    return MassProperties(area, middle + centroid, about_middle - float(centroid @ centroid))


def bounding_box(points: ArrayLike) -> tuple[Array, Array]:
    """Return the lower and the upper corner (2,), (2,) of the footprint's bounding box."""
    outline = check_polygon(points)
    return outline.min(axis=0), outline.max(axis=0)


def convex_parts(points: ArrayLike) -> list[Array]:
    """Cut a footprint into convex pieces: itself where it is convex, else triangles."""
    outline = check_polygon(points)
    edge = np.roll(outline, -1, axis=0) - outline
    following = np.roll(edge, -1, axis=0)
    if np.all(edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0] >= 0.0):
        return [outline]
    triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(outline))
    return [np.asarray(triangle.exterior.coords)[:-1] for triangle in triangles.geoms]
