"""Compiled: a crate, square or round, that a footprint pushes along, and turns where it pushes beside its middle.

Friction under the crate holds it, and lets it slide and turn, as `limit_surface_kernel` says. It has a mass, F over its
friction coefficient and g: it takes a force to set it going, and it slides on when the body stops. It is pushed at some
height: its load moves ahead, and what friction turns it about with it. Contacts are damped springs without friction,
for a square at the corners of either that are in the other. A step is implicit in the crate's twist and linear in its
contacts.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.limit_surface_kernel import Six, Three, inverse, slid, times
from pbrl_mismatch.kernels.outline_kernel import disc_contact, nearest_edge
from pbrl_mismatch.kernels.state import UNSEEN
from pbrl_model.kernel import GRAVITY

Array = NDArray[np.float64]

ROUND = -10.0
"""An `unseen_angle` at or below it means a disc."""
STIFFNESS = 5000.0
"""Of the contact with an unseen body [N/m]."""
CRUSHING = 0.1
"""Damping of that contact over its stiffness [s]: what is met does not spring back."""
LEANING, FOLLOWING = 0.3, 0.02
"""The same along a recorded path: of what presses back on a body, whose place is less sure there than that something
holds it; and of a crate that gives way to it, whose speed is less sure than its place."""
ON_CORNERS, ON_AN_EDGE = 1.41, 1.0
"""a over half a side of a square whose load rests on its corners, and of one that is about to tip."""
LIGHTEST = 0.01
"""Mass of a crate at least [kg]: what weighs nothing has no twist of its own."""
CREEPS = 1e-3
"""A crate slower than this [m/s] leans as it is pressed alone."""

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
def leant_on(p: Array, outline: Array, state: Array, c: float, s: float, com: Array) -> Pressed:
    """Do what `pressed` does for a round crate, which nothing turns."""
    radius, x, y = p[at.UNSEEN_RADIUS], state[UNSEEN], state[UNSEEN + 1]
    depth, _, _, nx, ny = disc_contact(outline, state, c, s, com, x, y, radius)
    if depth <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    force = STIFFNESS * depth
    xx, xy, yy = STIFFNESS * nx * nx, STIFFNESS * nx * ny, STIFFNESS * ny * ny
    return force * nx, force * ny, 0.0, xx, xy, yy, 0.0, 0.0, 0.0


@njit(**LEAF, forceinline=True)
def met(p: Array, outline: Array, state: Array, c: float, s: float, com: Array) -> Pressed:
    """Return what `pressed` does, of a crate of either shape."""
    if p[at.UNSEEN_ANGLE] > ROUND:
        return pressed(p, outline, state, c, s, com)
    return leant_on(p, outline, state, c, s, com)


@njit(**LEAF)
def footing(p: Array, state: Array, fx: float, fy: float) -> Three:
    """Return a [m] of a crate's limit surface and how far its load's middle is from its own, world axes [m].

    A force f at height h over a floor that rubs with r at the bottom moves the load by h (f + r) / (2 m g), half of
    each as the middle is accelerated by their difference: at most, where both are F, `unseen_tip` times half a side.

    Args:
        p: (WIDTH,) parameter row.
        state: (STATE,).
        fx: what presses on it, world axes [N].
        fy: as `fx`.
    """
    half = p[at.UNSEEN_RADIUS]
    if p[at.UNSEEN_ANGLE] <= ROUND:
        return half, 0.0, 0.0
    tip = min(p[at.UNSEEN_TIP], 1.0)
    far, size = tip * half, max(math.sqrt(fx * fx + fy * fy), p[at.UNSEEN_FORCE])
    ox, oy = far * fx / size, far * fy / size
    speed = math.sqrt(state[UNSEEN + 3] ** 2 + state[UNSEEN + 4] ** 2)
    if speed > CREEPS:
        ox, oy = 0.5 * (ox + far * state[UNSEEN + 3] / speed), 0.5 * (oy + far * state[UNSEEN + 4] / speed)
    return half * (ON_CORNERS + tip * (ON_AN_EDGE - ON_CORNERS)), ox, oy


@njit(**LEAF, forceinline=True)
def weighed(p: Array, dt: float) -> tuple[float, float]:
    """Return a crate's mass [kg] and moment of inertia about its middle [kg m^2], over `dt` [s]."""
    half, force = p[at.UNSEEN_RADIUS], p[at.UNSEEN_FORCE]
    mass = max(force / (GRAVITY * p[at.UNSEEN_FRICTION]), LIGHTEST) / dt
    return mass, (2.0 / 3.0 if p[at.UNSEEN_ANGLE] > ROUND else 0.5) * mass * half * half


@njit(**LEAF, forceinline=True)
def coasts(p: Array, state: Array, mass: float, inertia: float) -> Three:
    """Return the twist of a crate that nothing presses on, of a mass and inertia over the time that it coasts for."""
    if state[UNSEEN + 3] == 0.0 and state[UNSEEN + 4] == 0.0 and state[UNSEEN + 5] == 0.0:
        return 0.0, 0.0, 0.0
    lever, ox, oy = footing(p, state, 0.0, 0.0)
    x, y, m = mass * state[UNSEEN + 3], mass * state[UNSEEN + 4], inertia * state[UNSEEN + 5]
    return slid((mass, 0.0, mass, 0.0, 0.0, inertia), x, y, m, p[at.UNSEEN_FORCE], lever, ox, oy)[1]


@njit(**LEAF, forceinline=True)
def driven(
    p: Array, state: Array, found: Pressed, mass: float, inertia: float, give: float
) -> tuple[Six, Six, Three, tuple[float, Three, Three]]:
    """Return how a crate goes beside a body that goes as its twist says and presses on it.

    Args:
        p: (WIDTH,) parameter row.
        state: (STATE,).
        found: what springs press, and their stiffness.
        mass: of the crate over the step, see `weighed`.
        inertia: as `mass`.
        give: time in which contacts answer, with their damping [s].

    Returns:
        K, what resists closing; A of `slid`; b without what the motion of the body adds; and what `slid` finds.
    """
    fx, fy, fm, xx, xy, yy, xm, ym, mm = found
    qx, qy = state[UNSEEN] - state[0], state[UNSEEN + 1] - state[1]
    k = (give * xx, give * xy, give * yy, give * xm, give * ym, give * mm)
    a = (k[0] + mass, k[1], k[2] + mass, k[3], k[4], k[5] + inertia)
    bx, by = mass * state[UNSEEN + 3] + fx, mass * state[UNSEEN + 4] + fy
    bm = inertia * state[UNSEEN + 5] + fm
    px, py, pm = times(k, state[3] - state[5] * qy, state[4] + state[5] * qx, state[5])
    hx, hy, _ = times(k, state[UNSEEN + 3], state[UNSEEN + 4], state[UNSEEN + 5])
    lever, ox, oy = footing(p, state, fx + px - hx, fy + py - hy)
    return k, a, (bx, by, bm), slid(a, bx + px, by + py, bm + pm, p[at.UNSEEN_FORCE], lever, ox, oy)


@njit(**LEAF)
def crate_contact(
    p: Array,
    outline: Array,
    state: Array,
    c: float,
    s: float,
    mass: float,
    inertia: float,
    com: Array,
    dt: float,
    damped: float,
    acc: Array,
) -> None:
    """Add what a crate presses back; arguments as of `contact_kernel.contacts`.

    They press on each other where they would run into each other if each went on alone. Whether the crate slides is
    foreseen under the twist that the body has; if so, its friction stays what it is then, and it goes along with what
    the body does besides as its mass lets it.
    """
    found = met(p, outline, state, c, s, com)
    fx, fy, fm = found[0], found[1], found[2]
    if found[3] + found[5] <= 0.0:
        return
    # From the body's centre of mass to the crate's middle.
    qx, qy = state[UNSEEN] - state[0], state[UNSEEN + 1] - state[1]
    heavy, turning = weighed(p, dt)
    give, w = dt + damped, coasts(p, state, heavy, turning)
    vx, vy, omega = state[3] + dt * acc[0] / mass, state[4] + dt * acc[1] / mass, state[5] + dt * acc[2] / inertia
    closing = fx * (vx - omega * qy - w[0]) + fy * (vy + omega * qx - w[1]) + fm * (omega - w[2])
    if fx * fx + fy * fy + STIFFNESS * give * closing <= 0.0:
        return
    k, a, (bx, by, bm), (speed, _, r) = driven(p, state, found, heavy, turning, give)
    if speed > 0.0:
        n = inverse(a)
        ux, uy, um = times(n, bx - r[0], by - r[1], bm - r[2])
        gx, gy, gm = times(k, ux, uy, um)
        fx, fy, fm = fx - gx, fy - gy, fm - gm
        # K - K A^-1 K, of which the last is what it gives way by.
        x0, x1, x2 = times(n, k[0], k[1], k[3])
        y0, y1, y2 = times(n, k[1], k[2], k[4])
        m0, m1, m2 = times(n, k[3], k[4], k[5])
        lxx, lxy, _ = times(k, x0, x1, x2)
        _, lyy, _ = times(k, y0, y1, y2)
        lxm, lym, lmm = times(k, m0, m1, m2)
        k = (k[0] - lxx, k[1] - lxy, k[2] - lyy, k[3] - lxm, k[4] - lym, k[5] - lmm)
    acc[0] -= fx
    acc[1] -= fy
    acc[2] -= fm + qx * fy - qy * fx
    mx, my = k[3] + qx * k[1] - qy * k[0], k[4] + qx * k[2] - qy * k[1]
    acc[3] += k[0]
    acc[4] += k[1]
    acc[5] += k[2]
    acc[6] += mx
    acc[7] += my
    acc[8] += k[5] + qx * k[4] - qy * k[3] + qx * my - qy * mx


@njit(**LEAF)
def move_crate(
    p: Array, outline: Array, state: Array, c: float, s: float, com: Array, dt: float, damped: float
) -> None:
    """Let a crate go on for `dt` [s] beside a body that goes as its twist says, in reach of it or not.

    Args:
        p: see `pressed`, and so are those up to `com`.
        outline: see `pressed`.
        state: changed.
        c: see `pressed`.
        s: see `pressed`.
        com: see `pressed`.
        dt: [s].
        damped: `CRUSHING`, or `FOLLOWING` along a recorded path [s].
    """
    found = met(p, outline, state, c, s, com)
    fx, fy, fm = found[0], found[1], found[2]
    mass, inertia = weighed(p, dt)
    w = coasts(p, state, mass, inertia)
    if found[3] + found[5] > 0.0:
        qx, qy = state[UNSEEN] - state[0], state[UNSEEN + 1] - state[1]
        vx, vy, omega, give = state[3] - state[5] * qy, state[4] + state[5] * qx, state[5], dt + damped
        closing = fx * (vx - w[0]) + fy * (vy - w[1]) + fm * (omega - w[2])
        if fx * fx + fy * fy + STIFFNESS * give * closing > 0.0:
            w = driven(p, state, found, mass, inertia, give)[3][1]
    for i in range(3):
        state[UNSEEN + 3 + i] = w[i]
        state[UNSEEN + i] += w[i] * dt
