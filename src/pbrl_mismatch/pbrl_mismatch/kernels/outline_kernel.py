"""Compiled: distances to a footprint."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(**LEAF)
def nearest_edge(outline: Array, bx: float, by: float) -> tuple[float, float, float, float, float]:
    """Return the signed distance of a point to a counter-clockwise polygon, the nearest point, and the normal there.

    The normal points from the polygon to the outside.
    """
    best, px, py, nx, ny, inside = math.inf, 0.0, 0.0, 0.0, 0.0, False
    corners = outline.shape[0]
    for i in range(corners):
        ax, ay = outline[i, 0], outline[i, 1]
        ex, ey = outline[(i + 1) % corners, 0] - ax, outline[(i + 1) % corners, 1] - ay
        share = ((bx - ax) * ex + (by - ay) * ey) / (ex * ex + ey * ey)
        share = min(max(share, 0.0), 1.0)
        qx, qy = ax + share * ex, ay + share * ey
        distance = math.sqrt((bx - qx) ** 2 + (by - qy) ** 2)
        if distance < best:
            best, px, py = distance, qx, qy
            length = math.sqrt(ex * ex + ey * ey)
            nx, ny = ey / length, -ex / length
        if (ay > by) != (ay + ey > by) and bx < ax + (by - ay) / ey * ex:
            inside = not inside
    if not inside and best > 1e-9:
        nx, ny = (bx - px) / best, (by - py) / best
    return (-best if inside else best), px, py, nx, ny


@njit(**LEAF)
def disc_contact(
    outline: Array, state: Array, c: float, s: float, com: Array, qx: float, qy: float, radius: float
) -> tuple[float, float, float, float, float]:
    """Return depth of a disc at (qx, qy) in the footprint, lever of the contact and its outward normal, world axes."""
    dx, dy = qx - state[0], qy - state[1]
    gap, px, py, nx, ny = nearest_edge(outline, c * dx + s * dy + com[0], -s * dx + c * dy + com[1])
    px, py = px - com[0], py - com[1]
    return radius - gap, c * px - s * py, s * px + c * py, c * nx - s * ny, s * nx + c * ny
