"""How well a fitted model predicts windows that it was not fitted to."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.search.climb import Peak
from pbrl_mismatch.search.objective import Objective, reduce

Array = NDArray[np.float64]

SETTLING_ROUNDS = 3


@dataclass(frozen=True)
class Score:
    """Errors over held-out windows, their unknown starts estimated.

    Attributes:
        log_score: log density of the held-out poses, parameters integrated out [nat], up to a constant of the windows.
        rmse_position: [m].
        rmse_yaw: [rad]; NaN where it was not seen.
    """

    log_score: float
    rmse_position: float
    rmse_yaw: float


def settle(objective: Objective, coordinates: Array) -> Array:
    """Return the most likely nuisances (1, W, NUISANCES) at coordinates (1, K)."""
    z = objective.at_rest(1)
    for _ in range(SETTLING_ROUNDS):
        linear = objective.linearise(coordinates, z)
        here = np.sum(linear.residual**2, axis=2) + np.sum(z**2, axis=2)
        trial = z + reduce(linear, z).shift
        there = np.sum(objective.residual(coordinates, trial) ** 2, axis=2) + np.sum(trial**2, axis=2)
        z = np.where((there < here)[..., None], trial, z)
    return z


def held_out_score(peak: Peak, row: int, cuts: Cuts) -> Score:
    """Predict held-out windows.

    The parameters' Gaussian posterior is carried through: with its covariance C, the windows' reduced matrix H and
    vector g, the log density gains g^T (H + C^-1)^-1 g / 2 - ln det(1 + C H) / 2.

    Args:
        peak: the fit.
        row: which of its points.
        cuts: held-out windows.
    """
    objective = replace(peak.objective, cuts=cuts)
    u, sigma = peak.coordinates[row : row + 1], float(peak.sigma[row])
    z = settle(objective, u)
    linear = objective.linearise(u, z)
    reduced = reduce(linear, z)
    matrix, vector = reduced.matrix[0] / sigma**2, reduced.vector[0] / sigma**2
    covariance = peak.covariance(row)
    misfit = float(objective.misfit(linear.residual, z)[0])
    value = -0.5 * misfit / sigma**2 - objective.observations * math.log(sigma) - 0.5 * float(reduced.log_det[0])
    value += 0.5 * float(vector @ np.linalg.solve(matrix + np.linalg.inv(covariance), vector))
    value -= 0.5 * float(np.linalg.slogdet(np.eye(len(matrix)) + covariance @ matrix)[1])
    return Score(value, *errors(linear.residual, cuts))


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
