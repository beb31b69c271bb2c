"""Compiled: a square crate that a footprint pushes along, and turns where it pushes beside its middle.

Quasi-static: friction under the crate holds it until the wrench at its middle reaches the limit surface

    (fx^2 + fy^2) / F^2 + m^2 / (a F)^2 = 1,

an ellipsoid (Goyal, Ruina and Papadopoulos 1991; Howe and Cutkosky 1996), and it then moves along the surface's normal.
Contacts are springs without friction at the corners of either that are in the other.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import SETTLING
from pbrl_mismatch.kernels.outline_kernel import nearest_edge
from pbrl_mismatch.kernels.state import UNSEEN

Array = NDArray[np.float64]

ROUND = -10.0
"""An `unseen_angle` at or below it means a disc."""
STIFFNESS = 5000.0
"""Of the contact with an unseen body [N/m]."""
LEVER = 1.35
"""a over half a side: 0.77 where the load is spread evenly under a square, 1.41 where it rests on its corners."""
SLIDES = 4
"""Newton steps to where friction holds it."""
HELD = 0.999
"""Of its friction: below, it stands still."""

Pressed = tuple[float, float, float, float, float, float, float, float, float]


@njit(**LEAF)
def pressed(p: Array, outline: Array, state: Array, c: float, s: float, com: Array) -> Pressed:
    """Return what springs press on a crate and how stiff they are.

    Args:
        p: (WIDTH,) parameter row.
        outline: (E, 2) footprint, counter-clockwise.
        state: (STATE,).
        c: cosine of the body's heading.
        s: its sine.
        com: (2,) centre of mass in the body's frame [m].

    Returns:
        Force x, y and moment about the crate's middle, world axes [N, N, N m], then the symmetric stiffness for its
        displacements: xx, xy, yy, xm, ym, mm.
    """
    fx = fy = fm = xx = xy = yy = xm = ym = mm = 0.0
    half, turn = p[at.UNSEEN_RADIUS], p[at.UNSEEN_ANGLE] + state[UNSEEN + 2]
    qx, qy = state[UNSEEN] - state[0], state[UNSEEN + 1] - state[1]
    if qx * qx + qy * qy > (reach_of(outline, com) + 1.5 * half) ** 2:
        return fx, fy, fm, xx, xy, yy, xm, ym, mm
    ct, st = math.cos(turn), math.sin(turn)
    corners = outline.shape[0]
    for i in range(4 + corners):
        if i < 4:
            ux = half if i < 2 else -half
            uy = half if i == 0 or i == 3 else -half
            # Lever about the crate's middle; where it is in the body's frame; how deep it is in the footprint.
            rx, ry = ct * ux - st * uy, st * ux + ct * uy
            wx, wy = qx + rx, qy + ry
            gap, _, _, ex, ey = nearest_edge(outline, c * wx + s * wy + com[0], -s * wx + c * wy + com[1])
            depth = -gap
            if depth <= 0.0:
                continue
            nx, ny = c * ex - s * ey, s * ex + c * ey
        else:
            bx, by = outline[i - 4, 0] - com[0], outline[i - 4, 1] - com[1]
            rx, ry = c * bx - s * by - qx, s * bx + c * by - qy
            ux, uy = ct * rx + st * ry, -st * rx + ct * ry
            depth = half - max(abs(ux), abs(uy))
            if depth <= 0.0:
                continue
            if abs(ux) > abs(uy):
                side = -1.0 if ux > 0.0 else 1.0
                nx, ny = side * ct, side * st
            else:
                side = -1.0 if uy > 0.0 else 1.0
                nx, ny = -side * st, side * ct
        moment = rx * ny - ry * nx
        force = STIFFNESS * depth
        fx += force * nx
        fy += force * ny
        fm += force * moment
        xx += STIFFNESS * nx * nx
        xy += STIFFNESS * nx * ny
        yy += STIFFNESS * ny * ny
        xm += STIFFNESS * nx * moment
        ym += STIFFNESS * ny * moment
        mm += STIFFNESS * moment * moment
    return fx, fy, fm, xx, xy, yy, xm, ym, mm


@njit(**LEAF)
def reach_of(outline: Array, com: Array) -> float:
    """Return how far the footprint reaches from the centre of mass [m]."""
    most = 0.0
    for i in range(outline.shape[0]):
        most = max(most, (outline[i, 0] - com[0]) ** 2 + (outline[i, 1] - com[1]) ** 2)
    return math.sqrt(most)


@njit(**LEAF)
def share_of_friction(p: Array, fx: float, fy: float, fm: float) -> float:
    """Return how near a wrench is to what makes the crate slide: one is there."""
    lever = LEVER * p[at.UNSEEN_RADIUS]
    return math.sqrt(fx * fx + fy * fy + fm * fm / (lever * lever)) / p[at.UNSEEN_FORCE]


@njit(**LEAF)
def move_crate(p: Array, outline: Array, state: Array, c: float, s: float, com: Array) -> None:
    """Let the crate slide and turn away from a footprint that presses it harder than its friction holds."""
    spin = 1.0 / (LEVER * p[at.UNSEEN_RADIUS]) ** 2
    for _ in range(SLIDES):
        fx, fy, fm, xx, xy, yy, xm, ym, mm = pressed(p, outline, state, c, s, com)
        share = share_of_friction(p, fx, fy, fm)
        if share <= 1.0:
            return
        dx, dy, dm = fx, fy, spin * fm
        stiff = dx * (xx * dx + xy * dy + xm * dm) + dy * (xy * dx + yy * dy + ym * dm)
        stiff += dm * (xm * dx + ym * dy + mm * dm)
        square = fx * dx + fy * dy + fm * dm
        # Along the normal the share falls by `stiff / square` of itself for each unit of way.
        way = (1.0 - 1.0 / share) * square / stiff
        state[UNSEEN] += way * dx
        state[UNSEEN + 1] += way * dy
        state[UNSEEN + 2] += way * dm


@njit(**LEAF)
def crate_contact(
    p: Array, outline: Array, state: Array, c: float, s: float, com: Array, dt: float, acc: Array
) -> None:
    """Add what a crate presses back; arguments as of `contact_kernel.contacts`."""
    fx, fy, fm, xx, xy, yy, xm, ym, mm = pressed(p, outline, state, c, s, com)
    if xx + yy <= 0.0:
        return
    share = share_of_friction(p, fx, fy, fm)
    if share > 1.0:
        fx, fy, fm = fx / share, fy / share, fm / share
    # From the crate's middle to the body's centre of mass.
    qx, qy = state[UNSEEN] - state[0], state[UNSEEN + 1] - state[1]
    acc[0] -= fx
    acc[1] -= fy
    acc[2] -= fm + qx * fy - qy * fx
    if share < HELD:
        give = dt + SETTLING
        mx, my = xm + qx * xy - qy * xx, ym + qx * yy - qy * xy
        acc[3] += give * xx
        acc[4] += give * xy
        acc[5] += give * yy
        acc[6] += give * mx
        acc[7] += give * my
        acc[8] += give * (mm + qx * ym - qy * xm + qx * my - qy * mx)
