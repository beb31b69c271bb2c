"""Compiled: a ball pushes a box along a straight line, slowly, for many parameters and many pushes at once.

Slow means that friction on the table is all that resists. Its wrench lies on an ellipsoid (Howe and Cutkosky 1996): the
force up to some size, the moment up to that size times `radius`, and the box moves along the ellipsoid's normal. The
size itself does not matter to how the box moves. `world.PhysicsWorld` has the same friction, `radius` there being the
radius of gyration. The ball sticks to the side where its friction can hold, else it slides along it (Lynch, Maekawa and
Tanie 1992).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

STEP = 5e-4
"""Way of the ball between two looks [m]."""
BACK = 0.5
"""Share of what the ball has gone into the box that is taken back in a look."""


@njit(**LEAF)
def _touch(bx: float, by: float, length: float, width: float) -> tuple[float, float, float, float, float]:
    """Return the point of a box nearest to the ball's middle, the normal into the box there, and the distance.

    All in the box's frame; half of its sides. The distance is below zero with the middle of the ball in the box.
    """
    px, py = min(max(bx, -length), length), min(max(by, -width), width)
    dx, dy = px - bx, py - by
    away = math.hypot(dx, dy)
    if away > 0.0:
        return px, py, dx / away, dy / away, away
    left_x, left_y = length - abs(bx), width - abs(by)
    if left_x < left_y:
        side = 1.0 if bx >= 0.0 else -1.0
        return side * length, by, -side, 0.0, -left_x
    side = 1.0 if by >= 0.0 else -1.0
    return bx, side * width, 0.0, -side, -left_y


@njit(**LEAF)
def twist_of(
    px: float, py: float, nx: float, ny: float, vx: float, vy: float, radius: float, mu: float
) -> tuple[float, float, float]:
    """Return how a box moves where a point of its side is pushed with a velocity.

    Args:
        px: the point, from the centre of friction [m].
        py: as `px`.
        nx: normal into the box there.
        ny: as `nx`.
        vx: velocity of the pusher.
        vy: as `vx`.
        radius: of the ellipsoid [m].
        mu: friction between pusher and side.

    Returns:
        Velocity of the centre of friction and turning rate, in the units of the pusher's velocity.
    """
    closing = vx * nx + vy * ny
    if closing <= 0.0:
        return 0.0, 0.0, 0.0
    square = radius * radius
    a, b, d = 1.0 + py * py / square, -px * py / square, 1.0 + px * px / square
    # Velocity of the point is A f for a force f: sticking needs f = A^-1 v within the friction cone.
    det = a * d - b * b
    fx, fy = (d * vx - b * vy) / det, (a * vy - b * vx) / det
    normal, along = fx * nx + fy * ny, -fx * ny + fy * nx
    if normal <= 0.0 or abs(along) > mu * normal:
        side = 1.0 if along > 0.0 else -1.0
        fx, fy = nx - side * mu * ny, ny + side * mu * nx
        speed = (a * fx + b * fy) * nx + (b * fx + d * fy) * ny
        scale = closing / speed
        fx, fy = scale * fx, scale * fy
    return fx, fy, (px * fy - py * fx) / square


@njit(**LEAF)
def push(row: Array, half: Array, ball: float, path: Array, out: Array) -> None:
    """Push one box once.

    Args:
        row: (4,) centre of friction x, y in the box's frame [m], radius [m], friction of the ball on the side.
        half: (2,) half of the sides [m].
        ball: its radius [m].
        path: (4,) where its middle begins and ends, x y x y in the box's frame as it is before [m].
        out: (3,) how the box's frame moved, in itself as it was before [m, m, rad].
    """
    x, y, t = 0.0, 0.0, 0.0
    length = math.hypot(path[2] - path[0], path[3] - path[1])
    count = max(math.ceil(length / STEP), 1)
    dx, dy = (path[2] - path[0]) / count, (path[3] - path[1]) / count
    for k in range(1, count + 1):
        c, s = math.cos(t), math.sin(t)
        gx, gy = path[0] + k * dx - x, path[1] + k * dy - y
        bx, by = c * gx + s * gy, c * gy - s * gx
        px, py, nx, ny, away = _touch(bx, by, half[0], half[1])
        deep = ball - away
        if deep <= 0.0:
            continue
        # In the box's frame: the ball's step, of which only what it went into the box by has to be made way for.
        vx, vy = c * dx + s * dy, c * dy - s * dx
        closing = vx * nx + vy * ny
        more = BACK * max(deep - closing, 0.0)
        wx, wy, spin = twist_of(px - row[0], py - row[1], nx, ny, vx + more * nx, vy + more * ny, row[2], row[3])
        share = min(1.0, deep / closing) if closing > 0.0 else 1.0
        wx, wy, spin = share * wx, share * wy, share * spin
        # From the centre of friction to the frame's origin.
        ox, oy = wx + spin * row[1], wy - spin * row[0]
        x, y, t = x + c * ox - s * oy, y + s * ox + c * oy, t + spin
    out[0], out[1], out[2] = x, y, t


@njit(cache=True, parallel=True, error_model="numpy")
def push_many(rows: Array, half: Array, ball: float, paths: Array, out: Array) -> None:
    """Push one box (p,) ways with (r,) parameters each.

    Args:
        rows: (r, 4) see `push`.
        half: (2,)
        ball: [m].
        paths: (p, 4)
        out: (r, p, 3)
    """
    for r in prange(len(rows)):
        for p in range(len(paths)):
            push(rows[r], half, ball, paths[p], out[r, p])
