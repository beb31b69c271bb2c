"""Compiled: what every model would do to a body along one given path, as tags would see it."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels.contact_kernel import contacts
from pbrl_mismatch.kernels.crate_kernel import FOLLOWING, LEANING
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.laws_kernel import springs
from pbrl_mismatch.kernels.motion_kernel import BEGIN, LAST, rehearse, step_seen
from pbrl_mismatch.kernels.sense_kernel import acting, load_now, to_truth
from pbrl_mismatch.kernels.state import STATE
from pbrl_mismatch.kernels.step_kernel import fixed_axes, remember, respond
from pbrl_model.kernel import cos_sin

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REACTION = 0.05
"""Time in which dry friction and hard contacts answer to the path's speed [s]: where a body stands, what smoothing
leaves of its speed is stopped in that time and not within a step, which would be a blow."""


@njit(**LEAF)
def accelerate(
    p: Array,
    told: Array,
    before: Array,
    state: Array,
    extra: Array,
    step: int,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    com: Array,
    axes: Array,
    acc: Array,
    room: Array,
    wrench: Array,
    out: Array,
) -> None:
    """Write how a model accelerates the body at one moment, at the nominal centre of mass (3,).

    A centre of mass off the nominal one, or a tag that is, makes the true centre move on a path of its own; what it
    does is taken back to the point that tags see. Springs and dampers answer to where the body is and how fast it goes
    at once. Dry friction and hard contacts, which a millimetre more or less turns off or on, are solved for: within
    `REACTION`, in the middle of which the moment is.

    Args:
        p: (WIDTH,) parameter row.
        told: (6,) state of the nominal centre of mass, as tags would see it.
        before: (3,) how fast that went half a reaction before.
        state: (STATE,) of which what moves besides the body is read; the rest is left as the true centre of mass a
            step on, with the velocity of now.
        extra: (3,) wrench in world axes that is added.
        step: of the track.
        felt: see `simulate_serial`, and so are those up to `feet`.
        mount: see `simulate_serial`.
        seen: see `simulate_serial`.
        clock: see `simulate_serial`.
        span: (4,) of the episode.
        pivot: (3,).
        body: (4,).
        outline: (E, 2).
        feet: (F, 2).
        com: (2,) written, and so are those up to `out`.
        axes: (7,) read, see `fixed_axes`.
        acc: (9,).
        room: (F + 2, FOOT).
        wrench: (3,).
        out: (3,) [m/s^2, m/s^2, rad/s^2].
    """
    dt = body[3]
    mass, inertia = load_now(p, clock[step], body, com)
    to_truth(p, told, body, com, state)
    rx, ry, vx, vy, omega = told[0] - state[0], told[1] - state[1], state[3], state[4], state[5]
    acting(p, felt, mount, seen, step, span[BEGIN], span[LAST], clock[step], body, com, wrench)
    # As in `step_body`, forces act where the body is at the end of a step.
    state[0] += vx * dt
    state[1] += vy * dt
    state[2] += omega * dt
    c, s = cos_sin(state[2])
    acc[0], acc[1], acc[2] = wrench[0] + extra[0], wrench[1] + extra[1], wrench[2] + extra[2]
    acc[3:] = 0.0
    springs(p, state, c, s, clock[step], mass, com, dt, acc)
    acc[0] -= acc[3] * vx + acc[4] * vy + acc[6] * omega
    acc[1] -= acc[4] * vx + acc[5] * vy + acc[7] * omega
    acc[2] -= acc[6] * vx + acc[7] * vy + acc[8] * omega
    acc[3:] = 0.0
    ux, uy, turning = before[0] + before[2] * ry, before[1] - before[2] * rx, before[2]
    state[3], state[4], state[5] = ux, uy, turning
    contacts(p, state, c, s, mass, inertia, com, pivot, outline, REACTION, LEANING, acc)
    out[0], out[1], out[2] = vx, vy, omega
    _, _, _ = respond(p, state, c, s, mass, inertia, com, feet, axes, out, acc, room, REACTION)
    turn = (state[5] - turning) / REACTION
    out[0] = (state[3] - ux) / REACTION - turn * ry - omega * omega * rx
    out[1] = (state[4] - uy) / REACTION + turn * rx - omega * omega * ry
    out[2] = turn
    state[3], state[4], state[5] = vx, vy, omega


@njit(**LEAF)
def remember_along(
    p: Array, state: Array, path: Array, t: int, stride: int, com: Array, outline: Array, feet: Array, dt: float
) -> None:
    """Move what moves besides a body on a path (T, 6) from step `t` by a stride, `state` as `accelerate` left it."""
    after = min(t + stride, path.shape[0] - 1)
    passed = max(after - t, 1) * dt
    ax, ay = (path[after, 3] - path[t, 3]) / passed, (path[after, 4] - path[t, 4]) / passed
    turned, (c, s) = (path[after, 5] - path[t, 5]) / passed, cos_sin(state[2])
    remember(p, state, ax, ay, turned, c, s, com, outline, feet, passed, FOLLOWING)


@njit(**LEAF)
def half_a_reaction(dt: float) -> int:
    """Return in how many steps half of `REACTION` passes."""
    return round(0.5 * REACTION / dt)


@njit(cache=True, error_model="numpy", nogil=True)
def accelerate_along(
    rows: Array,
    path: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    stride: int,
    out: Array,
) -> None:
    """Write how each row's model accelerates the body along one path, see `accelerate`.

    Where the body is and how fast it goes is known along a path, and what else moves in it follows that.

    Args:
        rows: (P, WIDTH).
        path: (T, 6) states of the nominal centre of mass in one episode, as tags would see it.
        felt: see `simulate_serial`, and so are those up to `feet`.
        mount: see `simulate_serial`.
        seen: see `simulate_serial`.
        clock: see `simulate_serial`.
        span: (4,) of the episode.
        pivot: (3,).
        body: (4,).
        outline: (E, 2).
        feet: (F, 2).
        stride: every so many steps; what moves besides the body goes on by so much at a time.
        out: (P, ceil(T / stride), 3) [m/s^2, m/s^2, rad/s^2], written.
    """
    state, com, acc, wrench, extra = np.zeros(STATE), np.empty(2), np.empty(9), np.empty(3), np.zeros(3)
    axes, room, lag = np.empty(7), np.empty((feet.shape[0] + 2, FOOT)), half_a_reaction(body[3])
    for r in range(rows.shape[0]):
        p = rows[r]
        fixed_axes(p, REACTION, axes)
        _, _ = load_now(p, clock[span[0]], body, com)
        rehearse(p, seen, span, body, outline, feet, com, state)
        for n in range(out.shape[1]):
            t = n * stride
            step = min(span[0] + t, span[LAST])
            accelerate(
                p,
                path[t],
                path[max(t - lag, 0), 3:],
                state,
                extra,
                step,
                felt,
                mount,
                seen,
                clock,
                span,
                pivot,
                body,
                outline,
                feet,
                com,
                axes,
                acc,
                room,
                wrench,
                out[r, n],
            )
            remember_along(p, state, path, t, stride, com, outline, feet, body[3])


@njit(cache=True, error_model="numpy", nogil=True)
def pushes_along(
    rows: Array,
    path: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    stride: int,
    out: Array,
) -> None:
    """Write how each row's model accelerates the body along one given path.

    Args:
        rows: (P, WIDTH).
        path: (T, 6) states of the nominal centre of mass in one episode, as tags would see it.
        felt: see `simulate_serial`, and so are those up to `feet`.
        mount: see `simulate_serial`.
        seen: see `simulate_serial`.
        clock: see `simulate_serial`.
        span: (4,).
        pivot: (3,).
        body: (4,).
        outline: (E, 2).
        feet: (F, 2).
        stride: every so many steps; 1 for models in which more moves than the body.
        out: (P, ceil(T / stride), 3) change of velocity over a step, over dt [m/s^2, m/s^2, rad/s^2].
    """
    state, com, acc, wrench, extra = np.zeros(STATE), np.empty(2), np.empty(9), np.empty(3), np.zeros(3)
    axes, room = np.empty(7), np.empty((feet.shape[0] + 2, FOOT))
    for r in range(rows.shape[0]):
        p = rows[r]
        fixed_axes(p, body[3], axes)
        _, _ = load_now(p, clock[span[0]], body, com)
        rehearse(p, seen, span, body, outline, feet, com, state)
        for n in range(out.shape[1]):
            t = n * stride
            step = min(span[0] + t, span[LAST])
            _, _ = load_now(p, clock[step], body, com)
            to_truth(p, path[t], body, com, state)
            vx, vy, omega = state[3], state[4], state[5]
            step_seen(
                p,
                state,
                step,
                felt,
                mount,
                seen,
                clock,
                span,
                pivot,
                body,
                outline,
                feet,
                extra,
                com,
                axes,
                acc,
                room,
                wrench,
            )
            out[r, n, 0] = (state[3] - vx) / body[3]
            out[r, n, 1] = (state[4] - vy) / body[3]
            out[r, n, 2] = (state[5] - omega) / body[3]
