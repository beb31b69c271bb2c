"""Compiled: how a thing slides and turns on the floor under what acts on it, in one implicit step.

Friction holds it until the wrench at its load's middle reaches the limit surface

    (fx^2 + fy^2) / F^2 + m^2 / (a F)^2 = 1,

an ellipsoid (Goyal, Ruina and Papadopoulos 1991; Howe and Cutkosky 1996); where it slides, the wrench is the point of
the surface whose normal its twist is.
"""

from __future__ import annotations

import math

from numba import njit

from pbrl_bag.kernel_options import LEAF

CONE_STEPS, ON_IT = 6, 1e-6
"""Newton steps to the limit surface, and how near is there."""

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
"""A symmetric matrix: xx, xy, yy, xm, ym, mm."""


@njit(**LEAF, forceinline=True)
def inverse(a: Six) -> Six:
    """Return the inverse of a symmetric positive definite matrix."""
    xx, xy, yy, xm, ym, mm = a
    b0, b1, b3 = yy * mm - ym * ym, xm * ym - xy * mm, xy * ym - xm * yy
    d = 1.0 / (xx * b0 + xy * b1 + xm * b3)
    return d * b0, d * b1, d * (xx * mm - xm * xm), d * b3, d * (xy * xm - xx * ym), d * (xx * yy - xy * xy)


@njit(**LEAF, forceinline=True)
def times(a: Six, x: float, y: float, m: float) -> Three:
    """Return a symmetric matrix times a vector."""
    return a[0] * x + a[1] * y + a[3] * m, a[1] * x + a[2] * y + a[4] * m, a[3] * x + a[4] * y + a[5] * m


@njit(**LEAF)
def slid(
    a: Six, x: float, y: float, m: float, force: float, lever: float, dx: float, dy: float
) -> tuple[float, Three, Three]:
    """Return how a thing slides under what acts on it: w of A w = b - r(w), and the friction r.

    In u = (wx, wy, a wm) at the load's middle the limit surface is a ball, r = F u / |u|, and u = l (l A + F)^-1 b for
    the length l that brings (l A + F)^-1 b to length one: Newton's method on one over that length, as in
    `holding_kernel.cone_impulses`.

    Args:
        a: A, mass over dt and what springs and dampers add to it.
        x: b, of a step without friction [N].
        y: as `x`.
        m: as `x` [N m].
        force: F [N].
        lever: a [m].
        dx: where the load's middle is from the thing's [m].
        dy: as `dx`.

    Returns:
        l [m/s], zero where it stands; w [m/s, m/s, rad/s]; r [N, N, N m], b where it stands.
    """
    m = (m + x * dy - y * dx) / lever
    if x * x + y * y + m * m <= force * force:
        return 0.0, (0.0, 0.0, 0.0), (x, y, m * lever + dx * y - dy * x)
    xx, xy, yy = a[0], a[1], a[2]
    xm, ym = xx * dy - xy * dx + a[3], xy * dy - yy * dx + a[4]
    mm = (dy * xm - dx * ym + a[3] * dy - a[4] * dx + a[5]) / (lever * lever)
    xm, ym = xm / lever, ym / lever
    speed, ux, uy, um = 0.0, 0.0, 0.0, 0.0
    for _ in range(CONE_STEPS):
        n = inverse((speed * xx + force, speed * xy, speed * yy + force, speed * xm, speed * ym, speed * mm + force))
        ux, uy, um = times(n, x, y, m)
        square = ux * ux + uy * uy + um * um
        size = math.sqrt(square)
        if abs(size - 1.0) < ON_IT:
            break
        gx, gy, gm = times(n, xx * ux + xy * uy + xm * um, xy * ux + yy * uy + ym * um, xm * ux + ym * uy + mm * um)
        speed = max(speed + (size - 1.0) * square / (ux * gx + uy * gy + um * gm), 0.0)
    size = math.sqrt(ux * ux + uy * uy + um * um)
    ux, uy, um = ux / size, uy / size, um / size
    turn = speed * um / lever
    w = (speed * ux + turn * dy, speed * uy - turn * dx, turn)
    return speed, w, (force * ux, force * uy, force * (um * lever + dx * uy - dy * ux))
