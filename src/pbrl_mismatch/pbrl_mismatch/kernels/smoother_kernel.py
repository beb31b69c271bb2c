"""Compiled: an unknown-input smoother, extended Kalman filter forward and Rauch-Tung-Striebel back.

The state is that of the body (6) with a wrench d (3) in world axes that the model does not have, an Ornstein-Uhlenbeck
process (Matern 1/2). The body moves as the kernel has it, with d added; derivatives are finite differences of a step.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels.laws_kernel import FOOT
from pbrl_mismatch.kernels.motion_kernel import LAST, rehearse, step_seen
from pbrl_mismatch.kernels.sense_kernel import as_seen, load_now, to_truth
from pbrl_mismatch.kernels.state import STATE
from pbrl_mismatch.kernels.step_kernel import fixed_axes

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SIZE = 9
STEPS = (1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 2e-3, 0.1, 0.1, 0.1)
"""Finite differences in the state."""
TINY = 1e-12
"""Variance that every step adds, so that no covariance becomes singular."""


@njit(cache=True, error_model="numpy")
def correct(mean: Array, spread: Array, slope: Array, residual: float, variance: float) -> float:
    """Take in one number seen; return its share of the log likelihood."""
    along = spread @ slope
    total = np.dot(slope, along) + variance
    for i in range(SIZE):
        mean[i] += along[i] * residual / total
        for j in range(SIZE):
            spread[i, j] -= along[i] * along[j] / total
    return -0.5 * (residual * residual / total + math.log(2.0 * math.pi * total))


@njit(**LEAF)
def make_symmetric(spread: Array) -> None:
    """Take out of a covariance what rounding leaves beside its symmetric part: no observation would ever correct it."""
    for k in range(SIZE):
        for i in range(k):
            spread[i, k] = spread[k, i] = 0.5 * (spread[i, k] + spread[k, i])


@njit(**LEAF)
def see(p: Array, mean: Array, com: Array, part: float, dt: float, state: Array, out: Array) -> None:
    """Write the pose (3,) that tags would see a share `part` of a step after a state."""
    for k in range(6):
        state[k] = mean[k]
    for k in range(3):
        state[k] += part * dt * mean[k + 3]
    as_seen(p, state, com, out)


@njit(cache=True, error_model="numpy", nogil=True)
def smooth_episode(
    p: Array,
    told: Array,
    start: Array,
    sizes: Array,
    memory: float,
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
    pose: Array,
    variance: Array,
    mean: Array,
    spread: Array,
    back: bool,
) -> float:
    """Smooth one episode; return the log likelihood of its poses [nat].

    Args:
        p: (WIDTH,) parameter row.
        told: (6,) start state of the nominal centre of mass as tags would see it.
        start: (6, 6) its covariance.
        sizes: (3,) standard deviation of d [N, N, N m].
        memory: time in which d forgets [s].
        felt: see `simulate_serial`, and so are those up to `feet`.
        mount: see `simulate_serial`.
        seen: see `simulate_serial`.
        clock: see `simulate_serial`.
        span: (4,).
        pivot: (3,).
        body: (4,).
        outline: (E, 2).
        feet: (F, 2).
        place: (N,) in steps from the start, in order.
        pose: (N, 3) recorded; NaN where nothing was seen.
        variance: (3,) of a recorded pose.
        mean: (T, 9) written, T the episode's steps; body states are the true centre of mass's.
        spread: (T, 9, 9) written.
        back: whether to smooth; otherwise only the likelihood is wanted and the rest is room.
    """
    steps, dt, first = mean.shape[0], body[3], span[0]
    state, trial, com, acc, wrench = np.zeros(STATE), np.zeros(STATE), np.empty(2), np.empty(9), np.empty(3)
    now, sight, other, extra = np.empty(SIZE), np.empty(3), np.empty(3), np.empty(3)
    ahead_mean, ahead = np.empty((steps, SIZE)), np.empty((steps, SIZE, SIZE))
    moves = np.empty((steps, SIZE, SIZE))
    _, _ = load_now(p, clock[first], body, com)
    to_truth(p, told, body, com, state)
    rehearse(p, seen, span, body, outline, feet, com, state)
    axes, room = np.empty(7), np.empty((feet.shape[0] + 1, FOOT))
    fixed_axes(p, dt, axes)
    kept = math.exp(-dt / memory)
    x, c = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    x[:6] = state[:6]
    c[:6, :6] = start
    for k in range(3):
        c[6 + k, 6 + k] = sizes[k] ** 2
    value, n, slope = 0.0, 0, np.empty(SIZE)
    for t in range(steps):
        while n < place.shape[0] and place[n] < t + 1:
            for k in range(3):
                if math.isnan(pose[n, k]):
                    continue
                see(p, x, com, place[n] - t, dt, trial, sight)
                slope[:] = 0.0
                for i in range(6):
                    now[:] = x
                    now[i] += STEPS[i]
                    see(p, now, com, place[n] - t, dt, trial, other)
                    slope[i] = (other[k] - sight[k]) / STEPS[i]
                residual = pose[n, k] - sight[k]
                if k == 2:
                    residual -= 2.0 * math.pi * math.floor(residual / (2.0 * math.pi) + 0.5)
                value += correct(x, c, slope, residual, variance[k])
            n += 1
        mean[t] = x
        spread[t] = c
        move = moves[t]
        move[:] = 0.0
        for i in range(SIZE, -1, -1):
            trial[:] = state
            for k in range(6):
                trial[k] = x[k]
            extra[:] = x[6:]
            if i > 0 and i <= 6:
                trial[i - 1] += STEPS[i - 1]
            elif i > 6:
                extra[i - 7] += STEPS[i - 1]
            step_seen(
                p,
                trial,
                first + t,
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
            if i > 0:
                for k in range(6):
                    move[k, i - 1] = trial[k]
        state[:] = trial
        for i in range(SIZE):
            for k in range(6):
                move[k, i] = (move[k, i] - trial[k]) / STEPS[i]
        for k in range(3):
            move[6 + k, 6 + k] = kept
        x[:6] = trial[:6]
        x[6:] *= kept
        c = move @ c @ move.T
        make_symmetric(c)
        for k in range(6):
            c[k, k] += TINY
        for k in range(3):
            c[6 + k, 6 + k] += sizes[k] ** 2 * (1.0 - kept * kept)
        ahead_mean[t] = x
        ahead[t] = c
    if not back:
        return value
    for t in range(steps - 2, -1, -1):
        gain = np.linalg.solve(ahead[t], moves[t] @ spread[t]).T
        mean[t] += gain @ (mean[t + 1] - ahead_mean[t])
        spread[t] += gain @ (spread[t + 1] - ahead[t]) @ gain.T
        make_symmetric(spread[t])
    return value


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
    """Write what acts on the body in each row's model along one given path, mass times acceleration.

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
    axes, room = np.empty(7), np.empty((feet.shape[0] + 1, FOOT))
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
