"""Compiled: which outlines of a body, put somewhere, come too near to anything."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_namo.manipulation.plane_kernel import box_gap, place, separation

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]


@njit(cache=True, error_model="numpy")
def nearer_than(
    pose: Array,
    hulls: Array,
    hull_starts: Indices,
    circles: Array,
    asked: Flags,
    clearances: Array,
    points: Array,
    starts: Indices,
    boxes: Array,
    met: Flags,
) -> None:
    """Say which convex outlines of a body come nearer to a piece than they may.

    Args:
        pose: (3,) of the body in `world`.
        hulls: (k, 2) corners of the outlines, in its frame.
        hull_starts: (h + 1,) where each begins.
        circles: (h, 3) middle and radius of a circle around each.
        asked: (h,) which are asked about.
        clearances: (h,) that each keeps [m]; nearer than zero is an overlap.
        points: (n, 2) corners of the pieces.
        starts: (m + 1,) where each begins.
        boxes: (m, 4) around each.
        met: (h,) out.
    """
    placed, circle, middle = np.empty_like(hulls), np.empty((1, 2)), np.empty((1, 2))
    for h in range(hull_starts.shape[0] - 1):
        met[h] = False
        if not asked[h]:
            continue
        low, high = hull_starts[h], hull_starts[h + 1]
        circle[0, 0], circle[0, 1] = circles[h, 0], circles[h, 1]
        place(circle, pose, middle)
        place(hulls[low:high], pose, placed[low:high])
        for m in range(boxes.shape[0]):
            near = box_gap(middle[0, 0], middle[0, 1], boxes[m]) < circles[h, 2] + clearances[h]
            if near and separation(placed, low, high, points, starts[m], starts[m + 1]) < clearances[h]:
                met[h] = True
                break
