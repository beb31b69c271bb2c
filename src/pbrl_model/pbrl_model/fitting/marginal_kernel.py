"""Compiled: each window's likelihood with its nuisances integrated out.

A window's poses depend on nuisances z: six of its start, in standard deviations, and three of a wrench that is left
out, in newtons. `marginal_window` climbs to the most likely z by Gauss-Newton and integrates a Gaussian there
(Laplace): exact where poses are linear in z, as they are but for wheels that change between rolling and slipping. All
of it happens here, one (parameter row, window) after another, so that nothing of the size of the sensitivities is ever
held for more than one of them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.engines.lane_kernel import LANES, SIZE
from pbrl_model.engines.window_kernel import simulate_starts
from pbrl_model.kernel import HINGE_RADIUS

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NUISANCES = 9
START_STEP = 0.1
"""Finite difference in the start state, in standard deviations of its prior."""
FORCE_STEP = 0.2
"""Finite difference in the left-out force [N]; times the lever for the torque."""
SETTLED = 0.01
"""A misfit this near to what the linearisation foretold needs no other linearisation."""
SHORTER, SHORTEST = 0.4, 0.05
"""A step towards the most likely nuisances that gains nothing is shortened, down to this share, then given up."""


@njit(**LEAF)
def factorise(matrix: Array) -> float:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor; return its log determinant."""
    log_det = 0.0
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                matrix[i, i] = math.sqrt(total)
                log_det += 2.0 * math.log(matrix[i, i])
            else:
                matrix[i, j] = total / matrix[j, j]
    return log_det


@njit(**LEAF)
def solve_lower(factor: Array, vector: Array) -> float:
    """Replace b by L^-1 b for a lower triangle L; return the square of the answer."""
    square = 0.0
    for i in range(vector.shape[0]):
        total = vector[i]
        for k in range(i):
            total -= factor[i, k] * vector[k]
        vector[i] = total / factor[i, i]
        square += vector[i] * vector[i]
    return square


@njit(**LEAF)
def solve_upper(factor: Array, vector: Array) -> None:
    """Replace b by L^-T b for a lower triangle L."""
    for i in range(vector.shape[0] - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, vector.shape[0]):
            total -= factor[k, i] * vector[k]
        vector[i] = total / factor[i, i]


@njit(cache=True, error_model="numpy")
def marginal_window(
    parameters: Array,
    mean: Array,
    root: Array,
    drag: float,
    sigma: float,
    late: float,
    forcing: Array,
    steps: int,
    place: Array,
    constants: Array,
    pose: Array,
    weight: Array,
    with_drag: bool,
    rounds: int,
    z: Array,
) -> float:
    """Return one window's log likelihood but for its constants; climb from the nuisances z (9,), leave z at the top.

    Args:
        parameters: (12,).
        mean: (6,) of the start state.
        root: (6, 6) its covariance is root root^T.
        drag: scale of the left-out force [N].
        sigma: scale of the noise.
        late: see `simulate_starts`, and so are those up to `constants`.
        forcing: (T, 8).
        steps: of the window.
        place: (N,).
        constants: (5,).
        pose: (N, 3) recorded.
        weight: (N, 3) one over the noise of a pose; 0 where nothing was seen.
        with_drag: whether a wrench is left out at all.
        rounds: linearisations at most; with one, z is not moved.
        z: (9,) where the climb begins and, on return, where it ended.
    """
    poses, longest = place.shape[0], forcing.shape[0]
    lanes, path = np.empty(SIZE), np.empty((longest + 1, 3, LANES))
    starts, offsets, many = (
        np.empty((1 + NUISANCES, 6)),
        np.empty((1 + NUISANCES, 3)),
        np.empty((1 + NUISANCES, poses, 3)),
    )
    lane = np.zeros(NUISANCES, dtype=np.int64)  # which of them each nuisance moves; 0: none, its effect is known
    by_state, slope = np.zeros((3 * poses, 6)), np.zeros((3 * poses, NUISANCES))
    residual, spread = np.empty(3 * poses), np.empty(6)
    factor = np.empty((NUISANCES, NUISANCES))
    aim, trial, scale = np.empty(NUISANCES), z.copy(), np.ones(NUISANCES)
    scale[6:] = drag
    variance = sigma * sigma
    for k in range(6):
        spread[k] = math.sqrt(np.sum(root[k] * root[k]))
    in_world = math.isnan(parameters[HINGE_RADIUS])  # no joint: moving the start moves every pose alike
    used = 1
    for k in range(NUISANCES):
        if with_drag if k >= 6 else spread[k] > 0.0 and not (k < 2 and in_world):
            lane[k] = used
            used += 1
    misfit, predicted, log_det, value, share = math.inf, 0.0, 0.0, -math.inf, 1.0
    linearised = 0
    while True:
        # All at once, wanted or not: eight lanes take no longer than one.
        for k in range(6):
            starts[:used, k] = mean[k] + np.dot(root[k], trial[:6])
        offsets[:used] = trial[6:]
        for k in range(NUISANCES):
            if lane[k] > 0 and k < 6:
                starts[lane[k], k] += START_STEP * spread[k]
            elif lane[k] > 0:
                offsets[lane[k], k - 6] += FORCE_STEP
        simulate_starts(
            parameters,
            starts[:used],
            offsets[:used],
            late,
            forcing,
            steps,
            place,
            constants,
            lanes,
            path,
            many[:used],
        )
        base = many[0]
        count, found = 0, 0.0
        for n in range(poses):
            for k in range(3):
                difference = pose[n, k] - base[n, k]
                if k == 2:
                    difference -= 2 * math.pi * np.round(difference / (2 * math.pi))
                residual[3 * n + k] = difference * weight[n, k]
                found += residual[3 * n + k] ** 2
                count += weight[n, k] > 0.0
        found /= variance
        for k in range(NUISANCES):
            found += (trial[k] / scale[k]) ** 2
        if linearised > 0:
            foretold = share == 1.0 and abs(found - predicted) < SETTLED
            if foretold or (found < misfit and linearised == rounds):
                z[:] = trial
                return -0.5 * (found + log_det)
            if not found < misfit:
                share *= SHORTER
                if share < SHORTEST:
                    return value
                trial[:] = z + share * (aim - z)
                continue
        misfit = found
        z[:] = trial
        for k in range(NUISANCES):
            if k < 2 and in_world:
                for n in range(poses):
                    by_state[3 * n + k, k] = weight[n, k]
            elif lane[k] > 0:
                size = START_STEP * spread[k] if k < 6 else FORCE_STEP
                for n in range(poses):
                    for other in range(3):
                        change = (many[lane[k], n, other] - base[n, other]) * weight[n, other] / size
                        if k < 6:
                            by_state[3 * n + other, k] = change
                        else:
                            slope[3 * n + other, k] = change
        slope[:, :6] = by_state @ root
        linearised += 1
        # What the residual would be with no nuisance, to first order, and how much of it nuisances explain.
        residual += slope @ z
        gram = slope.T @ slope
        along = slope.T @ residual
        for i in range(NUISANCES):
            along[i] *= scale[i]
            for j in range(NUISANCES):
                factor[i, j] = gram[i, j] * scale[i] * scale[j]
            factor[i, i] += variance
        log_det = factorise(factor) + (count - NUISANCES) * math.log(variance)
        predicted = (np.dot(residual, residual) - solve_lower(factor, along)) / variance
        value = -0.5 * (predicted + log_det)
        if rounds == 1 or misfit - predicted < SETTLED:
            return value
        solve_upper(factor, along)
        share = 1.0
        aim[:] = along * scale
        trial[:] = aim


@njit(cache=True, error_model="numpy")
def marginal_row(
    parameters: Array,
    initial: Array,
    root: Array,
    drag: float,
    sigma: float,
    late: float,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    pose: Array,
    weight: Array,
    with_drag: bool,
    rounds: int,
    nuisance: Array,
) -> float:
    """Return the sum of `marginal_window` over the windows; nuisance (W, 9) is moved to the top of each."""
    total = 0.0
    for w in range(forcing.shape[0]):
        total += marginal_window(
            parameters,
            initial[w],
            root[w],
            drag,
            sigma,
            late,
            forcing[w],
            steps[w],
            place[w],
            constants,
            pose[w],
            weight[w],
            with_drag,
            rounds,
            nuisance[w],
        )
    return total


@njit(cache=True, error_model="numpy")
def marginal_serial(
    parameters: Array,
    initial: Array,
    root: Array,
    drag: Array,
    sigma: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    pose: Array,
    weight: Array,
    with_drag: bool,
    rounds: int,
    nuisance: Array,
    out: Array,
) -> None:
    """Write `marginal_row` of every parameter row into `out` (P,), on this core."""
    for p in range(parameters.shape[0]):
        out[p] = marginal_row(
            parameters[p],
            initial,
            root,
            drag[p],
            sigma[p],
            late[p],
            forcing,
            steps,
            place,
            constants,
            pose,
            weight,
            with_drag,
            rounds,
            nuisance[p],
        )


@njit(cache=True, error_model="numpy", parallel=True)
def marginal_parallel(
    parameters: Array,
    initial: Array,
    root: Array,
    drag: Array,
    sigma: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    pose: Array,
    weight: Array,
    with_drag: bool,
    rounds: int,
    nuisance: Array,
    out: Array,
) -> None:
    """Do what `marginal_serial` does on all cores; each row is its own work, so the bytes are the same."""
    for p in prange(parameters.shape[0]):
        out[p] = marginal_row(
            parameters[p],
            initial,
            root,
            drag[p],
            sigma[p],
            late[p],
            forcing,
            steps,
            place,
            constants,
            pose,
            weight,
            with_drag,
            rounds,
            nuisance[p],
        )
