"""Compiled: poses at recorded times for many parameter rows and windows, each with its own start.

What is in motion besides the body when a window begins (a swinging load, the casters' headings, a body that was pushed
along) follows from what was recorded before it: `rehearse_windows` runs it along the recorded motion.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.crate_kernel import FOLLOWING, move_crate
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.laws_kernel import on_casters
from pbrl_mismatch.kernels.sense_kernel import acting, as_seen, load_now, to_truth
from pbrl_mismatch.kernels.state import CASTERS, FIRST_CASTER, SLOSH, STATE, UNSEEN
from pbrl_mismatch.kernels.step_kernel import fixed_axes, step_body, swing_load, turn_casters
from pbrl_model.kernel import cos_sin

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

FIRST, STEPS, BEGIN, LAST = 0, 1, 2, 3
"""Columns of a window's whole numbers: first step, how many, first and last step of its episode."""
STRIDES = 4
"""A rehearsal of casters and of a body pushed along goes in steps of so many."""


@njit(cache=True, error_model="numpy")
def rehearse_windows(
    p: Array, seen: Array, span: Index, body: Array, outline: Array, feet: Array, com: Array, memory: Array
) -> None:
    """Find what moves besides the body as it is when each window starts, in one walk along the recorded motion.

    Casters, and a body that was met, stay where they were between two grasps; what moved has come to rest by then.

    Args:
        p: (WIDTH,) parameter row.
        seen: (T, 6) smoothed states.
        span: (W, 4) of the windows, in the order of their first steps.
        body: see `sense_kernel.load_now`.
        outline: (E, 2).
        feet: (F, 2).
        com: (2,) centre of mass in the body's frame [m].
        memory: (W, STATE) whose columns past the sixth are written.
    """
    memory[:, FIRST_CASTER:] = 0.0
    casters = on_casters(p)
    swings, meets = p[at.SLOSH_MASS] > 0.0, p[at.UNSEEN_FORCE] > 0.0
    if not (casters or swings or meets):
        return
    dt, state = body[3], np.zeros(STATE)
    state[UNSEEN], state[UNSEEN + 1] = p[at.UNSEEN_X], p[at.UNSEEN_Y]
    for i in range(CASTERS):
        heading = seen[0, 2] + p[at.CASTER_HEADING]
        if 1 <= i <= at.CASTER_TURN4 - at.CASTER_TURN2 + 1:
            heading += p[at.CASTER_TURN2 + i - 1]
        state[FIRST_CASTER + 2 * i], state[FIRST_CASTER + 2 * i + 1] = math.cos(heading), math.sin(heading)
    stride, t, begin, near = 1 if swings else STRIDES, 0, 0, np.empty(STATE)
    for w in range(span.shape[0]):
        first = span[w, FIRST]
        while True:
            if span[w, BEGIN] > begin and t >= span[w, BEGIN]:
                begin = span[w, BEGIN]
                state[SLOSH : SLOSH + 4] = state[UNSEEN + 3 :] = 0.0
            if t + stride > first:
                break
            _follow(p, seen, t, stride * dt, body, outline, feet, com, state, casters, meets)
            if swings and t + 1 < seen.shape[0] and t + 1 != span[w, BEGIN]:
                c, s = math.cos(state[2]), math.sin(state[2])
                ax, ay = (seen[t + 1, 3] - seen[t, 3]) / dt, (seen[t + 1, 4] - seen[t, 4]) / dt
                swing_load(p, state, ax, ay, (seen[t + 1, 5] - seen[t, 5]) / dt, c, s, com, dt)
            t += stride
        near[:] = state
        since = max(t, span[w, BEGIN])
        if since > t:
            near[SLOSH : SLOSH + 4] = near[UNSEEN + 3 :] = 0.0
        if first > since:
            # A window begins between two strides: a crate is a centimetre further by then, in touch or not.
            _follow(p, seen, since, (first - since) * dt, body, outline, feet, com, near, casters, meets)
        memory[w, FIRST_CASTER:] = near[FIRST_CASTER:]


@njit(**LEAF)
def _follow(
    p: Array,
    seen: Array,
    t: int,
    seconds: float,
    body: Array,
    outline: Array,
    feet: Array,
    com: Array,
    state: Array,
    casters: bool,
    meets: bool,
) -> None:
    """Let casters and a body that is met go on beside a body that goes on as it was seen to at step `t`."""
    to_truth(p, seen[t], body, com, state)
    c, s = math.cos(state[2]), math.sin(state[2])
    if casters:
        turn_casters(p, state, c, s, com, feet, seconds)
    if meets:
        move_crate(p, outline, state, c, s, com, seconds, FOLLOWING)


@njit(cache=True, error_model="numpy")
def rehearse(
    p: Array, seen: Array, span: Index, body: Array, outline: Array, feet: Array, com: Array, state: Array
) -> None:
    """Do what `rehearse_windows` does for one window (4,), into the entries of a state (STATE,) past the sixth."""
    memory = np.empty((1, STATE))
    rehearse_windows(p, seen, span.reshape(1, 4), body, outline, feet, com, memory)
    state[FIRST_CASTER:] = memory[0, FIRST_CASTER:]


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
    memory: Array,
    out: Array,
) -> None:
    """Simulate one row over one window, see `simulate_serial`; its arguments without their first axes.

    `memory` (STATE,) is what `rehearse_windows` found.
    """
    state, com, acc, wrench = np.empty(STATE), np.empty(2), np.empty(9), np.empty(3)
    before, after, axes = np.empty(3), np.empty(3), np.empty(7)
    room = np.empty((feet.shape[0] + 2, FOOT))
    first, steps, dt = span[FIRST], span[STEPS], body[3]
    knots = extra.shape[0] - 1
    mass, inertia = load_now(p, clock[first], body, com)
    to_truth(p, told, body, com, state)
    state[FIRST_CASTER:] = memory[FIRST_CASTER:]
    fixed_axes(p, dt, axes)
    n, poses = 0, place.shape[0]
    loaded = p[at.PAYLOAD_MASS] != 0.0
    c, s = cos_sin(state[2])
    for k in range(steps):
        t = first + k
        if loaded:
            oldx, oldy, lighter, easier = com[0], com[1], mass, inertia
            mass, inertia = load_now(p, clock[t], body, com)
            if mass > lighter:
                # What is put on was at rest: it takes its share of the momentum.
                state[3] *= lighter / mass
                state[4] *= lighter / mass
                state[5] *= min(easier / inertia, 1.0)
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
        c, s = step_body(p, state, wrench, clock[t], mass, inertia, com, pivot, outline, feet, axes, acc, room, dt)
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
    asked: Mask,
    out: Array,
) -> None:
    """Simulate every parameter row over every window, on this core; other threads may do the same beside it.

    Args:
        rows: (P, WIDTH).
        told: (P, W, 6) states of the nominal centre of mass at the windows' starts, as tags would see it.
        extra: (P, W, K, 3) wrench in the body's axes that is added [N, N, N m], straight between K knots that are
            spread evenly over the window; K at least 1.
        felt: (T, 3) wrench in the sensor's axes [N, N, N m].
        mount: (T, 5) cosine and sine of the sensor's turn; its place from the nominal centre of mass [m], world axes;
            how long ago it was read at rest [s], so that an older offset is known.
        seen: (T, 6) smoothed states of the nominal centre of mass.
        clock: (T,) times of the steps [s].
        span: (W, 4) first step, steps, first and last step of the episode; in the order of their first steps.
        pivot: (W, 3) pose of the body's frame at the start of the episode.
        body: (4,) nominal inertia over mass [m^2], centre of mass (x, y) [m], dt [s].
        outline: (E, 2) footprint [m], counter-clockwise.
        feet: (F, 2) points that carry the load [m].
        place: (W, N) where each recorded pose lies, in steps from the window's start, in order.
        asked: (P, W) which are simulated.
        out: (P, W, N, 3) poses of the body's frame as tags would see it, written where they are asked.
    """
    windows, com, memory = span.shape[0], np.empty(2), np.empty((span.shape[0], STATE))
    for r in range(rows.shape[0]):
        if not asked[r].any():
            continue
        _, _ = load_now(rows[r], clock[0], body, com)
        rehearse_windows(rows[r], seen, span, body, outline, feet, com, memory)
        for w in range(windows):
            if not asked[r, w]:
                continue
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
                memory[w],
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
    asked: Mask,
    out: Array,
) -> None:
    """Do what `simulate_serial` does on all cores; each row is its own work, so the bytes are the same."""
    for r in prange(rows.shape[0]):
        com, memory = np.empty(2), np.empty((span.shape[0], STATE))
        _, _ = load_now(rows[r], clock[0], body, com)
        rehearse_windows(rows[r], seen, span, body, outline, feet, com, memory)
        for w in range(span.shape[0]):
            if not asked[r, w]:
                continue
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
                memory[w],
                out[r, w],
            )


@njit(**LEAF)
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
    room: Array,
    wrench: Array,
) -> None:
    """Move a true state (STATE,) from step `t` to the next with a wrench `extra` (3,) in world axes added."""
    mass, inertia = load_now(p, clock[t], body, com)
    acting(p, felt, mount, seen, t, span[BEGIN], span[LAST], clock[t], body, com, wrench)
    wrench[0] += extra[0]
    wrench[1] += extra[1]
    wrench[2] += extra[2]
    step_body(p, state, wrench, clock[t], mass, inertia, com, pivot, outline, feet, axes, acc, room, body[3])
