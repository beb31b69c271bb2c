"""Damped least squares (Levenberg-Marquardt) of many starts at once, the nuisances of each window eliminated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.search.objective import Objective, Reduced, reduce

Array = NDArray[np.float64]

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e8
EASIER, HARDER = 0.3, 6.0
TRIALS = 3
SETTLED = 0.02
"""A gain below this [nat] of all starts ends the climb."""


@dataclass(frozen=True)
class Peak:
    """Where a climb has come to, for P starts.

    Attributes:
        objective: what was minimised.
        coordinates: (P, K).
        nuisance: (P, W, NUISANCES).
        misfit: (P,) of the data, not scaled.
        sigma: (P,) scale of the noise, at least one.
        reduced: normal equations there.
        evidence: (P,) log evidence by Laplace [nat], up to what is common to all hypotheses over these windows.
        settled: (P,) whether the last step gained next to nothing.
    """

    objective: Objective
    coordinates: Array
    nuisance: Array
    misfit: Array
    sigma: Array
    reduced: Reduced
    evidence: Array
    settled: NDArray[np.bool_]

    def covariance(self, row: int) -> Array:
        """Return (K, K) of the coordinates at one point."""
        return np.linalg.inv(_curvature(self.objective, self.reduced.matrix[row : row + 1], self.sigma[row : row + 1]))[
            0
        ]

    @property
    def best(self) -> int:
        """Return the row of the highest evidence."""
        return int(np.argmax(self.evidence))

    def take(self, rows: NDArray[np.int64]) -> Peak:
        """Return some of the points."""
        r = self.reduced
        return Peak(
            self.objective,
            self.coordinates[rows],
            self.nuisance[rows],
            self.misfit[rows],
            self.sigma[rows],
            Reduced(r.matrix[rows], r.vector[rows], r.gain[rows], r.shift[rows], r.log_det[rows]),
            self.evidence[rows],
            self.settled[rows],
        )


def _scale(misfit: Array, count: int) -> Array:
    return np.sqrt(np.maximum(1.0, misfit / count))


def _cost(misfit: Array, prior: Array, count: int) -> Array:
    """Return (P,) minus twice the log posterior at the best sigma of at least one."""
    sigma = _scale(misfit, count)
    return misfit / sigma**2 + 2.0 * count * np.log(sigma) + prior


def _curvature(objective: Objective, matrix: Array, sigma: Array) -> Array:
    return matrix / (sigma**2)[:, None, None] + np.diag(objective.hypothesis.spread**-2.0)


def log_evidence(objective: Objective, coordinates: Array, misfit: Array, reduced: Reduced) -> Array:
    """Return (P,) log evidence by Laplace at points, up to a constant of the windows [nat]."""
    count = objective.observations
    sigma = _scale(misfit, count)
    spread = objective.hypothesis.spread
    _, log_det = np.linalg.slogdet(_curvature(objective, reduced.matrix, sigma) * np.outer(spread, spread))
    likelihood = -0.5 * misfit / sigma**2 - count * np.log(sigma) - 0.5 * reduced.log_det
    return likelihood - 0.5 * objective.prior_misfit(coordinates) - 0.5 * log_det


def climb(objective: Objective, coordinates: Array, nuisance: Array | None = None, *, iterations: int = 12) -> Peak:
    """Minimise from many starts.

    Args:
        objective: hypothesis and windows.
        coordinates: (P, K) starts.
        nuisance: (P, W, NUISANCES) to begin with; None: at rest.
        iterations: linearisations at most.
    """
    u = coordinates.copy()
    z = objective.at_rest(len(u)) if nuisance is None else nuisance.copy()
    count = objective.observations
    damping = np.full(len(u), FIRST_DAMPING)
    prior_precision = objective.hypothesis.spread**-2.0
    gained = np.full(len(u), math.inf)
    most = 3.0 * objective.hypothesis.spread
    for _ in range(iterations):
        linear = objective.linearise(u, z)
        reduced = reduce(linear, z)
        misfit = objective.misfit(linear.residual, z)
        cost = _cost(misfit, objective.prior_misfit(u), count)
        gained[:] = 0.0
        open_rows = np.arange(len(u))
        sigma = _scale(misfit, count)
        curvature = _curvature(objective, reduced.matrix, sigma)
        pull = reduced.vector / (sigma**2)[:, None] - (u - objective.hypothesis.mean) * prior_precision
        for _ in range(TRIALS):
            damped = curvature[open_rows] + damping[open_rows, None, None] * _diagonal(curvature[open_rows])
            step = np.linalg.solve(damped, pull[open_rows, :, None])[..., 0]
            step *= np.minimum(1.0, 1.0 / np.max(np.abs(step) / most + 1e-12, axis=1))[:, None]
            shift = reduced.shift[open_rows] - (reduced.gain[open_rows] @ step[:, None, :, None])[..., 0]
            trial_u, trial_z = u[open_rows] + step, z[open_rows] + shift
            residual = objective.residual(trial_u, trial_z)
            trial = _cost(objective.misfit(residual, trial_z), objective.prior_misfit(trial_u), count)
            better = trial < cost[open_rows]
            rows = open_rows[better]
            u[rows], z[rows] = trial_u[better], trial_z[better]
            gained[rows] = 0.5 * (cost[rows] - trial[better])
            damping[rows] = np.maximum(damping[rows] * EASIER, LEAST_DAMPING)
            open_rows = open_rows[~better]
            damping[open_rows] = np.minimum(damping[open_rows] * HARDER, MOST_DAMPING)
            if len(open_rows) == 0:
                break
        if np.all(gained < SETTLED):
            break
    linear = objective.linearise(u, z)
    reduced = reduce(linear, z)
    misfit = objective.misfit(linear.residual, z)
    evidence = log_evidence(objective, u, misfit, reduced)
    return Peak(objective, u, z, misfit, _scale(misfit, count), reduced, evidence, gained < 1.0)


def _diagonal(matrices: Array) -> Array:
    """Return (P, K, K) their diagonals as matrices."""
    return matrices * np.eye(matrices.shape[-1])
