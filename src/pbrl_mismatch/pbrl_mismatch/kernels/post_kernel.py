"""Compiled: a fixed square that a footprint runs into.

A table's edge that lies flat against a post leans on one of the post's corners, and on another as soon as it has turned
a little: the force's lever then jumps by the post's width, which no disc does. Contacts are springs at the corners of
either that are in the other, as in `crate_kernel`, but of a square that stands still.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import CREEP, SETTLING, push, resist
from pbrl_mismatch.kernels.crate_kernel import reach_of
from pbrl_mismatch.kernels.outline_kernel import nearest_edge

Array = NDArray[np.float64]


@njit(**LEAF)
def lean(
    p: Array, state: Array, rx: float, ry: float, nx: float, ny: float, depth: float, dt: float, acc: Array
) -> None:
    """Add what a fixed thing presses back where a body leans on it.

    Args:
        p: (WIDTH,) parameter row.
        state: (STATE,).
        rx: lever of the contact about the centre of mass, world axes [m].
        ry: its other coordinate [m].
        nx: of the direction in which the body presses, world axes.
        ny: its other coordinate.
        depth: of the contact [m].
        dt: in which it answers [s].
        acc: (9,) account.
    """
    k = p[at.OBSTACLE_STIFFNESS]
    push(acc, rx, ry, -k * depth * nx, -k * depth * ny)
    resist(acc, rx, ry, nx, ny, k * (dt + SETTLING))
    if p[at.OBSTACLE_FRICTION] > 0.0:
        slip = (state[4] + state[5] * rx) * nx - (state[3] - state[5] * ry) * ny
        grip = p[at.OBSTACLE_FRICTION] * k * depth / math.sqrt(slip * slip + CREEP * CREEP)
        resist(acc, rx, ry, -ny, nx, grip)


@njit(**LEAF)
def post_contact(p: Array, outline: Array, state: Array, c: float, s: float, com: Array, dt: float, acc: Array) -> None:
    """Add what a fixed square presses back; arguments as of `contact_kernel.contacts`."""
    half = p[at.OBSTACLE_RADIUS]
    qx, qy = p[at.OBSTACLE_X] - state[0], p[at.OBSTACLE_Y] - state[1]
    if qx * qx + qy * qy > (reach_of(outline, com) + 1.5 * half) ** 2:
        return
    ct, st = math.cos(p[at.OBSTACLE_ANGLE]), math.sin(p[at.OBSTACLE_ANGLE])
    for i in range(4):
        ux = half if i < 2 else -half
        uy = half if i == 0 or i == 3 else -half
        rx, ry = qx + ct * ux - st * uy, qy + st * ux + ct * uy
        gap, _, _, ex, ey = nearest_edge(outline, c * rx + s * ry + com[0], -s * rx + c * ry + com[1])
        if gap < 0.0:
            lean(p, state, rx, ry, c * ex - s * ey, s * ex + c * ey, -gap, dt, acc)
    for i in range(outline.shape[0]):
        bx, by = outline[i, 0] - com[0], outline[i, 1] - com[1]
        rx, ry = c * bx - s * by, s * bx + c * by
        ux, uy = ct * (rx - qx) + st * (ry - qy), -st * (rx - qx) + ct * (ry - qy)
        depth = half - max(abs(ux), abs(uy))
        if depth > 0.0:
            side = -1.0 if (ux if abs(ux) > abs(uy) else uy) > 0.0 else 1.0
            nx, ny = (side * ct, side * st) if abs(ux) > abs(uy) else (-side * st, side * ct)
            lean(p, state, rx, ry, nx, ny, depth, dt, acc)
