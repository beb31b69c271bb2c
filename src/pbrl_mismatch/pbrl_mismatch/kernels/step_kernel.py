"""Compiled: one step of one body with every effect, in the order of `pbrl_model.kernel`.

The pose advances with the old velocity; forces act; resistances are solved for implicitly, the wheel's among them; then
impulses at the hinge and at a wheel beside which nothing resists, and friction of the whole body. With every effect off
a step is that of `pbrl_model.kernel`.
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
from pbrl_mismatch.kernels.friction_kernel import weight
from pbrl_mismatch.kernels.holding_kernel import has_wheel, hold, lay_wheel
from pbrl_mismatch.kernels.laws_kernel import dry, lay_feet, on_casters, on_feet, resistances, springs, swivel
from pbrl_mismatch.kernels.state import CASTERS, FIRST_CASTER, SLOSH
from pbrl_model.kernel import ERROR_BIAS, cos_sin

Array = NDArray[np.float64]

SWEEPS, SAME = 10, 3e-3
"""Times at most that dry friction is linearised anew at the velocity it leads to; a change of the acceleration below
this [m/s^2] ends it."""


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
    now: Array,
    acc: Array,
    room: Array,
    dt: float,
) -> tuple[float, float, float]:
    """Change the velocity by what is in an account, by dry friction, and by hinge and wheel.

    A wheel beside anything that resists is solved for together with that: one after the other, feet rub against where
    the wheel will not let them go.

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
        now: see `laws_kernel.lay_feet`.
        acc: (9,) account, see `laws_kernel`.
        room: (F + 2, FOOT), see `laws_kernel.lay_feet`.
        dt: in which that happens [s].

    Returns:
        The acceleration (x, y, turn).
    """
    vx, vy, omega = state[3], state[4], state[5]
    before_x, before_y, before = vx, vy, omega
    rubs, wheel = dry(p), has_wheel(p)
    coupled = wheel and (rubs or acc[3] + acc[5] + acc[8] > 0.0)
    if rubs or coupled:
        if on_feet(p):
            lay_feet(p, state, c, s, mass, com, feet, axes, now, acc, room)
        if coupled:
            lay_wheel(p, state, c, s, mass, com, axes, room)
        b0, b1, b2, b3, b4, b5, b6, b7, b8 = acc[0], acc[1], acc[2], acc[3], acc[4], acc[5], acc[6], acc[7], acc[8]
        fresh = True
        for sweep in range(SWEEPS):
            acc[0], acc[1], acc[2], acc[3], acc[4], acc[5], acc[6], acc[7], acc[8] = b0, b1, b2, b3, b4, b5, b6, b7, b8
            resistances(p, c, s, vx, vy, omega, mass, com, axes, room, coupled, fresh, acc)
            ux, uy, turn = vx, vy, omega
            vx, vy, omega = solve_resisted(state, mass, inertia, acc, dt)
            if abs(vx - ux) + abs(vy - uy) + abs(omega - turn) < SAME * dt:
                break
            fresh = sweep == 0 and mass * (vx * ux + vy * uy) + inertia * omega * turn < 0.0
            if fresh:  # Friction of a slide turns it about: rather than that, it stands.
                vx, vy, omega = 0.0, 0.0, 0.0
    else:
        vx, vy, omega = solve_resisted(state, mass, inertia, acc, dt)
    state[3], state[4], state[5] = vx, vy, omega
    hold(p, state, c, s, mass, inertia, com, axes, dt, wheel and not coupled)
    if p[at.MU_GROUND] > 0.0:
        ground = p[at.MU_GROUND] * weight(p, mass) / mass * dt
        speed = math.sqrt(state[3] ** 2 + state[4] ** 2 + inertia / mass * state[5] ** 2)
        kept = 1.0 - ground / speed if speed > ground else 0.0
        state[3] *= kept
        state[4] *= kept
        state[5] *= kept
    return (state[3] - before_x) / dt, (state[4] - before_y) / dt, (state[5] - before) / dt


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
        room: (F + 2, FOOT) written, see `laws_kernel.lay_feet`.
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
    ax, ay, turned = respond(p, state, c, s, mass, inertia, com, feet, axes, state[3:6], acc, room, dt)
    remember(p, state, ax, ay, turned, c, s, com, outline, feet, dt, CRUSHING)
    return c, s
