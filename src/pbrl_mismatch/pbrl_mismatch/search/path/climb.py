"""Damped least squares (Levenberg-Marquardt) of many starts at once along a recorded path."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.search.hypothesis import Hypothesis, step_sizes
from pbrl_mismatch.search.path.along import Along
from pbrl_mismatch.search.quiet import Holding, of_little

Array = NDArray[np.float64]

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e6
EASIER, HARDER = 0.2, 8.0
SETTLED, PATIENCE, STEEP = 0.05, 2, 1e3
"""A start that gains less than this [nat] in so many steps is left where it is, and so is one that gains nothing where
it is damped by more than that."""


@dataclass(frozen=True)
class PathPeak:
    """Where a climb along the path has come to, for P starts.

    Attributes:
        hypothesis: what was fitted.
        coordinates: (P, K).
        misfit: (P, W) of the data, not scaled.
        counts: (W,) how many numbers were observed.
        evidence: (P,) log evidence by Laplace [nat], up to what is common to all hypotheses over these windows.
        matrix: (P, K, K) curvature of the misfit in the coordinates, at the windows' scales.
    """

    hypothesis: Hypothesis
    coordinates: Array
    misfit: Array
    evidence: Array
    counts: Array
    matrix: Array

    def covariance(self, row: int) -> Array:
        """Return (K, K) of the coordinates at one point."""
        return np.asarray(np.linalg.inv(self.matrix[row] + np.diag(self.hypothesis.spread**-2.0)), dtype=np.float64)

    def log_posterior(self, row: int) -> float:
        """Return the log posterior density at one point [nat]: its evidence without the volume about it."""
        spread = self.hypothesis.spread
        _, log_det = np.linalg.slogdet(self.matrix[row] * np.outer(spread, spread) + np.eye(len(spread)))
        return float(self.evidence[row] + 0.5 * log_det)

    def take(self, rows: NDArray[np.int64]) -> PathPeak:
        """Return some of the points, in that order."""
        return replace(
            self,
            coordinates=self.coordinates[rows],
            misfit=self.misfit[rows],
            evidence=self.evidence[rows],
            matrix=self.matrix[rows],
        )

    @property
    def noise_scale(self) -> float:
        """Return the least scale of the noise over all windows that a start needs, at least one."""
        return float(np.sqrt(max(1.0, self.misfit.sum(axis=1).min() / self.counts.sum())))


def weights(along: Along, misfit: Array) -> Array:
    """Return (P, W) one over the square of each window's scale: its best one that is at least one."""
    return 1.0 / np.maximum(1.0, misfit / along.counts)


def likelihood(along: Along, misfit: Array) -> Array:
    """Return (P,) log likelihoods at the windows' best scales, up to what is common to all hypotheses [nat]."""
    weight = weights(along, misfit)
    return along.log_det + np.sum(-0.5 * misfit * weight + 0.5 * along.counts * np.log(weight), axis=1)


def climb_along(along: Along, hypothesis: Hypothesis, starts: Array, iterations: int) -> PathPeak:
    """Minimise from many starts.

    Args:
        along: windows along a path.
        hypothesis: what is free.
        starts: (P, K).
        iterations: steps at most.
    """
    u, count, free = hypothesis.believable(starts), len(starts), starts.shape[1]
    steps, spread, mean = step_sizes(hypothesis), hypothesis.spread, hypothesis.mean
    damping, most, holding = np.full(count, FIRST_DAMPING), 3.0 * spread, Holding(count, spread**-2.0)
    every = np.arange(count)
    moves = np.diag(steps)

    def prior(points: Array) -> Array:
        return np.sum(((points - mean) / spread) ** 2, axis=1)

    def lacking(points: Array) -> Array:
        return along.residual(hypothesis.rows(points)).reshape(len(points), *along.operator.shape[1:2], -1)

    def slopes(points: Array, residual: Array) -> Array:
        moved = lacking((points[:, None] + moves).reshape(-1, free)).reshape(len(points), free, *residual.shape[1:])
        slope = (residual[:, None] - moved) / steps[None, :, None, None]
        return np.clip(np.moveaxis(slope, 1, -1), -1e5, 1e5)

    def normal(residual: Array, slope: Array, weight: Array) -> tuple[Array, Array]:
        scaled = slope * np.sqrt(weight)[:, :, None, None]
        flat = scaled.reshape(len(scaled), -1, free)
        rest = (residual * np.sqrt(weight)[:, :, None]).reshape(len(scaled), -1, 1)
        return np.swapaxes(flat, 1, 2) @ flat, (np.swapaxes(flat, 1, 2) @ rest)[..., 0]

    residual = lacking(u)
    slope, misfit = slopes(u, residual), np.sum(residual**2, axis=2)
    idle, on = np.zeros(count, dtype=np.int64), every
    for _ in range(iterations):
        matrix, vector = normal(residual[on], slope[on], weights(along, misfit[on]))
        cost = -2.0 * likelihood(along, misfit[on]) + prior(u[on])
        curvature = matrix + np.diag(spread**-2.0)
        pull = vector - (u[on] - mean) / spread**2
        diagonal = curvature * np.eye(free)
        quiet = of_little(matrix, spread**-2.0)
        damped = curvature + damping[on, None, None] * diagonal + holding.added(on, quiet)
        step = np.linalg.solve(damped, pull[..., None])[..., 0]
        step *= np.minimum(1.0, 1.0 / np.max(np.abs(step) / most + 1e-12, axis=1))[:, None]
        trial = hypothesis.believable(u[on] + step)
        there_residual = lacking(trial)
        there = np.sum(there_residual**2, axis=2)
        gained = 0.5 * (cost - (-2.0 * likelihood(along, there) + prior(trial)))
        better = gained > 0.0
        moved, left = on[better], on[~better]
        u[moved], misfit[moved], residual[moved] = trial[better], there[better], there_residual[better]
        if len(moved):
            slope[moved] = slopes(u[moved], residual[moved])
        # First without what is quiet, and only then a shorter step.
        shorter = holding.failed(left, quiet[~better])
        holding.stepped(moved, gained[better])
        damping[moved], damping[shorter] = damping[moved] * EASIER, damping[shorter] * HARDER
        damping = np.clip(damping, LEAST_DAMPING, MOST_DAMPING)
        idle[moved] = np.where(gained[better] < SETTLED, idle[moved] + 1, 0)
        on = on[np.where(better, idle[on] < PATIENCE, damping[on] <= STEEP)]
        if len(on) == 0:
            break
    matrix, _ = normal(residual, slope, weights(along, misfit))
    _, log_det = np.linalg.slogdet(matrix * np.outer(spread, spread) + np.eye(free))
    evidence = likelihood(along, misfit) - 0.5 * prior(u) - 0.5 * log_det
    return PathPeak(hypothesis, u, misfit, evidence, along.counts, matrix)
