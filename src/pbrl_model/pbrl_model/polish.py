"""Damped Gauss-Newton from many starts at once, on the marginal likelihood of a target.

Every iteration costs one kernel call for all starts: K differences in the parameters and nine in the nuisances. The
covariance of the residuals is frozen within an iteration, noise scales are then set to their best, and a step is
taken only where the density grows.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.target import Point, Target

Array = NDArray[np.float64]

STEP = 1e-3
"""Finite difference in a parameter, as a share of its prior's spread."""
DAMPINGS = np.array([0.1, 1.0, 10.0])
"""Tried at once, times each start's own damping."""
NOISE_MOVES = np.array(list(itertools.product((0.0, 1.0, -1.0), repeat=2)))
"""Moves of ln sigma and ln drag that are tried together."""


@dataclass(frozen=True)
class Modes:
    """Where the polish ended.

    Attributes:
        point: (M,) positions with their densities and linearisations.
        covariance: (M, D, D) of the Gaussian that fits there.
    """

    point: Point
    covariance: Array

    def take(self, rows: NDArray[np.int64]) -> Modes:
        """Return a selection."""
        return Modes(self.point.take(rows), self.covariance[rows])


def polish(target: Target, starts: Array, spread: Array, *, iterations: int) -> Modes:
    """Climb from every start.

    Args:
        target: log density.
        starts: (M, D) within the prior's support.
        spread: (K,) scale of each learned parameter.
        iterations: at most so many.
    """
    point = target.evaluate(starts, target.likelihood.at_rest(len(starts)))
    for rounds in (6, 3, 3):
        point = target.settle(_fit_noise(target, point, rounds=rounds))
    damping = np.full(len(starts), 1e-2)
    for _ in range(iterations):
        curvature, slope = _slopes(target, point, spread)
        moved, gained = _best_step(target, point, curvature, slope, damping)
        damping = np.clip(np.where(gained, damping * 0.2, damping * 30.0), 1e-8, 1e8)
        if not np.any(gained):
            if np.all(damping > 1e4):
                break
            continue
        point = _fit_noise(target, target.settle(moved), rounds=2)
    point = _fit_noise(target, point, rounds=8)  # above only as closely as the climb needs
    curvature, _ = _slopes(target, point, spread)
    return Modes(point, _covariance(target, point, curvature))


def _fit_noise(target: Target, point: Point, rounds: int) -> Point:
    """Set the noise scales to their best by a pattern search: no rollouts are needed."""
    position = point.position.copy()
    count, k = len(position), len(target.names)
    value = target.log_prior(position) + target.log_likelihood(position, point.residuals, point.linear)
    width = np.full(count, 0.8)
    everyone = np.arange(count)
    for _ in range(rounds):
        values = []
        for move in NOISE_MOVES[1:]:
            trial = position.copy()
            trial[:, k:] += width[:, None] * move
            values.append(target.log_prior(trial) + target.log_likelihood(trial, point.residuals, point.linear))
        table = np.stack([value, *values])
        best = np.argmax(table, axis=0)
        position[:, k:] += width[:, None] * NOISE_MOVES[best]
        value = table[best, everyone]
        width = np.where(best == 0, 0.5 * width, width)
    return replace(point, position=position, log_density=value)


def _slopes(target: Target, point: Point, spread: Array) -> tuple[Array, Array]:
    """Return curvature (M, K, K) and ascent direction (M, K) of the log density in the parameters."""
    k = len(target.names)
    _, upper = target.prior.bounds
    base_prior = target.prior.log_prob(point.position[:, :k])
    derivatives = np.empty((*point.residuals.shape, k))
    slope_prior = np.zeros((len(point.position), k))
    for column in range(k):
        moved = point.position.copy()
        step = np.where(moved[:, column] + STEP * spread[column] > upper[column], -STEP, STEP) * spread[column]
        if target.prior.periodic[column]:
            step = np.full(len(moved), STEP * spread[column])
        moved[:, column] += step
        residuals = target.residuals(moved, point.linear.nuisance)
        derivatives[..., column] = (point.residuals - residuals) / step[:, None, None]
        slope_prior[:, column] = (target.prior.log_prob(moved[:, :k]) - base_prior) / step
    curvature, slope = target.normal_equations(point, derivatives)
    return curvature + np.diag(1.0 / spread**2), slope + np.where(np.isfinite(slope_prior), slope_prior, 0.0)


def _best_step(
    target: Target, point: Point, curvature: Array, slope: Array, damping: Array
) -> tuple[Point, NDArray[np.bool_]]:
    """Try steps of several dampings, kept within the support; return (points, whether each gained)."""
    count, k = slope.shape
    diagonal = np.einsum("mii->mi", curvature)
    lower, upper = target.prior.bounds
    periodic = target.prior.periodic
    trials, values, all_residuals = [point.position], [point.log_density], [point.residuals]
    for factor in DAMPINGS:
        damped = curvature + (factor * damping)[:, None, None] * diagonal[:, :, None] * np.eye(k)
        trial = point.position.copy()
        trial[:, :k] += np.linalg.solve(damped, slope[..., None])[..., 0]
        inside = np.clip(trial[:, :k], np.where(periodic, -np.inf, lower), np.where(periodic, np.inf, upper))
        at_zero = (lower == 0.0) & np.isinf(upper)  # a log-normal's support is open: shrink by half at most
        trial[:, :k] = np.where(at_zero, np.maximum(inside, 0.5 * point.position[:, :k]), inside)
        value = target.log_prior(trial)
        residuals = target.residuals(trial, point.linear.nuisance)
        value = value + target.log_likelihood(trial, residuals, point.linear)
        trials.append(trial)
        all_residuals.append(residuals)
        values.append(np.where(np.isfinite(value), value, -np.inf))
    best = np.argmax(np.stack(values), axis=0)
    chosen = [np.stack(columns)[best, np.arange(count)] for columns in (trials, values, all_residuals)]
    return Point(chosen[0], chosen[1], chosen[2], point.linear), best > 0


def _covariance(target: Target, point: Point, curvature: Array) -> Array:
    """Return (M, D, D): inverse curvature for the parameters, a modest guess for the noise."""
    k = len(target.names)
    out = np.zeros((len(point.position), target.dimension, target.dimension))
    out[:, :k, :k] = np.linalg.inv(curvature)
    out[:, k, k] = 0.5 / max(target.likelihood.windows.observations, 1)
    out[:, k + 1, k + 1] = 0.5 / max(3 * len(target.likelihood.windows), 1)
    return out
