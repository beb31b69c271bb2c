"""Compiled: what every effect does to a body at one moment, as forces and as resistances.

Laws write into an account, see `account_kernel`; those of contacts are in `contact_kernel`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import CREEP, SETTLING, push, resist
from pbrl_mismatch.kernels.friction_kernel import ROLLS, RUBS, SCRUBS, TWISTS, bent, rub_along, rub_in_ellipse, weight
from pbrl_mismatch.kernels.holding_kernel import hold_wheel, patch_share
from pbrl_mismatch.kernels.own_kernel import how_many, own_laws
from pbrl_mismatch.kernels.state import CASTERS, FIRST_CASTER, SLOSH

Array = NDArray[np.float64]

BACKWARDS, TURNS_OVER = -1.0 + 1e-7, 4000.0
"""A caster whose turn has a cosine below this goes backwards, and still turns over: by so much of a tangent of half."""
SWITCHING = 0.1
"""What begins at some moment comes on within this time [s]: a fit needs a slope."""


@njit(**LEAF, forceinline=True)
def between(time: float, start: float, end: float) -> float:
    """Return 1 within an interval of time, 0 outside, with edges so soft that a fit has a slope."""
    if time < start - 0.5 * SWITCHING or time > end + 0.5 * SWITCHING:
        return 0.0
    return min((time - start) / SWITCHING + 0.5, (end - time) / SWITCHING + 0.5, 1.0)


@njit(**LEAF, forceinline=True)
def swivel(ex: float, ey: float, ux: float, uy: float, way: float) -> tuple[float, float]:
    """Return a caster's direction after its pivot has gone `way` trails along the unit vector (ux, uy).

    Exact for a straight way: the tangent of half the angle that is left to turn shrinks by exp(-way).

    Args:
        ex: cosine of its heading.
        ey: sine of it.
        ux: direction of the pivot's velocity.
        uy: as `ux`.
        way: over the trail.
    """
    ahead, aside = ex * ux + ey * uy, ex * uy - ey * ux
    half = aside / (1.0 + ahead) if ahead > BACKWARDS else math.copysign(TURNS_OVER, aside)
    half *= math.exp(-way)
    square = half * half
    c, s = (1.0 - square) / (1.0 + square), 2.0 * half / (1.0 + square)
    return c * ux + s * uy, c * uy - s * ux


@njit(**LEAF, forceinline=True)
def springs(
    p: Array,
    state: Array,
    c: float,
    s: float,
    time: float,
    mass: float,
    com: Array,
    dt: float,
    acc: Array,
) -> None:
    """Add what depends on place and time, and drag: slope, pushes from outside, cords, catches, a swing.

    Args:
        p: (WIDTH,) parameter row.
        state: (STATE,) of the centre of mass and of what else moves.
        c: cosine of the heading.
        s: sine of the heading.
        time: [s] on the recording's clock.
        mass: [kg] now.
        com: (2,) centre of mass in the body's frame [m] now.
        dt: [s].
        acc: (9,) account.
    """
    acc[3] += p[at.DRAG_LINEAR]
    acc[5] += p[at.DRAG_LINEAR]
    acc[8] += p[at.DRAG_TURN]
    down = weight(p, mass)
    on = between(time, p[at.FORCE_START], p[at.FORCE_END])
    acc[0] += down * p[at.SLOPE_X] + on * p[at.STEADY_X]
    acc[1] += down * p[at.SLOPE_Y] + on * p[at.STEADY_Y]
    acc[2] += on * p[at.STEADY_TORQUE]
    if p[at.PERIODIC_FREQUENCY] > 0.0 and on > 0.0:
        wave = on * math.sin(2.0 * math.pi * p[at.PERIODIC_FREQUENCY] * time + p[at.PERIODIC_PHASE])
        acc[0] += wave * p[at.PERIODIC_X]
        acc[1] += wave * p[at.PERIODIC_Y]
        acc[2] += wave * p[at.PERIODIC_TORQUE]
    if p[at.TETHER_STIFFNESS] > 0.0:
        ax, ay = p[at.TETHER_AT_X] - com[0], p[at.TETHER_AT_Y] - com[1]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        dx, dy = state[0] + rx - p[at.TETHER_X], state[1] + ry - p[at.TETHER_Y]
        length = math.sqrt(dx * dx + dy * dy)
        if length > p[at.TETHER_LENGTH] and length > 1e-9:
            nx, ny, k = dx / length, dy / length, p[at.TETHER_STIFFNESS]
            force = -k * (length - p[at.TETHER_LENGTH])
            push(acc, rx, ry, force * nx, force * ny)
            resist(acc, rx, ry, nx, ny, k * (dt + SETTLING))
    if p[at.DETENT_FORCE] != 0.0:
        ax, ay = p[at.DETENT_AT_X] - com[0], p[at.DETENT_AT_Y] - com[1]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        dx, dy = state[0] + rx - p[at.DETENT_X], state[1] + ry - p[at.DETENT_Y]
        near = (dx * dx + dy * dy) / p[at.DETENT_WIDTH] ** 2
        k = p[at.DETENT_FORCE] / p[at.DETENT_WIDTH] * math.exp(0.5 - 0.5 * near)
        push(acc, rx, ry, -k * dx, -k * dy)
        if k > 0.0 and near < 1.0:
            resist(acc, rx, ry, 1.0, 0.0, k * dt)
            resist(acc, rx, ry, 0.0, 1.0, k * dt)
    if p[at.SLOSH_MASS] > 0.0:
        rate = 2.0 * math.pi * p[at.SLOSH_FREQUENCY]
        k, d = p[at.SLOSH_MASS] * rate * rate, 2.0 * p[at.SLOSH_MASS] * p[at.SLOSH_DAMPING] * rate
        ax, ay = p[at.SLOSH_X] - com[0], p[at.SLOSH_Y] - com[1]
        fx, fy = k * state[SLOSH] + d * state[SLOSH + 2], k * state[SLOSH + 1] + d * state[SLOSH + 3]
        push(acc, c * ax - s * ay, s * ax + c * ay, fx, fy)
    if how_many() > 0:
        own_laws(p, state, c, s, time, com, acc)


@njit(**LEAF, forceinline=True)
def on_casters(p: Array) -> bool:
    """Tell whether the feet are casters."""
    return p[at.CASTER_ROLL] > 0.0 or p[at.CASTER_SCRUB] > 0.0 or p[at.CASTER_TWIST] > 0.0


@njit(**LEAF, forceinline=True)
def roll_on(p: Array, room: Array, i: int, ux: float, uy: float, omega: float, fresh: bool, acc: Array) -> None:
    """Add what a trailing caster resists: the wheel's rolling, the tread's twist, and the bearing of the fork.

    The wheel rolls, so that the fork turns by the pivot's speed across over the trail. The bearing rubs by how much
    faster than the body that is: as if the body's point over the wheel were held across. The tread is twisted by the
    turn itself, the less the more fresh tread is laid down meanwhile.

    Args:
        p: (WIDTH,) parameter row.
        room: (n, FOOT), see `FOOT`.
        i: row of its foot.
        ux: velocity of the pivot [m/s].
        uy: as `ux`.
        omega: of the body [rad/s].
        fresh: see `friction_kernel.bent`.
        acc: (9,) account.
    """
    trail, rx, ry, load, ex, ey = p[at.CASTER_TRAIL], room[i, 0], room[i, 1], room[i, 3], room[i, 4], room[i, 5]
    along, across = ux * ex + uy * ey, uy * ex - ux * ey
    rub_along(acc, room, i, ROLLS, rx, ry, ex, ey, p[at.CASTER_ROLL] * load, along, fresh)
    if p[at.CASTER_SCRUB] > 0.0:
        slip, limit = across - trail * omega, p[at.CASTER_SCRUB] * load
        rub_along(acc, room, i, SCRUBS, rx - trail * ex, ry - trail * ey, -ey, ex, limit, slip, fresh)
    if p[at.CASTER_TWIST] > 0.0:
        laid = abs(along) * trail / p[at.CASTER_LAY]
        if laid * laid > across * across + CREEP * CREEP:
            resist(acc, rx, ry, -ey, ex, p[at.CASTER_TWIST] * load / laid)
            room[i, TWISTS], room[i, TWISTS + 1] = across, 0.0  # should an iteration find that it is laid down no more
        else:
            rub_along(acc, room, i, TWISTS, rx, ry, -ey, ex, p[at.CASTER_TWIST] * load, across, fresh)


@njit(**LEAF, forceinline=True)
def dry(p: Array) -> bool:
    """Tell whether any dry friction of the effects is on: its direction is that of the velocity it leads to."""
    floor = p[at.SLIDE_MU] + p[at.BREAKAWAY_MU] + abs(p[at.PATCH_MU])
    return on_casters(p) or floor + p[at.WHEEL2_MU_X] + max(p[at.WHEEL2_MU_Y], 0.0) > 0.0


@njit(**LEAF)
def tilt(
    p: Array, c: float, s: float, fx: float, fy: float, weight: float, feet: Array
) -> tuple[float, float, float, float]:
    """Return the feet's middle (x, y) [m] and how a foot's share of the load changes with its place from there [1/m].

    A force (fx, fy) in world axes at a height over the floor tips the body: its load moves along the force.
    """
    count = feet.shape[0]
    ox, oy, xx, yy = 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        ox += feet[i, 0] / count
        oy += feet[i, 1] / count
    for i in range(count):
        xx += (feet[i, 0] - ox) ** 2 / count
        yy += (feet[i, 1] - oy) ** 2 / count
    lever = p[at.LOAD_HEIGHT] / weight
    x, y = p[at.LOAD_X] + lever * (c * fx + s * fy), p[at.LOAD_Y] + lever * (c * fy - s * fx)
    return ox, oy, x / xx, y / yy


@njit(**LEAF, forceinline=True)
def on_feet(p: Array) -> bool:
    """Tell whether the feet resist."""
    return p[at.SLIDE_MU] > 0.0 or p[at.BREAKAWAY_MU] > 0.0 or p[at.PATCH_MU] != 0.0 or on_casters(p)


@njit(**LEAF)
def lay_feet(
    p: Array,
    state: Array,
    c: float,
    s: float,
    mass: float,
    com: Array,
    feet: Array,
    axes: Array,
    now: Array,
    acc: Array,
    room: Array,
) -> None:
    """Write what every foot's friction takes from where the body is and how fast it goes now, see `FOOT`.

    What breaks away is held by as much as at the speed of now: solved for, it would be stuck or loose, and which of
    them would be chance.

    Args:
        p: see `springs`, and so are those not named here.
        state: see `springs`.
        c: see `springs`.
        s: see `springs`.
        mass: see `springs`.
        com: see `springs`.
        feet: (F, 2) points in the body's frame that share the load [m].
        axes: (7,) see `fixed_axes`.
        now: (3,) velocity of the centre of mass [m/s] and turning [rad/s].
        acc: (9,) account, of which the force tips the body.
        room: (F + 2, FOOT) of which the first six numbers of the feet are written.
    """
    count = feet.shape[0]
    even, ox, oy, gx, gy = weight(p, mass) / count, 0.0, 0.0, 0.0, 0.0
    rolls = on_casters(p)
    if p[at.LOAD_X] != 0.0 or p[at.LOAD_Y] != 0.0 or p[at.LOAD_HEIGHT] > 0.0:
        ox, oy, gx, gy = tilt(p, c, s, acc[0], acc[1], even * count, feet)
    for i in range(count):
        load = even * max(1.0 + gx * (feet[i, 0] - ox) + gy * (feet[i, 1] - oy), 0.0)
        ax, ay = p[at.SLIDE_EXTENT] * feet[i, 0] - com[0], p[at.SLIDE_EXTENT] * feet[i, 1] - com[1]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        mu = p[at.SLIDE_MU]
        if p[at.PATCH_MU] != 0.0:
            mu += p[at.PATCH_MU] * patch_share(p, axes[5], axes[6], state[0] + rx, state[1] + ry)
        if p[at.BREAKAWAY_MU] > 0.0:
            ux, uy = now[0] - now[2] * ry, now[1] + now[2] * rx
            mu += p[at.BREAKAWAY_MU] * math.exp(-(ux * ux + uy * uy) / p[at.BREAKAWAY_SPEED] ** 2)
        room[i, 0], room[i, 1], room[i, 2], room[i, 3] = rx, ry, mu * load, load
        if rolls and i < CASTERS:
            room[i, 4], room[i, 5] = state[FIRST_CASTER + 2 * i], state[FIRST_CASTER + 2 * i + 1]


@njit(**LEAF, forceinline=True)
def resistances(
    p: Array,
    c: float,
    s: float,
    vx: float,
    vy: float,
    omega: float,
    mass: float,
    com: Array,
    axes: Array,
    room: Array,
    wheel: bool,
    fresh: bool,
    acc: Array,
) -> None:
    """Add dry friction at every foot, at the second wheel, and at the baseline's where `wheel` says so.

    Args:
        p: see `springs`, and so are those not named here.
        c: see `springs`.
        s: see `springs`.
        vx: velocity of the centre of mass at which the sliding speeds are taken [m/s].
        vy: as `vx`.
        omega: [rad/s].
        mass: see `springs`.
        com: see `springs`.
        axes: (7,) see `fixed_axes`.
        room: (F + 2, FOOT), see `FOOT`.
        wheel: whether `lay_wheel` was asked.
        fresh: see `friction_kernel.bent`.
        acc: (9,) account.
    """
    if on_feet(p):
        rolls = on_casters(p)
        # Summed here and added once: nine sums in memory, foot after foot, took half as long again.
        fx, fy, torque, xx, xy, yy, xt, yt, tt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(room.shape[0] - 2):
            rx, ry, limit = room[i, 0], room[i, 1], room[i, 2]
            ux, uy = vx - omega * ry, vy + omega * rx
            if limit > 0.0:
                f, g, k, m, n = bent(room, i, RUBS, ux, uy, CREEP, fresh)
                f, g, k, m, n = limit * f, limit * g, limit * k, limit * m, limit * n
                first, second = m * rx - k * ry, n * rx - m * ry
                fx, fy, torque = fx + f, fy + g, torque + rx * g - ry * f
                xx, xy, yy, xt, yt = xx + k, xy + m, yy + n, xt + first, yt + second
                tt += second * rx - first * ry
            if rolls and i < CASTERS:
                roll_on(p, room, i, ux, uy, omega, fresh, acc)
        acc[0] -= fx
        acc[1] -= fy
        acc[2] -= torque
        acc[3] += xx
        acc[4] += xy
        acc[5] += yy
        acc[6] += xt
        acc[7] += yt
        acc[8] += tt
    down = weight(p, mass)
    along, across = down * p[at.WHEEL2_MU_X], down * p[at.WHEEL2_MU_Y]
    if along > 0.0 or across > 0.0:
        # One limit alone is that in both axes.
        across = along if across < 0.0 else across
        ax, ay, wc, ws = p[at.WHEEL2_X] - com[0], p[at.WHEEL2_Y] - com[1], axes[2], axes[3]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        ex, ey, ux, uy = c * wc - s * ws, s * wc + c * ws, vx - omega * ry, vy + omega * rx
        rub_in_ellipse(acc, room, room.shape[0] - 2, RUBS, rx, ry, ex, ey, along, across, ux, uy, fresh)
    if wheel:
        hold_wheel(p, vx, vy, omega, room, fresh, acc)
