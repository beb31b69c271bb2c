"""Compiled: boxes on a table against each other, against its borders, and against the ball that pushes one of them.

A box is x, y, yaw and half its sides. Arrays in, no allocation, no callables, no checks.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(**LEAF)
def separation(
    ax: float, ay: float, at: float, al: float, aw: float, bx: float, by: float, bt: float, bl: float, bw: float
) -> float:
    """Return how far apart two boxes are along the best of their four axes; below zero: how deep they overlap [m].

    Where corner faces corner they are further apart than that.

    Args:
        ax: middle of the first box [m].
        ay: as `ax`.
        at: its yaw [rad].
        al: half its length [m].
        aw: half its width [m].
        bx: of the second box, likewise.
        by: as `bx`.
        bt: as `at`.
        bl: as `al`.
        bw: as `aw`.
    """
    dx, dy = bx - ax, by - ay
    ca, sa, cb, sb = math.cos(at), math.sin(at), math.cos(bt), math.sin(bt)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    return max(
        abs(dx * ca + dy * sa) - al - bl * c - bw * s,
        abs(dy * ca - dx * sa) - aw - bl * s - bw * c,
        abs(dx * cb + dy * sb) - bl - al * c - aw * s,
        abs(dy * cb - dx * sb) - bw - al * s - aw * c,
    )


@njit(**LEAF)
def room_inside(x: float, y: float, t: float, length: float, width: float, low: Array, high: Array) -> float:
    """Return how far a box, half of its sides, is from the nearest border; below zero: how far beyond it [m]."""
    c, s = abs(math.cos(t)), abs(math.sin(t))
    ex, ey = length * c + width * s, length * s + width * c
    return min(x - ex - low[0], high[0] - x - ex, y - ey - low[1], high[1] - y - ey)


@njit(**LEAF)
def box_fault(
    layout: Array, item: int, pose: Array, halves: Array, fixed: Array, low: Array, high: Array, margin: float
) -> int:
    """Return what an item would be in at a pose: 0 nothing, -1 beyond the borders, else one more than what it meets.

    Args:
        layout: (n, 3) where the items are.
        item: which one is asked about; where the layout has it does not matter.
        pose: (3,)
        halves: (n, 2) half sides of the items.
        fixed: (o, 5) x, y, yaw and half sides of obstacles, counted on after the items.
        low: (2,) lower left corner of the borders.
        high: (2,) upper right one.
        margin: that it keeps from others [m]; below zero: so much overlap, and so much beyond a border, is let pass.
    """
    x, y, t, length, width = pose[0], pose[1], pose[2], halves[item, 0], halves[item, 1]
    if room_inside(x, y, t, length, width, low, high) < min(margin, 0.0):
        return -1
    for k in range(len(layout)):
        if k != item:
            other, size = layout[k], halves[k]
            if separation(x, y, t, length, width, other[0], other[1], other[2], size[0], size[1]) < margin:
                return k + 1
    for k in range(len(fixed)):
        box = fixed[k]
        if separation(x, y, t, length, width, box[0], box[1], box[2], box[3], box[4]) < margin:
            return len(layout) + k + 1
    return 0


@njit(**LEAF)
def ball_meets(
    px: float, py: float, qx: float, qy: float, radius: float, x: float, y: float, t: float, length: float, width: float
) -> bool:
    """Say whether a ball on its way from p to q comes into a box: half of its sides [m]."""
    c, s = math.cos(t), math.sin(t)
    ax, ay = (px - x) * c + (py - y) * s, (py - y) * c - (px - x) * s
    bx, by = (qx - x) * c + (qy - y) * s, (qy - y) * c - (qx - x) * s
    if (
        min(ax, bx) >= length + radius
        or max(ax, bx) <= -length - radius
        or min(ay, by) >= width + radius
        or max(ay, by) <= -width - radius
    ):
        return False
    # The way through the box itself, by clipping; then the corners, from which the nearest point may be off an end.
    first, last = 0.0, 1.0
    for low, high, a, d in ((-length, length, ax, bx - ax), (-width, width, ay, by - ay)):
        if d == 0.0:
            if a < low or a > high:
                first, last = 1.0, 0.0
        else:
            enter, leave = (low - a) / d, (high - a) / d
            if enter > leave:
                enter, leave = leave, enter
            first, last = max(first, enter), min(last, leave)
    if first <= last:
        return True
    nearest = math.inf
    for ex, ey in ((ax, ay), (bx, by)):
        dx, dy = max(abs(ex) - length, 0.0), max(abs(ey) - width, 0.0)
        nearest = min(nearest, dx * dx + dy * dy)
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square > 0.0:
        for cx in (-length, length):
            for cy in (-width, width):
                share = min(max(((cx - ax) * dx + (cy - ay) * dy) / square, 0.0), 1.0)
                ox, oy = ax + share * dx - cx, ay + share * dy - cy
                nearest = min(nearest, ox * ox + oy * oy)
    return nearest < radius * radius
