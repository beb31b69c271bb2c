"""Compiled: from what sensors say to what acts: faults of sensors undone, mass and its centre now, start states.

`felt` (T, 3) is the wrench in the sensor's axes (planar), `mount` (T, 5) cosine and sine of the sensor's turn, its
place from the nominal centre of mass as tags saw it [m], world axes, and how long ago it was read at rest [s].
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.laws_kernel import SWITCHING, between
from pbrl_model.kernel import cos_sin

Array = NDArray[np.float64]


@njit(**LEAF, forceinline=True)
def load_now(p: Array, time: float, body: Array, com: Array) -> tuple[float, float]:
    """Return mass [kg] and moment of inertia [kg m^2]; write the centre of mass in the body's frame (2,).

    A load that swings is part of what the body weighs, and moves by itself: the rest has the rest of the mass.

    Args:
        p: (WIDTH,) parameter row.
        time: [s].
        body: (4,) nominal inertia over mass [m^2], nominal centre of mass (x, y) [m], dt [s].
        com: (2,) written.
    """
    mass = p[at.MASS]
    inertia = mass * body[0] * p[at.INERTIA_FACTOR]
    com[0], com[1] = body[1] + p[at.COM_X], body[2] + p[at.COM_Y]
    if p[at.SLOSH_MASS] > 0.0:
        mass = max(mass - p[at.SLOSH_MASS], 0.2 * mass)
        inertia *= mass / p[at.MASS]
    if p[at.PAYLOAD_MASS] != 0.0:
        share = min(max((time - p[at.PAYLOAD_TIME]) / SWITCHING + 0.5, 0.0), 1.0)
        share = 1.0 - share if p[at.PAYLOAD_GONE] > 0.0 else share
        load = max(share * p[at.PAYLOAD_MASS], -0.8 * mass)
        dx, dy = p[at.PAYLOAD_X] - com[0], p[at.PAYLOAD_Y] - com[1]
        mass += load
        inertia += load * (dx * dx + dy * dy) * (1.0 - load / mass)
        inertia = max(inertia, 0.2 * mass * body[0])
        com[0] += dx * load / mass
        com[1] += dy * load / mass
    return mass, inertia


@njit(**LEAF, forceinline=True)
def offset(p: Array, time: float, since: float) -> tuple[float, float, float]:
    """Return what a sensor reads too much, in its axes [N, N, N m], `since` seconds after it was read at rest.

    One that came on before it was read at rest is known, and taken off.
    """
    on = 1.0
    if p[at.BIAS_START] > -math.inf:
        on = between(time, p[at.BIAS_START], math.inf) - between(time - since, p[at.BIAS_START], math.inf)
    return (
        on * p[at.BIAS_X] + p[at.DRIFT_X] * since,
        on * p[at.BIAS_Y] + p[at.DRIFT_Y] * since,
        on * p[at.BIAS_TORQUE] + p[at.DRIFT_TORQUE] * since,
    )


@njit(**LEAF, forceinline=True)
def feel(p: Array, force: Array, c: float, s: float, time: float, since: float, out: Array) -> None:
    """Write what the sensor says (3,) of a force and torque at it (3,) in world axes: `acting`, the other way round.

    Args:
        p: (WIDTH,) parameter row.
        force: (3,) [N, N, N m].
        c: cosine of the sensor's turn, as it is believed to be.
        s: sine of it.
        time: [s].
        since: how long ago it was read at rest [s].
        out: (3,) written.
    """
    tc, ts = math.cos(p[at.SENSOR_TURN]), math.sin(p[at.SENSOR_TURN])
    bx, by = c * force[0] + s * force[1], -s * force[0] + c * force[1]
    torque_scale = p[at.TORQUE_SCALE] if p[at.TORQUE_SCALE] > 0.0 else p[at.FORCE_SCALE]
    ox, oy, turning = offset(p, time, since)
    out[0] = p[at.FORCE_SCALE] * (tc * bx - ts * by) + ox
    out[1] = p[at.FORCE_SCALE] * (ts * bx + tc * by) + oy
    out[2] = torque_scale * force[2] + turning


@njit(**LEAF, forceinline=True)
def acting(
    p: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    t: int,
    first: int,
    last: int,
    time: float,
    body: Array,
    com: Array,
    out: Array,
) -> None:
    """Write the wrench at the centre of mass in world axes (3,) of step `t` into `out`.

    Args:
        p: (WIDTH,) parameter row.
        felt: (T, 3).
        mount: (T, 5).
        seen: (T, 6) smoothed states of the nominal centre of mass.
        t: step.
        first: first step of the episode.
        last: last step of the episode.
        time: of the step [s].
        body: see `load_now`.
        com: (2,) centre of mass in the body's frame [m].
        out: (3,) written.
    """
    late = (p[at.DELAY] + p[at.TIME_OFFSET]) / body[3]
    before, share = t, 0.0
    if late != 0.0:
        place = min(max(t - late, first), last)
        before = min(math.floor(place), last - 1) if last > first else first
        share = place - before if last > first else 0.0
    after = min(before + 1, last)
    ox, oy, turning = offset(p, time, mount[t, 4])
    fx = felt[before, 0] + share * (felt[after, 0] - felt[before, 0]) - ox
    fy = felt[before, 1] + share * (felt[after, 1] - felt[before, 1]) - oy
    tau = felt[before, 2] + share * (felt[after, 2] - felt[before, 2]) - turning
    torque_scale = p[at.TORQUE_SCALE] if p[at.TORQUE_SCALE] > 0.0 else p[at.FORCE_SCALE]
    fx, fy, tau = fx / p[at.FORCE_SCALE], fy / p[at.FORCE_SCALE], tau / torque_scale
    pc, ps = mount[t, 0], mount[t, 1]
    if p[at.SENSOR_TURN] != 0.0:
        tc, ts = math.cos(p[at.SENSOR_TURN]), math.sin(p[at.SENSOR_TURN])
        pc, ps = pc * tc + ps * ts, ps * tc - pc * ts
    out[0], out[1] = pc * fx - ps * fy, ps * fx + pc * fy
    ax, ay = mount[t, 2], mount[t, 3]
    moved = p[at.TAG_X] != 0.0 or p[at.TAG_Y] != 0.0 or p[at.TAG_THETA] != 0.0
    if moved or com[0] != body[1] or com[1] != body[2]:
        c, s = math.cos(seen[t, 2]), math.sin(seen[t, 2])
        ax += c * body[1] - s * body[2]
        ay += s * body[1] + c * body[2]
        c, s = math.cos(seen[t, 2] - p[at.TAG_THETA]), math.sin(seen[t, 2] - p[at.TAG_THETA])
        bx, by = p[at.TAG_X] - com[0], p[at.TAG_Y] - com[1]
        ax += c * bx - s * by
        ay += s * bx + c * by
    out[2] = tau + ax * out[1] - ay * out[0]


@njit(**LEAF)
def to_truth(p: Array, told: Array, body: Array, com: Array, state: Array) -> None:
    """Write where the true centre of mass is (6,) for a state of the nominal one as tags saw it (6,)."""
    for k in range(6):
        state[k] = told[k]
    c, s = math.cos(told[2]), math.sin(told[2])
    state[2] -= p[at.TAG_THETA]
    tc, ts = math.cos(state[2]), math.sin(state[2])
    bx, by = com[0] - p[at.TAG_X], com[1] - p[at.TAG_Y]
    dx = tc * bx - ts * by - c * body[1] + s * body[2]
    dy = ts * bx + tc * by - s * body[1] - c * body[2]
    state[0] += dx
    state[1] += dy
    state[3] -= told[5] * dy
    state[4] += told[5] * dx


@njit(**LEAF, forceinline=True)
def as_seen(p: Array, state: Array, com: Array, out: Array) -> None:
    """Write the pose of the body's frame (3,) as tags would see it."""
    c, s = cos_sin(state[2])
    bx, by = p[at.TAG_X] - com[0], p[at.TAG_Y] - com[1]
    out[0] = state[0] + c * bx - s * by
    out[1] = state[1] + s * bx + c * by
    out[2] = state[2] + p[at.TAG_THETA]
