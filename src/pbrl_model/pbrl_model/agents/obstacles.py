"""What a body must not touch: polygons and walls as convex pieces, and footprints at poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_model.geometry import convex_parts

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Obstacles:
    """Convex pieces in world, padded to one shape.

    Attributes:
        corners: (O, W, 2) [m], counter-clockwise.
        counts: (O,) corners of each.
        middles: (O, 2) of circles that hold them.
        radii: (O,) [m].
    """

    corners: Array
    counts: Integers
    middles: Array
    radii: Array


def obstacles_of(pieces: Sequence[Array]) -> Obstacles:
    """Gather polygons (k, 2) or segments (2, 2) in world; what is not convex is cut into pieces."""
    convex = [part for piece in pieces for part in ([piece] if len(piece) == 2 else convex_pieces(piece))]
    corners, counts = padded(convex)
    middles = np.array([(part.min(axis=0) + part.max(axis=0)) / 2.0 for part in convex]).reshape(-1, 2)
    radii = np.array([np.hypot(*(part - middle).T).max() for part, middle in zip(convex, middles, strict=True)])
    return Obstacles(corners, counts, middles, radii)


def convex_pieces(outline: Array) -> list[Array]:
    """Return the convex pieces of an outline (k, 2), corners counter-clockwise."""
    return [piece if shapely.is_ccw(shapely.LinearRing(piece)) else piece[::-1] for piece in convex_parts(outline)]


def padded(polygons: Sequence[Array]) -> tuple[Array, Integers]:
    """Return polygons as one array (n, most corners, 2), and how many corners each has."""
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    corners = np.zeros((len(polygons), int(counts.max(initial=1)), 2))
    for row, polygon in zip(corners, polygons, strict=True):
        row[: len(polygon)] = polygon
    return corners, counts


def edges(outline: Array) -> list[Array]:
    """Return the sides of a closed outline (k, 2) as segments (2, 2)."""
    return [np.array(side) for side in zip(outline, np.roll(outline, -1, axis=0), strict=True)]


def placed(footprint: Array, pose: Array) -> Array:
    """Return a footprint (k, 2) at a pose (3,) in world."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return footprint @ np.array([[c, s], [-s, c]]) + pose[:2]
