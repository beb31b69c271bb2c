"""Compiled: poses at recorded times for many parameter rows and windows, each with its own start.

What is in motion besides the body when a window begins (a swinging load, the casters' headings, a body that was pushed
along) follows from what was recorded before it: `rehearse` runs it along the recorded motion.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.laws_kernel import CASTERS, FIRST_CASTER, STATE, UNSEEN, move_unseen
from pbrl_mismatch.kernels.sense_kernel import acting, as_seen, load_now, to_truth
from pbrl_mismatch.kernels.step_kernel import fixed_axes, step_body, swing_load, turn_casters
from pbrl_model.kernel import cos_sin

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FIRST, STEPS, BEGIN, LAST = 0, 1, 2, 3
"""Columns of a window's whole numbers: first step, how many, first and last step of its episode."""
REHEARSAL = 4.0
"""A swinging load and casters forget what was longer ago [s]."""
STRIDES = 4
"""A rehearsal of casters and of a body pushed along goes in steps of so many."""


@njit(cache=True, error_model="numpy")
def rehearse(
    p: Array, seen: Array, span: Index, body: Array, outline: Array, feet: Array, com: Array, state: Array
) -> None:
    """Set what moves besides the body, as it is at the start of a window.

    Args:
        p: (WIDTH,) parameter row.
        seen: (T, 6) smoothed states.
        span: (4,) of the window.
        body: see `sense_kernel.load_now`.
        outline: (E, 2).
        feet: (F, 2).
        com: (2,) centre of mass in the body's frame [m].
        state: (STATE,) whose entries past the sixth are written.
    """
    state[FIRST_CASTER:] = 0.0
    casters = p[at.CASTER_ROLL] > 0.0 or p[at.CASTER_SCRUB] > 0.0
    swings, meets = p[at.SLOSH_MASS] > 0.0, p[at.UNSEEN_FORCE] > 0.0
    if not (casters or swings or meets):
        return
    dt = body[3]
    x, y, theta = state[0], state[1], state[2]
    vx, vy, omega = state[3], state[4], state[5]
    state[UNSEEN], state[UNSEEN + 1] = p[at.UNSEEN_X], p[at.UNSEEN_Y]
    for i in range(CASTERS):
        state[FIRST_CASTER + i] = seen[span[BEGIN], 2] + p[at.CASTER_HEADING]
    begin = span[BEGIN] if meets else max(span[BEGIN], span[FIRST] - int(REHEARSAL / dt))
    stride = 1 if swings else STRIDES
    for t in range(begin, span[FIRST], stride):
        to_truth(p, seen[t], body, com, state)
        c, s = math.cos(state[2]), math.sin(state[2])
        if casters:
            turn_casters(p, state, c, s, com, feet, stride * dt)
        if meets:
            move_unseen(p, outline, state, c, s, com)
        if swings:
            swing_load(p, state, (seen[t + 1, 3] - seen[t, 3]) / dt, (seen[t + 1, 4] - seen[t, 4]) / dt, dt)
    state[0], state[1], state[2], state[3], state[4], state[5] = x, y, theta, vx, vy, omega


@njit(cache=True, error_model="numpy")
def simulate_window(
    p: Array,
    told: Array,
    extra: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    place: Array,
    out: Array,
) -> None:
    """Simulate one row over one window, see `simulate_serial`; its arguments without their first axes."""
    state, com, acc, wrench = np.empty(STATE), np.empty(2), np.empty(9), np.empty(3)
    before, after, axes = np.empty(3), np.empty(3), np.empty(5)
    first, steps, dt = span[FIRST], span[STEPS], body[3]
    knots = extra.shape[0] - 1
    mass, inertia = load_now(p, clock[first], body, com)
    to_truth(p, told, body, com, state)
    rehearse(p, seen, span, body, outline, feet, com, state)
    fixed_axes(p, dt, axes)
    n, poses = 0, place.shape[0]
    loaded = p[at.PAYLOAD_MASS] != 0.0
    c, s = cos_sin(state[2])
    for k in range(steps):
        t = first + k
        if loaded:
            oldx, oldy = com[0], com[1]
            mass, inertia = load_now(p, clock[t], body, com)
            if com[0] != oldx or com[1] != oldy:
                dx = c * (com[0] - oldx) - s * (com[1] - oldy)
                dy = s * (com[0] - oldx) + c * (com[1] - oldy)
                state[0] += dx
                state[1] += dy
                state[3] -= state[5] * dy
                state[4] += state[5] * dx
        acting(p, felt, mount, seen, t, span[BEGIN], span[LAST], clock[t], body, com, wrench)
        where = knots * k / steps
        knot = int(where)
        share = where - knot
        ex = extra[knot, 0] + share * (extra[min(knot + 1, knots), 0] - extra[knot, 0])
        ey = extra[knot, 1] + share * (extra[min(knot + 1, knots), 1] - extra[knot, 1])
        wrench[0] += c * ex - s * ey
        wrench[1] += s * ex + c * ey
        wrench[2] += extra[knot, 2] + share * (extra[min(knot + 1, knots), 2] - extra[knot, 2])
        due = n < poses and (place[n] <= k + 1 or k == steps - 1)
        if due:
            as_seen(p, state, com, before)
        c, s = step_body(p, state, wrench, clock[t], mass, inertia, com, pivot, outline, feet, axes, acc, dt)
        if due:
            as_seen(p, state, com, after)
        while n < poses and (place[n] <= k + 1 or k == steps - 1):
            part = place[n] - k
            for j in range(3):
                out[n, j] = before[j] + part * (after[j] - before[j])
            n += 1


@njit(cache=True, error_model="numpy", nogil=True)
def simulate_serial(
    rows: Array,
    told: Array,
    extra: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    place: Array,
    out: Array,
) -> None:
    """Simulate every parameter row over every window, on this core; other threads may do the same beside it.

    Args:
        rows: (P, WIDTH).
        told: (P, W, 6) states of the nominal centre of mass at the windows' starts, as tags would see it.
        extra: (P, W, K, 3) wrench in the body's axes that is added [N, N, N m], straight between K knots that are
            spread evenly over the window; K at least 1.
        felt: (T, 3) wrench in the sensor's axes [N, N, N m].
        mount: (T, 4) cosine and sine of the sensor's turn, its place from the nominal centre of mass [m], world axes.
        seen: (T, 6) smoothed states of the nominal centre of mass.
        clock: (T,) times of the steps [s].
        span: (W, 4) first step, steps, first and last step of the episode.
        pivot: (W, 3) pose of the body's frame at the start of the episode.
        body: (4,) nominal inertia over mass [m^2], centre of mass (x, y) [m], dt [s].
        outline: (E, 2) footprint [m], counter-clockwise.
        feet: (F, 2) points that carry the load [m].
        place: (W, N) where each recorded pose lies, in steps from the window's start, in order.
        out: (P, W, N, 3) poses of the body's frame as tags would see it, written.
    """
    windows = span.shape[0]
    for job in range(rows.shape[0] * windows):
        r, w = job // windows, job % windows
        simulate_window(
            rows[r],
            told[r, w],
            extra[r, w],
            felt,
            mount,
            seen,
            clock,
            span[w],
            pivot[w],
            body,
            outline,
            feet,
            place[w],
            out[r, w],
        )


@njit(cache=True, error_model="numpy", parallel=True)
def simulate_parallel(
    rows: Array,
    told: Array,
    extra: Array,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    place: Array,
    out: Array,
) -> None:
    """Do what `simulate_serial` does on all cores; each (row, window) is its own work, so the bytes are the same."""
    windows = span.shape[0]
    for job in prange(rows.shape[0] * windows):
        r, w = job // windows, job % windows
        simulate_window(
            rows[r],
            told[r, w],
            extra[r, w],
            felt,
            mount,
            seen,
            clock,
            span[w],
            pivot[w],
            body,
            outline,
            feet,
            place[w],
            out[r, w],
        )


@njit(cache=True, error_model="numpy")
def step_seen(
    p: Array,
    state: Array,
    t: int,
    felt: Array,
    mount: Array,
    seen: Array,
    clock: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    extra: Array,
    com: Array,
    axes: Array,
    acc: Array,
    wrench: Array,
) -> None:
    """Move a true state (STATE,) from step `t` to the next with a wrench `extra` (3,) in world axes added."""
    mass, inertia = load_now(p, clock[t], body, com)
    acting(p, felt, mount, seen, t, span[BEGIN], span[LAST], clock[t], body, com, wrench)
    wrench[0] += extra[0]
    wrench[1] += extra[1]
    wrench[2] += extra[2]
    step_body(p, state, wrench, clock[t], mass, inertia, com, pivot, outline, feet, axes, acc, body[3])
