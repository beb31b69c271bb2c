"""Damped Gauss-Newton from many starts at once, on the marginal likelihood of a target.

Every iteration costs one kernel call for all starts: K differences in the parameters and nine in the nuisances. The
covariance of the residuals is frozen within an iteration, noise scales are then set to their best, and a step is
taken only where the density grows.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.fitting.coordinates import Coordinates
from pbrl_model.fitting.target import Point, Target

Array = NDArray[np.float64]

STEP = 1e-3
"""Finite difference in a coordinate, as a share of its prior's spread."""
LONGEST = 2.0
"""No step is longer than so many of the prior's spreads."""
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


def polish(target: Target, starts: Array, *, iterations: int) -> Modes:
    """Climb from every start, in coordinates without bounds: see `Coordinates`.

    Args:
        target: log density.
        starts: (M, D) within the prior's support.
        iterations: at most so many.
    """
    slope = Slopes(target)
    point = target.evaluate(slope.coordinates.inside(starts), target.likelihood.at_rest(len(starts)))
    for rounds in (6, 3, 3):
        point = target.settle(_fit_noise(target, point, rounds=rounds))
    damping = np.full(len(starts), 1e-2)
    for _ in range(iterations):
        curvature, ascent = slope.at(point)
        moved, gained = _best_step(target, slope, point, curvature, ascent, damping)
        damping = np.clip(np.where(gained, damping * 0.2, damping * 30.0), 1e-8, 1e8)
        if not np.any(gained):
            if np.all(damping > 1e4):
                break
            continue
        point = _fit_noise(target, target.settle(moved), rounds=2)
    point = _fit_noise(target, point, rounds=8)  # above only as closely as the climb needs
    curvature, _ = slope.at(point)
    return Modes(point, _covariance(target, slope, point, curvature))


def _fit_noise(target: Target, point: Point, rounds: int) -> Point:
    """Set the noise scales to their best by a pattern search: no rollouts are needed."""
    position = point.position.copy()
    count, k = len(position), target.simulated
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


class Slopes:
    """Curvature and ascent of a target's log density over the coordinates of what is simulated.

    Attributes:
        coordinates: of the climb.
        scale: (S,) spread of the prior over them.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self.coordinates = Coordinates(target, merged=False)
        self.scale = self.coordinates.scale[: target.simulated]

    def at(self, point: Point) -> tuple[Array, Array]:
        """Return curvature (M, S, S) and ascent direction (M, S) at points, by differences in every column."""
        target, k = self._target, self._target.simulated
        here = self.coordinates.of(point.position)
        prior = self.coordinates.log_prior(here)
        derivatives = np.empty((*point.residuals.shape, k))
        ascent = np.zeros((len(here), k))
        for column in range(k):
            moved = here.copy()
            moved[:, column] += STEP * self.scale[column]
            residuals = target.residuals(self.coordinates.positions(moved), point.linear.nuisance)
            derivatives[..., column] = (point.residuals - residuals) / (STEP * self.scale[column])
            ascent[:, column] = (self.coordinates.log_prior(moved) - prior) / (STEP * self.scale[column])
        curvature, slope = target.normal_equations(point, derivatives)
        return curvature + np.diag(1.0 / self.scale**2), slope + ascent


def _best_step(
    target: Target, slope: Slopes, point: Point, curvature: Array, ascent: Array, damping: Array
) -> tuple[Point, NDArray[np.bool_]]:
    """Try steps of several dampings; return (points, whether each gained)."""
    count, k = ascent.shape
    diagonal = np.einsum("mii->mi", curvature)
    here = slope.coordinates.of(point.position)

    trials, all_residuals, likely = [point.position], [point.residuals], []
    gain = []
    for factor in (math.inf, *DAMPINGS):
        moved = here.copy()
        if math.isfinite(factor):
            damped = curvature + (factor * damping)[:, None, None] * diagonal[:, :, None] * np.eye(k)
            step = np.linalg.solve(damped, ascent[..., None])[..., 0]
            longest = np.max(np.abs(step) / slope.scale, axis=1)
            moved[:, :k] += step * np.minimum(1.0, LONGEST / np.maximum(longest, 1e-12))[:, None]
            trials.append(slope.coordinates.positions(moved))
            all_residuals.append(target.residuals(trials[-1], point.linear.nuisance))
        likely.append(target.log_likelihood(trials[-1], all_residuals[-1], point.linear))
        value = slope.coordinates.log_prior(moved) + likely[-1]
        gain.append(np.where(np.isfinite(value), value, -np.inf))
    best = np.argmax(np.stack(gain), axis=0)
    position, residuals, found = (
        np.stack(all_of)[best, np.arange(count)] for all_of in (trials, all_residuals, likely)
    )
    return Point(position, target.log_prior(position) + found, residuals, point.linear), best > 0


def _covariance(target: Target, slope: Slopes, point: Point, curvature: Array) -> Array:
    """Return (M, D, D) over positions: inverse curvature for what is simulated, a modest guess for the noise."""
    k = target.simulated
    out = np.zeros((len(point.position), target.dimension, target.dimension))
    rate = slope.coordinates.rates(slope.coordinates.of(point.position))[:, :k]
    out[:, :k, :k] = np.linalg.inv(curvature) * rate[:, :, None] * rate[:, None, :]
    out[:, k, k] = 0.5 / max(target.likelihood.windows.observations, 1)
    out[:, k + 1, k + 1] = 0.5 / max(3 * len(target.likelihood.windows), 1)
    return out
