"""Compiled plane geometry: convex outlines that come near each other, screw motions, crossings of polylines.

An outline is a range of rows of a flat array (n, 2), counter-clockwise and convex. Two corners are a wall: a segment.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

STRAIGHT = 1e-9  # [rad/m] and [rad/s] below which a motion does not turn


@njit(cache=True, error_model="numpy", inline="always")
def moved(pose: Array, twist: Array, way: float, out: Array) -> None:
    """Write the pose (3,) after a constant twist (3,) in the body's axes was followed for `way`."""
    angle = twist[2] * way
    if abs(twist[2]) < STRAIGHT:
        x, y = twist[0] * way, twist[1] * way
    else:
        sine, versine = math.sin(angle) / twist[2], 2.0 * math.sin(0.5 * angle) ** 2 / twist[2]
        x, y = twist[0] * sine - twist[1] * versine, twist[0] * versine + twist[1] * sine
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out[0], out[1], out[2] = pose[0] + c * x - s * y, pose[1] + s * x + c * y, pose[2] + angle


@njit(cache=True, error_model="numpy", inline="always")
def place(points: Array, pose: Array, out: Array) -> None:
    """Write points (n, 2) of a body into `out` as they are in the parent's axes with the body at a pose (3,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        out[k, 0], out[k, 1] = pose[0] + c * x - s * y, pose[1] + s * x + c * y


@njit(**LEAF)
def separation(a: Array, a0: int, a1: int, b: Array, b0: int, b1: int) -> float:
    """Return the widest gap between two outlines along any edge's normal; below zero: how deep they overlap.

    By the separating axis theorem it is above zero exactly where they are apart, and never more than their distance.
    """
    widest = -np.inf
    for swap in range(2):
        first, low, high = (a, a0, a1) if swap == 0 else (b, b0, b1)
        other, start, end = (b, b0, b1) if swap == 0 else (a, a0, a1)
        before = high - 1
        for k in range(low, high):
            dx, dy = first[k, 0] - first[before, 0], first[k, 1] - first[before, 1]
            length = math.sqrt(dx * dx + dy * dy)
            if length > 0.0:
                nx, ny = dy / length, -dx / length
                gap = np.inf
                for j in range(start, end):
                    gap = min(gap, nx * (other[j, 0] - first[k, 0]) + ny * (other[j, 1] - first[k, 1]))
                widest = max(widest, gap)
            before = k
    return widest


@njit(cache=True, error_model="numpy", inline="always")
def foot(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the point of the segment a b that is nearest to p."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 0.0:
        share = min(max(((px - ax) * dx + (py - ay) * dy) / squared, 0.0), 1.0)
    return ax + share * dx, ay + share * dy


@njit(**LEAF)
def nearest_points(a: Array, a0: int, a1: int, b: Array, b0: int, b1: int, out: Array) -> float:
    """Write the nearest points (2,), (2,) of two outlines into `out` (4,), a's first, and return their distance.

    Of outlines that overlap the nearest pair of a corner and an edge is meant.
    """
    best = np.inf
    for swap in range(2):
        first, low, high = (a, a0, a1) if swap == 0 else (b, b0, b1)
        other, start, end = (b, b0, b1) if swap == 0 else (a, a0, a1)
        for k in range(low, high):
            px, py = first[k, 0], first[k, 1]
            before = end - 1
            for j in range(start, end):
                qx, qy = foot(px, py, other[before, 0], other[before, 1], other[j, 0], other[j, 1])
                squared = (px - qx) ** 2 + (py - qy) ** 2
                if squared < best:
                    best = squared
                    if swap == 0:
                        out[0], out[1], out[2], out[3] = px, py, qx, qy
                    else:
                        out[0], out[1], out[2], out[3] = qx, qy, px, py
                before = j
    return math.sqrt(best)


@njit(**LEAF)
def point_distance(px: float, py: float, b: Array, b0: int, b1: int) -> float:
    """Return the distance from a point to an outline; zero inside it."""
    best, inside = np.inf, b1 - b0 > 2
    before = b1 - 1
    for j in range(b0, b1):
        ax, ay, bx, by = b[before, 0], b[before, 1], b[j, 0], b[j, 1]
        qx, qy = foot(px, py, ax, ay, bx, by)
        best = min(best, (px - qx) ** 2 + (py - qy) ** 2)
        if (bx - ax) * (py - ay) - (by - ay) * (px - ax) < 0.0:
            inside = False
        before = j
    return 0.0 if inside else math.sqrt(best)


@njit(cache=True, error_model="numpy", inline="always")
def box_gap(x: float, y: float, box: Array) -> float:
    """Return the distance from a point to a box (4,): least x, least y, greatest x, greatest y."""
    dx = max(max(box[0] - x, x - box[2]), 0.0)
    dy = max(max(box[1] - y, y - box[3]), 0.0)
    return math.sqrt(dx * dx + dy * dy)


@njit(**LEAF)
def crosses(ax: float, ay: float, bx: float, by: float, path: Array, p0: int, p1: int) -> int:
    """Return how often the segment a b crosses a polyline, the rows p0 to p1 of `path`, modulo two."""
    count = 0
    for k in range(p0, p1 - 1):
        cx, cy, dx, dy = path[k, 0], path[k, 1], path[k + 1, 0], path[k + 1, 1]
        one = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.0
        two = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax) > 0.0
        if one != two:
            three = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx) > 0.0
            four = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx) > 0.0
            if three != four:
                count += 1
    return count & 1
