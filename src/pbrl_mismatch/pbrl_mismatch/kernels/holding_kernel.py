"""Compiled: what holds a body of the baseline class: its wheel, on a patch of floor too, and a hinge.

Alone they are impulses in closed form, as in `pbrl_model.kernel`. Beside anything that resists a wheel is one more dry
friction, which is solved for together with the others.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.friction_kernel import ROLLS, RUBS, rub_along, rub_in_ellipse, weight
from pbrl_model.kernel import SINGULAR, box_impulses, joint_rows

Array = NDArray[np.float64]

BORDER = 0.01
"""A patch's border is so soft [m]: a foot has a width, and a fit needs a slope."""
CONE_STEPS = 5
"""Newton steps to the edge of a friction ellipse."""


@njit(**LEAF)
def patch_share(p: Array, c: float, s: float, x: float, y: float) -> float:
    """Return how much a place on the floor belongs to a patch of which cosine and sine of the turn are told, 0..1."""
    dx, dy = x - p[at.PATCH_X], y - p[at.PATCH_Y]
    along = (p[at.PATCH_LENGTH] - abs(c * dx + s * dy)) / BORDER
    across = (p[at.PATCH_WIDTH] - abs(-s * dx + c * dy)) / BORDER
    if along < -30.0 or across < -30.0:
        return 0.0
    return 1.0 / ((1.0 + math.exp(-along)) * (1.0 + math.exp(-across)))


@njit(**LEAF, forceinline=True)
def has_wheel(p: Array) -> bool:
    """Tell whether the baseline has a wheel."""
    return p[at.MU_X] > 0.0 or p[at.MU_Y] > 0.0


@njit(**LEAF, forceinline=True)
def wheel_limits(
    p: Array, state: Array, c: float, s: float, mass: float, com: Array, axes: Array
) -> tuple[float, float]:
    """Return what the baseline's wheel holds along and across at most [N]; for arguments see `lay_feet`."""
    limit = weight(p, mass)
    along, across = p[at.MU_X] * limit, p[at.MU_Y] * limit
    if p[at.CONE] > 0.0 and across < 0.0:
        across = along
    if p[at.PATCH_ROLL] > 0.0:
        # A carpet holds back what rolls over it; what slides is held by the tread as before, if that was more.
        wx, wy = p[at.WHEEL_X] - com[0], p[at.WHEEL_Y] - com[1]
        share = patch_share(p, axes[5], axes[6], state[0] + c * wx - s * wy, state[1] + s * wx + c * wy)
        least = p[at.PATCH_ROLL] * limit * share
        along, across = max(along, least), max(across, least)
    return along, across


@njit(**LEAF, forceinline=True)
def lay_wheel(p: Array, state: Array, c: float, s: float, mass: float, com: Array, axes: Array, room: Array) -> None:
    """Write what the friction of the baseline's wheel takes from where the body is; for arguments see `lay_feet`."""
    i = room.shape[0] - 1
    ax, ay, wc, ws = p[at.WHEEL_X] - com[0], p[at.WHEEL_Y] - com[1], axes[0], axes[1]
    room[i, 0], room[i, 1] = c * ax - s * ay, s * ax + c * ay
    room[i, 2], room[i, 3] = wheel_limits(p, state, c, s, mass, com, axes)
    room[i, 4], room[i, 5] = c * wc - s * ws, s * wc + c * ws


@njit(**LEAF, forceinline=True)
def hold_wheel(p: Array, vx: float, vy: float, omega: float, room: Array, fresh: bool, acc: Array) -> None:
    """Add the friction of the baseline's wheel, within an ellipse or in each axis; see `resistances`."""
    i = room.shape[0] - 1
    rx, ry, along, across, ex, ey = room[i, 0], room[i, 1], room[i, 2], room[i, 3], room[i, 4], room[i, 5]
    ux, uy = vx - omega * ry, vy + omega * rx
    if p[at.CONE] > 0.0:
        rub_in_ellipse(acc, room, i, RUBS, rx, ry, ex, ey, along, across, ux, uy, fresh)
        return
    if along > 0.0:
        rub_along(acc, room, i, ROLLS, rx, ry, ex, ey, along, ux * ex + uy * ey, fresh)
    if across > 0.0:
        rub_along(acc, room, i, RUBS, rx, ry, -ey, ex, across, uy * ex - ux * ey, fresh)


@njit(**LEAF, forceinline=True)
def cone_impulses(
    a00: float, a01: float, a11: float, b0: float, b1: float, limit0: float, limit1: float
) -> tuple[float, float]:
    """Minimise p.A.p / 2 + b.p within the ellipse (p_0 / limit0)^2 + (p_1 / limit1)^2 <= 1, see `box_impulses`.

    In units of the limits the ellipse is a circle, and q = -(A + l)^-1 b for the multiplier l >= 0 that brings q onto
    it; Newton's method on 1 / |q| rises to it from zero (the trust-region step of More and Sorensen).
    """
    m00, m01, m11 = a00 * limit0 * limit0, a01 * limit0 * limit1, a11 * limit1 * limit1
    c0, c1 = b0 * limit0, b1 * limit1
    least = 1e-9 * (m00 + m11)
    m00 += least
    m11 += least
    shift, q0, q1 = 0.0, 0.0, 0.0
    for _ in range(CONE_STEPS):
        n00, n11 = m00 + shift, m11 + shift
        inverse = 1.0 / (n00 * n11 - m01 * m01)
        q0, q1 = (m01 * c1 - n11 * c0) * inverse, (m01 * c0 - n00 * c1) * inverse
        square = q0 * q0 + q1 * q1
        if square <= 1.0 + 1e-9:
            break
        along = (n11 * q0 * q0 - 2.0 * m01 * q0 * q1 + n00 * q1 * q1) * inverse
        shift += square / along * (math.sqrt(square) - 1.0)
    size = math.sqrt(q0 * q0 + q1 * q1)
    if size > 1.0:
        q0, q1 = q0 / size, q1 / size
    return q0 * limit0, q1 * limit1


@njit(**LEAF, forceinline=True)
def hold(
    p: Array,
    state: Array,
    c: float,
    s: float,
    mass: float,
    inertia: float,
    com: Array,
    axes: Array,
    dt: float,
    wheel: bool,
) -> None:
    """Change the velocity by the impulses of the hinge, and of the wheel unless it has held already.

    See `pbrl_model.kernel.integrate`.
    """
    inverse_mass, inverse_inertia = 1.0 / mass, 1.0 / inertia
    radius = p[at.HINGE_RADIUS]
    vx, vy, omega = state[3], state[4], state[5]
    n0x = n0y = l0 = n1x = n1y = l1 = h00 = h01 = h11 = 0.0
    hinge = not math.isnan(radius)
    if hinge:
        ax, ay = p[at.ANCHOR_X] - com[0], p[at.ANCHOR_Y] - com[1]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        dx, dy = state[0] + rx - p[at.HINGE_X], state[1] + ry - p[at.HINGE_Y]
        rows = joint_rows(dx, dy, rx, ry, radius, inverse_mass, inverse_inertia)
        n0x, n0y, l0, n1x, n1y, l1, h00, h01, h11, error0, error1 = rows
        correction = axes[4]
        u0 = n0x * vx + n0y * vy + l0 * omega + correction * error0
        u1 = n1x * vx + n1y * vy + l1 * omega + correction * error1
        j0, j1 = -h00 * u0 - h01 * u1, -h01 * u0 - h11 * u1
        vx += (n0x * j0 + n1x * j1) * inverse_mass
        vy += (n0y * j0 + n1y * j1) * inverse_mass
        omega += (l0 * j0 + l1 * j1) * inverse_inertia
    if wheel:
        wx, wy = p[at.WHEEL_X] - com[0], p[at.WHEEL_Y] - com[1]
        wc, ws = axes[0], axes[1]
        limit0, limit1 = wheel_limits(p, state, c, s, mass, com, axes)
        limit0, limit1 = limit0 * dt, limit1 * dt
        lever0, lever1 = wx * ws - wy * wc, wx * wc + wy * ws
        k00 = inverse_mass + lever0 * lever0 * inverse_inertia
        k01 = lever0 * lever1 * inverse_inertia
        k11 = inverse_mass + lever1 * lever1 * inverse_inertia
        floor0, floor1 = SINGULAR * k00, SINGULAR * k11
        ex, ey = c * wc - s * ws, s * wc + c * ws
        g00 = g01 = g10 = g11 = 0.0
        if hinge:
            q00 = (n0x * ex + n0y * ey) * inverse_mass + l0 * lever0 * inverse_inertia
            q01 = (n0y * ex - n0x * ey) * inverse_mass + l0 * lever1 * inverse_inertia
            q10 = (n1x * ex + n1y * ey) * inverse_mass + l1 * lever0 * inverse_inertia
            q11 = (n1y * ex - n1x * ey) * inverse_mass + l1 * lever1 * inverse_inertia
            g00, g01 = -h00 * q00 - h01 * q10, -h00 * q01 - h01 * q11
            g10, g11 = -h01 * q00 - h11 * q10, -h01 * q01 - h11 * q11
            k00 += q00 * g00 + q10 * g10
            k01 += q00 * g01 + q10 * g11
            k11 += q01 * g01 + q11 * g11
        slip0 = ex * vx + ey * vy + lever0 * omega
        slip1 = ex * vy - ey * vx + lever1 * omega
        k00, k11 = max(k00, floor0), max(k11, floor1)
        if p[at.CONE] > 0.0:
            p0, p1 = cone_impulses(k00, k01, k11, slip0, slip1, limit0, limit1)
        else:
            p0, p1 = box_impulses(k00, k01, k11, slip0, slip1, limit0, limit1)
        j0, j1 = g00 * p0 + g01 * p1, g10 * p0 + g11 * p1
        vx += (ex * p0 - ey * p1 + n0x * j0 + n1x * j1) * inverse_mass
        vy += (ey * p0 + ex * p1 + n0y * j0 + n1y * j1) * inverse_mass
        omega += (lever0 * p0 + lever1 * p1 + l0 * j0 + l1 * j1) * inverse_inertia
    state[3], state[4], state[5] = vx, vy, omega
