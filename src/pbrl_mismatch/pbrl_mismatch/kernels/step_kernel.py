"""Compiled: one step of one body with every effect, in the order of `pbrl_model.kernel`.

The pose advances with the old velocity; forces act; resistances are solved for implicitly; then impulses at the hinge
and at the baseline's wheel, in closed form as in `pbrl_model.kernel`, and friction of the whole body. With every effect
off a step is that kernel's step.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import CREEP
from pbrl_mismatch.kernels.contact_kernel import contacts
from pbrl_mismatch.kernels.crate_kernel import CRUSHING, move_crate
from pbrl_mismatch.kernels.laws_kernel import (
    dry,
    lay_feet,
    on_casters,
    on_feet,
    patch_share,
    resistances,
    springs,
    swivel,
)
from pbrl_mismatch.kernels.state import CASTERS, FIRST_CASTER, SLOSH
from pbrl_model.kernel import ERROR_BIAS, GRAVITY, SINGULAR, box_impulses, cos_sin, joint_rows

Array = NDArray[np.float64]

SWEEPS, SAME = 10, 3e-3
"""Times at most that dry friction is linearised anew at the velocity it leads to; a change of the acceleration below
this [m/s^2] ends it."""
CONE_STEPS = 5
"""Newton steps to the edge of a friction ellipse."""


@njit(**LEAF, forceinline=True)
def solve_resisted(state: Array, mass: float, inertia: float, acc: Array, dt: float) -> tuple[float, float, float]:
    """Return the velocity v of (M + dt D) v = M v0 + dt F, by Cholesky."""
    a, b, c = mass + dt * acc[3], dt * acc[4], dt * acc[6]
    d, e, f = mass + dt * acc[5], dt * acc[7], inertia + dt * acc[8]
    x = mass * state[3] + dt * acc[0]
    y = mass * state[4] + dt * acc[1]
    z = inertia * state[5] + dt * acc[2]
    l10, l20 = b / a, c / a
    d1 = d - l10 * b
    l21 = (e - l10 * c) / d1
    d2 = f - l20 * c - l21 * l21 * d1
    y -= l10 * x
    z -= l20 * x + l21 * y
    omega = z / d2
    vy = y / d1 - l21 * omega
    vx = x / a - l10 * vy - l20 * omega
    return vx, vy, omega


@njit(**LEAF)
def fixed_axes(p: Array, dt: float, axes: Array) -> None:
    """Write what no step changes (7,).

    Cosines and sines of both wheels' turns, the share of a joint's error, cosine and sine of the patch's turn.
    """
    axes[0], axes[1] = math.cos(p[at.WHEEL_THETA]), math.sin(p[at.WHEEL_THETA])
    axes[2], axes[3] = math.cos(p[at.WHEEL2_THETA]), math.sin(p[at.WHEEL2_THETA])
    axes[4] = (1.0 - ERROR_BIAS**dt) / dt
    axes[5], axes[6] = math.cos(p[at.PATCH_THETA]), math.sin(p[at.PATCH_THETA])


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
    p: Array, state: Array, c: float, s: float, mass: float, inertia: float, com: Array, axes: Array, dt: float
) -> None:
    """Change the velocity by the impulses of hinge and wheel, see `pbrl_model.kernel.integrate`."""
    inverse_mass, inverse_inertia = 1.0 / mass, 1.0 / inertia
    limit = mass * GRAVITY * dt
    limit0, limit1 = p[at.MU_X] * limit, p[at.MU_Y] * limit
    if p[at.CONE] > 0.0 and limit1 < 0.0:
        limit1 = limit0
    wheel = limit0 > 0.0 or limit1 > 0.0
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
        lever0, lever1 = wx * ws - wy * wc, wx * wc + wy * ws
        k00 = inverse_mass + lever0 * lever0 * inverse_inertia
        k01 = lever0 * lever1 * inverse_inertia
        k11 = inverse_mass + lever1 * lever1 * inverse_inertia
        floor0, floor1 = SINGULAR * k00, SINGULAR * k11
        ex, ey = c * wc - s * ws, s * wc + c * ws
        if p[at.PATCH_ROLL] > 0.0:
            # A carpet holds back what rolls over it; what slides is held by the tread as before, if that was more.
            x, y = state[0] + c * wx - s * wy, state[1] + s * wx + c * wy
            least = p[at.PATCH_ROLL] * limit * patch_share(p, axes[5], axes[6], x, y)
            limit0, limit1 = max(limit0, least), max(limit1, least)
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


@njit(**LEAF)
def turn_casters(p: Array, state: Array, c: float, s: float, com: Array, feet: Array, dt: float) -> None:
    """Let every trailing caster follow its pivot for one step."""
    for i in range(min(feet.shape[0], CASTERS)):
        ax, ay = feet[i, 0] - com[0], feet[i, 1] - com[1]
        ux = state[3] - state[5] * (s * ax + c * ay)
        uy = state[4] + state[5] * (c * ax - s * ay)
        speed, k = math.sqrt(ux * ux + uy * uy), FIRST_CASTER + 2 * i
        if speed > 0.1 * CREEP:
            way = speed * dt / p[at.CASTER_TRAIL]
            state[k], state[k + 1] = swivel(state[k], state[k + 1], ux / speed, uy / speed, way)


@njit(**LEAF)
def swing_load(
    p: Array, state: Array, ax: float, ay: float, turn: float, c: float, s: float, com: Array, dt: float
) -> None:
    """Move the load that swings inside a body whose centre of mass accelerates by (ax, ay) [m/s^2] and `turn`."""
    bx, by = p[at.SLOSH_X] - com[0], p[at.SLOSH_Y] - com[1]
    rx, ry = c * bx - s * by, s * bx + c * by
    ax -= turn * ry + state[5] * state[5] * rx
    ay += turn * rx - state[5] * state[5] * ry
    rate = 2.0 * math.pi * p[at.SLOSH_FREQUENCY]
    damping = 2.0 * p[at.SLOSH_DAMPING] * rate
    for k in range(2):
        pull = -(ax if k == 0 else ay) - rate * rate * state[SLOSH + k] - damping * state[SLOSH + 2 + k]
        state[SLOSH + 2 + k] += pull * dt
        state[SLOSH + k] += state[SLOSH + 2 + k] * dt


@njit(**LEAF, forceinline=True)
def respond(
    p: Array,
    state: Array,
    c: float,
    s: float,
    mass: float,
    inertia: float,
    com: Array,
    feet: Array,
    axes: Array,
    acc: Array,
    room: Array,
    dt: float,
) -> tuple[float, float, float]:
    """Change the velocity by what is in an account, by dry friction, and by the impulses of hinge and wheel.

    Args:
        p: see `step_body`, and so are those not named here.
        state: changed.
        c: cosine of the heading.
        s: sine of the heading.
        mass: see `step_body`.
        inertia: see `step_body`.
        com: see `step_body`.
        feet: see `step_body`.
        axes: see `step_body`.
        acc: (9,) account, see `laws_kernel`.
        room: (F + 1, FOOT), see `laws_kernel.lay_feet`.
        dt: in which that happens [s].

    Returns:
        The acceleration (x, y, turn) without those impulses.
    """
    vx, vy, omega = state[3], state[4], state[5]
    if dry(p):
        if on_feet(p):
            lay_feet(p, state, c, s, mass, com, feet, axes, acc, room)
        b0, b1, b2, b3, b4, b5, b6, b7, b8 = acc[0], acc[1], acc[2], acc[3], acc[4], acc[5], acc[6], acc[7], acc[8]
        fresh = True
        for sweep in range(SWEEPS):
            acc[0], acc[1], acc[2], acc[3], acc[4], acc[5], acc[6], acc[7], acc[8] = b0, b1, b2, b3, b4, b5, b6, b7, b8
            resistances(p, c, s, vx, vy, omega, mass, com, axes, room, fresh, acc)
            ux, uy, turn = vx, vy, omega
            vx, vy, omega = solve_resisted(state, mass, inertia, acc, dt)
            if abs(vx - ux) + abs(vy - uy) + abs(omega - turn) < SAME * dt:
                break
            fresh = sweep == 0 and mass * (vx * ux + vy * uy) + inertia * omega * turn < 0.0
            if fresh:  # Friction of a slide turns it about: rather than that, it stands.
                vx, vy, omega = 0.0, 0.0, 0.0
    else:
        vx, vy, omega = solve_resisted(state, mass, inertia, acc, dt)
    ax, ay, turned = (vx - state[3]) / dt, (vy - state[4]) / dt, (omega - state[5]) / dt
    state[3], state[4], state[5] = vx, vy, omega
    hold(p, state, c, s, mass, inertia, com, axes, dt)
    if p[at.MU_GROUND] > 0.0:
        ground = p[at.MU_GROUND] * GRAVITY * dt
        speed = math.sqrt(state[3] ** 2 + state[4] ** 2 + inertia / mass * state[5] ** 2)
        kept = 1.0 - ground / speed if speed > ground else 0.0
        state[3] *= kept
        state[4] *= kept
        state[5] *= kept
    return ax, ay, turned


@njit(**LEAF, forceinline=True)
def remember(
    p: Array,
    state: Array,
    ax: float,
    ay: float,
    turned: float,
    c: float,
    s: float,
    com: Array,
    outline: Array,
    feet: Array,
    dt: float,
    damped: float,
) -> None:
    """Move what else there is by `dt` [s]: a load by the body's acceleration, casters and a crate by its velocity."""
    if p[at.SLOSH_MASS] > 0.0:
        swing_load(p, state, ax, ay, turned, c, s, com, dt)
    if on_casters(p):
        turn_casters(p, state, c, s, com, feet, dt)
    if p[at.UNSEEN_FORCE] > 0.0:
        move_crate(p, outline, state, c, s, com, dt, damped)


@njit(**LEAF, forceinline=True)
def step_body(
    p: Array,
    state: Array,
    wrench: Array,
    time: float,
    mass: float,
    inertia: float,
    com: Array,
    pivot: Array,
    outline: Array,
    feet: Array,
    axes: Array,
    acc: Array,
    room: Array,
    dt: float,
) -> tuple[float, float]:
    """Move a state (STATE,) one step on; return cosine and sine of its heading.

    Args:
        p: (WIDTH,) parameter row.
        state: changed.
        wrench: (3,) at the centre of mass in world axes [N, N, N m].
        time: [s].
        mass: [kg] now.
        inertia: [kg m^2] now.
        com: (2,) centre of mass in the body's frame [m] now.
        pivot: (3,) see `contacts`.
        outline: (E, 2) footprint.
        feet: (F, 2) points that carry the load.
        axes: (7,) see `fixed_axes`.
        acc: (9,) written, see `account_kernel`.
        room: (F + 1, FOOT) written, see `laws_kernel.lay_feet`.
        dt: [s].
    """
    state[0] += state[3] * dt
    state[1] += state[4] * dt
    state[2] += state[5] * dt
    c, s = cos_sin(state[2])
    acc[0], acc[1], acc[2] = wrench[0], wrench[1], wrench[2]
    acc[3:] = 0.0
    springs(p, state, c, s, time, mass, com, dt, acc)
    contacts(p, state, c, s, mass, inertia, com, pivot, outline, dt, CRUSHING, acc)
    ax, ay, turned = respond(p, state, c, s, mass, inertia, com, feet, axes, acc, room, dt)
    remember(p, state, ax, ay, turned, c, s, com, outline, feet, dt, CRUSHING)
    return c, s
