"""How well a fitted model predicts windows that it was not fitted to."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.search.climb import Peak, settled
from pbrl_mismatch.search.objective import Objective, reduce

Array = NDArray[np.float64]

SETTLING_ROUNDS = 3
"""Times that the slopes in the nuisances are taken anew."""
REWEIGHED = 3
"""Times that the windows' weights follow the shift of the parameters."""


@dataclass(frozen=True)
class Score:
    """What a fit says of held-out windows.

    Attributes:
        log_score: log density of the held-out poses, starts and parameters integrated out [nat], up to a constant of
            the windows.
        rmse_position: of a forecast, simulated from the state that smoothing has at a window's start, under the felt
            wrench; nothing is fitted to what is predicted [m].
        rmse_yaw: of that forecast [rad]; NaN where yaw was not seen.
        rmse_retold: of position where the start and a steady wrench are fitted to the window itself [m].
    """

    log_score: float
    rmse_position: float
    rmse_yaw: float
    rmse_retold: float


def settle(objective: Objective, coordinates: Array, begun: Array | None = None) -> Array:
    """Return the most likely nuisances (1, W, NUISANCES) at coordinates (1, K).

    Args:
        objective: hypothesis and windows.
        coordinates: where.
        begun: nuisances from which each window is settled as well as from rest; the better one counts.
    """
    starts = objective.at_rest(1) if begun is None else np.concatenate([objective.at_rest(1), begun])
    z, u = starts, coordinates.repeat(len(starts), axis=0)
    for _ in range(SETTLING_ROUNDS):
        linear = objective.linearise(u, z)
        z, _, misfit = settled(objective, u, z, linear.spread, linear.residual)
    best = np.argmin(misfit, axis=0)
    return z[best, np.arange(z.shape[1])][None]


def held_out_score(peak: Peak, row: int, cuts: Cuts, told: Cuts | None = None, begun: Array | None = None) -> Score:
    """Predict held-out windows.

    The parameters' Gaussian posterior is carried through. With its covariance C, the windows' reduced matrices H and
    vectors g, weighed as in the fit, and u = (H + C^-1)^-1 g, the log density is that at the shift u of the parameters,
    less u^T C^-1 u / 2 and ln det(1 + C H) / 2.

    Args:
        peak: the fit.
        row: which of its points.
        cuts: held-out windows of the fit's length, which are scored.
        told: longer ones over the same time, whose errors are told; None: the same.
        begun: (1, W, NUISANCES) of the held-out windows, from which they are settled as well as from rest.
    """
    objective = replace(peak.objective, cuts=cuts)
    u = peak.coordinates[row : row + 1]
    z = settle(objective, u, begun)
    linear = objective.linearise(u, z)
    reduced = reduce(linear, z)
    misfit = objective.misfit(linear.residual, z)[0]
    precision = np.linalg.inv(peak.covariance(row))
    shift, shifted = np.zeros(len(precision)), misfit
    for _ in range(REWEIGHED):
        matrix, vector = (each[0] for each in reduced.weighed(objective.weights(shifted[None])))
        shift = np.linalg.solve(matrix + precision, vector)
        along = np.einsum("wk,k->w", reduced.vector[0], shift)
        across = np.einsum("k,wkl,l->w", shift, reduced.matrix[0], shift)
        shifted = np.maximum(misfit - 2.0 * along + across, 0.0)
    value = float(objective.likelihood(shifted[None])[0]) - 0.5 * float(reduced.log_det[0])
    value -= 0.5 * float(shift @ precision @ shift)
    value -= 0.5 * float(np.linalg.slogdet(np.eye(len(matrix)) + np.linalg.solve(precision, matrix))[1])
    longer = objective if told is None else replace(objective, cuts=told)
    forecast = errors(longer.residual(u, longer.at_rest(1)), longer.cuts)
    return Score(value, *forecast, errors(longer.residual(u, settle(longer, u)), longer.cuts)[0])


def errors(residual: Array, cuts: Cuts) -> tuple[float, float]:
    """Return root mean squares of position [m] and yaw [rad] of residuals (1, W, R)."""
    weight = cuts.weight
    off = residual.reshape(*weight.shape) / np.where(weight > 0.0, weight, 1.0)
    seen = weight > 0.0
    place = seen[..., 0] & seen[..., 1]
    position = math.sqrt(float(np.mean(np.sum(off[..., :2][place] ** 2, axis=1)))) if place.any() else math.nan
    yaw = math.sqrt(float(np.mean(off[..., 2][seen[..., 2]] ** 2))) if seen[..., 2].any() else math.nan
    return position, yaw


def noise_floor(cuts: Cuts) -> tuple[float, float]:
    """Return what a perfect model would reach: the noise of poses in position [m] and yaw [rad]."""
    seen = cuts.weight > 0.0
    variance = np.where(seen, 1.0 / np.maximum(cuts.weight, 1e-12) ** 2, 0.0)
    place = seen[..., 0] & seen[..., 1]
    position = math.sqrt(float(np.mean(variance[..., :2][place].sum(axis=1)))) if place.any() else math.nan
    yaw = math.sqrt(float(np.mean(variance[..., 2][seen[..., 2]]))) if seen[..., 2].any() else math.nan
    return position, yaw
