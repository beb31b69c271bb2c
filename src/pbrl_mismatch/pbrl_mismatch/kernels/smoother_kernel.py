"""Compiled: an unknown-input smoother, Kalman filter forward and Rauch-Tung-Striebel back, about a path.

The state is that of the nominal centre of mass as tags see it (6), with a wrench d (3) in world axes that the model
does not have, an Ornstein-Uhlenbeck process (Matern 1/2). The body moves as `path_kernel.accelerate` has it, with d
added, linearised about a path that is near already: one about its own predictions has a foot stick or slide by what it
made of the poses before, is sure of that, and is lost where it was wrong. Smoothed anew about what came out, again and
again, that is the Gauss-Newton method (an iterated extended Kalman smoother, Bell 1994).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.motion_kernel import rehearse
from pbrl_mismatch.kernels.path_kernel import REACTION, accelerate, half_a_reaction, remember_along
from pbrl_mismatch.kernels.sense_kernel import load_now, to_truth
from pbrl_mismatch.kernels.state import STATE
from pbrl_mismatch.kernels.step_kernel import fixed_axes

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SIZE = 9
STEPS = (5e-4, 5e-4, 1e-3, 5e-3, 5e-3, 1e-2, 0.1, 0.1, 0.1)
"""Finite differences in the state, of about what a path is uncertain by: dry friction is no line within less."""
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
def moved_on(move: Array, dt: float, kept: float, spread: Array, out: Array) -> None:
    """Write M P of a step's matrix M, of which only the rows of the velocities are not plain, and P (SIZE, SIZE)."""
    for j in range(SIZE):
        for k in range(3):
            out[k, j] = spread[k, j] + dt * spread[3 + k, j]
            out[6 + k, j] = kept * spread[6 + k, j]
            total = 0.0
            for i in range(SIZE):
                total += move[3 + k, i] * spread[i, j]
            out[3 + k, j] = total


@njit(**LEAF)
def solve_symmetric(matrix: Array, other: Array) -> None:
    """Put A^-1 B in the place of B (SIZE, SIZE), and A's Cholesky factor in that of A."""
    for j in range(SIZE):
        for i in range(j, SIZE):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(total) if i == j else total / matrix[j, j]
    for column in range(SIZE):
        for i in range(SIZE):
            total = other[i, column]
            for k in range(i):
                total -= matrix[i, k] * other[k, column]
            other[i, column] = total / matrix[i, i]
        for i in range(SIZE - 1, -1, -1):
            total = other[i, column]
            for k in range(i + 1, SIZE):
                total -= matrix[k, i] * other[k, column]
            other[i, column] = total / matrix[i, i]


@njit(**LEAF)
def turned(gain: Array, spread: Array, room: Array, out: Array) -> None:
    """Add G^T P G to a covariance, all of them (SIZE, SIZE)."""
    for i in range(SIZE):
        for j in range(SIZE):
            total = 0.0
            for k in range(SIZE):
                total += spread[i, k] * gain[k, j]
            room[i, j] = total
    for i in range(SIZE):
        for j in range(i + 1):
            total = 0.0
            for k in range(SIZE):
                total += gain[k, i] * room[k, j]
            out[i, j] += total
            if i != j:
                out[j, i] += total


@njit(**LEAF)
def see(mean: Array, body: Array, after: float, out: Array, slope: Array) -> None:
    """Write the pose (3,) that tags would see `after` so many seconds, and its slopes (3, SIZE) in the state."""
    c, s = math.cos(mean[2] + after * mean[5]), math.sin(mean[2] + after * mean[5])
    dx, dy = c * body[1] - s * body[2], s * body[1] + c * body[2]
    slope[:] = 0.0
    for k in range(3):
        out[k] = mean[k] + after * mean[k + 3]
        slope[k, k], slope[k, k + 3] = 1.0, after
    out[0] -= dx
    out[1] -= dy
    slope[0, 2], slope[0, 5] = dy, after * dy
    slope[1, 2], slope[1, 5] = -dx, -after * dx


@njit(cache=True, error_model="numpy", nogil=True)
def smooth_episode(
    p: Array,
    about: Array,
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
        about: (T, SIZE) states, T the episode's steps, about which the model is linearised.
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
        mean: (T, SIZE) written.
        spread: (T, SIZE, SIZE) written.
        back: whether to smooth; otherwise only the likelihood is wanted and the rest is room.
    """
    steps, dt, first, lag = mean.shape[0], body[3], span[0], half_a_reaction(body[3])
    state, com, acc, wrench = np.zeros(STATE), np.empty(2), np.empty(9), np.empty(3)
    pushed, moved, near, before, sight = np.empty(3), np.empty(3), np.empty(SIZE), np.empty(3), np.empty(3)
    ahead_mean, ahead, slope = np.empty((steps, SIZE)), np.empty((steps, SIZE, SIZE)), np.empty((3, SIZE))
    moves, half, gain = np.empty((steps, SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE))
    _, _ = load_now(p, clock[first], body, com)
    rehearse(p, seen, span, body, outline, feet, com, state)
    axes, room = np.empty(7), np.empty((feet.shape[0] + 2, FOOT))
    fixed_axes(p, REACTION, axes)
    kept = math.exp(-dt / memory)
    x, c = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    x[:6] = told
    c[:6, :6] = start
    for k in range(3):
        c[6 + k, 6 + k] = sizes[k] ** 2
    value, n = 0.0, 0
    for t in range(steps):
        while n < place.shape[0] and place[n] < t + 1:
            for k in range(3):
                if math.isnan(pose[n, k]):
                    continue
                see(x, body, (place[n] - t) * dt, sight, slope)
                residual = pose[n, k] - sight[k]
                if k == 2:
                    residual -= 2.0 * math.pi * math.floor(residual / (2.0 * math.pi) + 0.5)
                value += correct(x, c, slope[k], residual, variance[k])
            n += 1
        mean[t] = x
        spread[t] = c
        move = moves[t]
        move[:] = 0.0
        for i in range(SIZE, -1, -1):
            near[:] = about[t]
            before[:] = about[max(t - lag, 0), 3:6]
            if i > 0:
                near[i - 1] += STEPS[i - 1]
                if 3 < i <= 6:
                    before[i - 4] += STEPS[i - 1]
            accelerate(
                p,
                near[:6],
                before,
                state,
                near[6:],
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
                com,
                axes,
                acc,
                room,
                wrench,
                moved,
            )
            if i > 0:
                move[3:6, i - 1] = moved
        pushed[:] = moved
        for i in range(SIZE):
            for k in range(3):
                move[3 + k, i] = (move[3 + k, i] - pushed[k]) / STEPS[i] * dt
        for k in range(3):
            move[3 + k, 3 + k] += 1.0
        remember_along(p, state, about, t, 1, com, outline, feet, dt)
        x -= about[t]
        for k in range(3):
            pushed[k] = dt * pushed[k] + np.dot(move[3 + k], x)
        for k in range(3):
            x[k] += dt * x[3 + k] + about[t, k] + dt * about[t, 3 + k]
            x[3 + k] = about[t, 3 + k] + pushed[k]
            x[6 + k] = kept * (x[6 + k] + about[t, 6 + k])
        moved_on(move, dt, kept, c, half)
        moved_on(move, dt, kept, half.T, c)
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
        moved_on(moves[t], dt, kept, spread[t], half)
        for i in range(SIZE):
            for k in range(SIZE):
                c[i, k] = spread[t + 1, i, k] - ahead[t, i, k]
        solve_symmetric(ahead[t], half)
        mean[t] += half.T @ (mean[t + 1] - ahead_mean[t])
        turned(half, c, gain, spread[t])
    return value


@njit(cache=True, error_model="numpy")
def true_centres(p: Array, path: Array, clock: Array, body: Array, out: Array) -> None:
    """Write states of the true centre of mass (T, 6) for those of the nominal one as tags see it (T, 6), at `clock`."""
    com = np.empty(2)
    for t in range(path.shape[0]):
        _, _ = load_now(p, clock[t], body, com)
        to_truth(p, path[t], body, com, out[t])
