"""Which polygons of a subdivision share a piece of border, and which piece."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.planar import Array


def shared_borders(faces: Sequence[shapely.Polygon] | NDArray[np.object_]) -> tuple[NDArray[np.int64], Array]:
    """Find the segments that two faces have in common.

    Faces that were cut out of the same lines, or triangulated from one polygon, have the very same numbers for their
    common corners, so a segment is found again bit by bit and no tolerance is needed.

    Returns:
        Pairs of faces (m, 2), and the segment that each pair shares as (m, 4): x, y of one end, then of the other [m].
    """
    rings, ring_face = shapely.get_rings(faces, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[:-1] == ring[1:]
    first, last, face = points[:-1][same], points[1:][same], ring_face[ring[:-1][same]]
    swap = (first[:, 0] > last[:, 0]) | ((first[:, 0] == last[:, 0]) & (first[:, 1] > last[:, 1]))
    segments = np.where(swap[:, None], np.hstack((last, first)), np.hstack((first, last)))
    order = np.lexsort(segments.T)
    segments, face = segments[order], face[order]
    twins = np.flatnonzero((segments[:-1] == segments[1:]).all(axis=1) & (face[:-1] != face[1:]))
    return np.column_stack((face[twins], face[twins + 1])), segments[twins]
