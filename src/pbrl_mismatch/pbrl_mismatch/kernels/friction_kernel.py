"""Compiled: dry friction, linearised for an implicit step.

Friction limit * u / sqrt(u^2 + CREEP^2) bends sharply where a body stands. Taken as a resistance at the sliding speed
of the iteration before, it crawls to rest in dozens of iterations; Newton's method on u overshoots and turns about.
Here the force over its limit, w, is an unknown beside u, and r w = u with r = sqrt(u^2 + CREEP^2) is linearised in both
(the primal-dual Newton method that Chan, Golub and Mulet 1999 made for the same function); |w| <= 1 keeps every step a
descent. In a slide that takes one or two iterations, to a stop three to five.

What an iteration keeps of a contact, u and w, lies in a row of `room` at a place that the caller says.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import CREEP, push, resist
from pbrl_model.kernel import GRAVITY

Array = NDArray[np.float64]

ROLLS, SCRUBS, TWISTS, RUBS = 6, 8, 10, 12
FOOT = 16
"""Numbers of a foot: lever (x, y) [m], limit of its friction [N], load on it [N], cosine and sine of its caster's
heading, as `laws_kernel.lay_feet` writes them; then what iterations keep of each friction. Two more rows are the second
wheel's and the baseline's, of which `holding_kernel.lay_wheel` writes lever, both limits and heading."""


@njit(**LEAF, forceinline=True)
def weight(p: Array, mass: float) -> float:
    """Return what stands on the floor [N] where `mass` [kg] moves as one body: a load that swings hangs in it."""
    return GRAVITY * (mass + p[at.SLOSH_MASS])


@njit(**LEAF, forceinline=True)
def bent(room: Array, i: int, k: int, a: float, b: float, rest: float, fresh: bool) -> tuple[float, ...]:
    """Linearise y / sqrt(|y|^2 + rest^2) at y = (a, b): its value is (f, g) + K y, K = (xx, xy; xy, yy).

    Args:
        room: (n, m) of which four numbers of row i from k on are this contact's: the y of the iteration before, and w.
        i: see `room`.
        k: see `room`.
        a: of y.
        b: of y.
        rest: below which it is viscous.
        fresh: whether this is a step's first iteration.
    """
    r = 1.0 / math.sqrt(a * a + b * b + rest * rest)
    p, q = a * r, b * r
    if not fresh:
        a0, b0, p0, q0 = room[i, k], room[i, k + 1], room[i, k + 2], room[i, k + 3]
        size = 1.0 / math.sqrt(a0 * a0 + b0 * b0 + rest * rest)
        da, db = a - a0, b - b0
        first, second = 0.5 * size * (a0 * da + b0 * db), 0.5 * size * (p0 * da + q0 * db)
        p, q = (a - p0 * first - a0 * second) * size, (b - q0 * first - b0 * second) * size
        within = 2.0 / (1.0 + max(p * p + q * q, 1.0))  # into the disc, with neither a root nor a branch
        p, q = p * within, q * within
    room[i, k], room[i, k + 1], room[i, k + 2], room[i, k + 3] = a, b, p, q
    a, b = a * r, b * r
    cross = 0.5 * (p * b + q * a)
    return p * a * a + cross * b, q * b * b + cross * a, r * (1.0 - p * a), -r * cross, r * (1.0 - q * b)


@njit(**LEAF, forceinline=True)
def rub_along(
    acc: Array,
    room: Array,
    i: int,
    k: int,
    rx: float,
    ry: float,
    nx: float,
    ny: float,
    limit: float,
    u: float,
    fresh: bool,
) -> None:
    """Add dry friction along one direction.

    Args:
        acc: (9,) account.
        room: see `bent`; two numbers.
        i: see `bent`.
        k: see `bent`.
        rx: lever from the centre of mass [m].
        ry: as `rx`.
        nx: direction, world axes.
        ny: as `nx`.
        limit: of the friction [N].
        u: how fast the lever's end goes along the direction [m/s].
        fresh: see `bent`.
    """
    r = 1.0 / math.sqrt(u * u + CREEP * CREEP)
    w = u * r
    if not fresh:
        before, held = room[i, k], room[i, k + 1]
        size = 1.0 / math.sqrt(before * before + CREEP * CREEP)
        w = min(max((u - held * before * (u - before) * size) * size, -1.0), 1.0)
    room[i, k], room[i, k + 1] = u, w
    at = u * r
    force = limit * w * at * at
    push(acc, rx, ry, -force * nx, -force * ny)
    resist(acc, rx, ry, nx, ny, limit * (1.0 - w * at) * r)


@njit(**LEAF, forceinline=True)
def rub_in_ellipse(
    acc: Array,
    room: Array,
    i: int,
    k: int,
    rx: float,
    ry: float,
    ex: float,
    ey: float,
    along: float,
    across: float,
    ux: float,
    uy: float,
    fresh: bool,
) -> None:
    """Add dry friction F = -D^2 u / sqrt(u^T D^2 u), D = diag(along, across).

    Args:
        acc: (9,) account.
        room: see `bent`.
        i: see `bent`.
        k: see `bent`.
        rx: lever from the centre of mass [m].
        ry: as `rx`.
        ex: first axis of the ellipse, world axes.
        ey: as `ex`.
        along: limit in the first axis [N].
        across: limit in the second [N].
        ux: velocity of the lever's end [m/s].
        uy: as `ux`.
        fresh: see `bent`.
    """
    a, b = along * (ux * ex + uy * ey), across * (uy * ex - ux * ey)
    f, g, xx, xy, yy = bent(room, i, k, a, b, CREEP * max(along, across), fresh)
    f, g, xx, xy, yy = along * f, across * g, along * along * xx, along * across * xy, across * across * yy
    mixed = 2.0 * xy * ex * ey
    push(acc, rx, ry, g * ey - f * ex, -f * ey - g * ex)
    xx, xy, yy = (
        xx * ex * ex - mixed + yy * ey * ey,
        (xx - yy) * ex * ey + xy * (ex * ex - ey * ey),
        xx * ey * ey + mixed + yy * ex * ex,
    )
    xt, yt = xy * rx - xx * ry, yy * rx - xy * ry
    acc[3] += xx
    acc[4] += xy
    acc[5] += yy
    acc[6] += xt
    acc[7] += yt
    acc[8] += yt * rx - xt * ry
