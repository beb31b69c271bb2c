"""Ways from one point of a polygon to others, by its triangulation: what sampling is bad at."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.borders import shared_borders

ON_POLYGON = 1e-6
"""Distance [m] up to which a point counts as in a polygon."""


def ways_through(polygon: shapely.Polygon, start: Array, ends: Array) -> list[Array]:
    """Return short ways in a polygon from one of its points to others.

    Triangles are convex, so the straight lines between the middles of the sides by which a chain of triangles is gone
    through stay in the polygon, however narrow it is. Corners that are not needed are left out.

    Args:
        polygon: may have holes.
        start: (2,) in it [m].
        ends: (n, 2) in it [m].

    Returns:
        For each end the corners (k, 2) of the way, start and end among them [m].

    Raises:
        NamoError: a point is not in the polygon.
    """
    triangles = np.array(shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)))
    tree = shapely.STRtree(triangles)
    (_, found), away = tree.query_nearest(shapely.points([start, *ends]), return_distance=True, all_matches=False)
    if away.max() > ON_POLYGON:
        off = int(np.argmax(away))
        raise NamoError(f"way: expected points of the polygon, got {[start, *ends][off]}, {away[off]:.3f} m off it")
    pairs, sides = shared_borders(triangles)
    middles = (sides[:, :2] + sides[:, 2:]) / 2.0
    centres = shapely.get_coordinates(shapely.centroid(triangles))
    lengths = sum(np.hypot(*(middles - centres[pairs[:, side]]).T) for side in (0, 1)) + 1e-9
    graph = coo_matrix((lengths, tuple(pairs.T)), shape=(len(triangles), len(triangles)))
    _, before = dijkstra(graph.tocsr(), directed=False, indices=int(found[0]), return_predecessors=True)
    side_of = {(int(a), int(b)): row for row, (a, b) in enumerate(pairs)}
    ways: list[Array] = []
    for end, triangle in zip(ends, found[1:], strict=True):
        corners, here = [end], int(triangle)
        while here != found[0]:
            past = int(before[here])
            if past < 0:
                raise NamoError(f"way: expected one polygon, got triangles that do not connect {start} and {end}")
            corners.append(middles[side_of.get((past, here), side_of.get((here, past), -1))])
            here = past
        ways.append(_shorter(polygon, np.array([*corners, start])[::-1]))
    return ways


def _shorter(polygon: shapely.Polygon, corners: Array) -> Array:
    """Return a way (k, 2) without the corners between which can be gone straight, the furthest first."""
    kept = [0]
    while kept[-1] < len(corners) - 1:
        onward = np.arange(kept[-1] + 1, len(corners))
        straight = np.stack((np.broadcast_to(corners[kept[-1]], (len(onward), 2)), corners[onward]), axis=1)
        free = np.flatnonzero(shapely.covers(polygon, shapely.linestrings(straight)))
        kept.append(int(onward[free[-1]]) if len(free) else int(onward[0]))
    return corners[kept]
