"""Damped Gauss-Newton (Levenberg-Marquardt) from many starts at once.

Every iteration costs two batched calls: one for the differences of all starts in all columns, one for trial steps of
three dampings. Bounds are kept by holding columns that would leave; the noise scale is solved in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.inference.metered import Metered

Array = NDArray[np.float64]

STEPS = (1e-7, 1e-3)
"""Shortest and longest finite difference, as shares of the prior's spread."""
STEP_SD = 1.0
"""Finite difference in posterior standard deviations: short enough to be local, long enough to smooth over kinks."""
DAMPINGS = np.array([0.1, 1.0, 10.0])
"""Tried at once, times each start's own damping."""
ENOUGH = 1e-3
"""A start rests once an iteration gains less than this [nat]."""
PRIOR_STEP = 1e-2
"""Finite difference for the prior's slope, as a share of its spread."""


@dataclass(frozen=True)
class Optima:
    """Where starts are.

    Attributes:
        theta: (S, D).
        value: (S,) log density up to a constant of the horizon's share; -inf where it is zero.
        residuals: (S, M).
        damping: (S,).
        curvature: (S, D, D) of minus the log density as last computed; of noise scale and prior's spread as well.
    """

    theta: Array
    value: Array
    residuals: Array
    damping: Array
    curvature: Array

    def take(self, rows: NDArray[np.int64]) -> Optima:
        """Return some of the rows."""
        return Optima(
            self.theta[rows], self.value[rows], self.residuals[rows], self.damping[rows], self.curvature[rows]
        )

    def put(self, rows: NDArray[np.int64], other: Optima) -> Optima:
        """Return the rows replaced by those of another."""
        merged = [np.array(part) for part in (self.theta, self.value, self.residuals, self.damping, self.curvature)]
        parts = (other.theta, other.value, other.residuals, other.damping, other.curvature)
        for whole, part in zip(merged, parts, strict=True):
            whole[rows] = part
        return Optima(*merged)


def begin(meter: Metered, theta: Array, share: float) -> Optima:
    """Evaluate starts (S, D), brought into the bounds, on a share of the horizon."""
    start = meter.domain.clip(theta)
    residuals = meter.residuals(start, share)
    start, value = meter.posterior(start, residuals)
    flat = np.tile(np.diag(meter.spread**-2.0), (len(start), 1, 1))
    return Optima(start, value, residuals, np.full(len(start), 1e-2), flat)


def climb(meter: Metered, optima: Optima, share: float, iterations: int) -> Optima:
    """Climb from every start, at most so many iterations; starts that have arrived rest and cost nothing."""
    moving = np.flatnonzero(np.isfinite(optima.value))
    for _ in range(iterations):
        if len(moving) == 0:
            break
        here = optima.take(moving)
        curvature, slope = slopes(meter, here, share)
        there = _best_step(meter, here, curvature, slope, share)
        optima = optima.put(moving, there)
        gained = there.value - here.value
        moving = moving[(gained > ENOUGH) | ((gained <= 0.0) & (there.damping < 1e4))]
    return optima


def slopes(
    meter: Metered, here: Optima, share: float, *, step_sd: float = STEP_SD, both_sides: bool = False
) -> tuple[Array, Array]:
    """Return curvature (S, D, D) and ascent direction (S, D) of the log density.

    Args:
        meter: of the problem.
        here: positions.
        share: of the horizon.
        step_sd: length of the differences in standard deviations.
        both_sides: central differences, for a covariance; one-sided ones else.
    """
    derivatives = _jacobian(meter, here, share, step_sd, both_sides=both_sides)
    count, dimension = here.theta.shape
    noise = meter.problem.noise_column
    precision = np.ones(count) if noise is None else np.exp(-2.0 * here.theta[:, noise])
    curvature = precision[:, None, None] * np.einsum("sim,sjm->sij", derivatives, derivatives)
    slope = -precision[:, None] * np.einsum("sim,sm->si", derivatives, here.residuals)
    prior_slope, prior_curvature = _prior_slopes(meter, here.theta)
    diagonal = np.arange(dimension)
    curvature[:, diagonal, diagonal] += np.maximum(prior_curvature, meter.spread**-2.0)
    slope += prior_slope
    if noise is not None:
        curvature[:, noise, :] = curvature[:, :, noise] = 0.0
        curvature[:, noise, noise] = 2.0 * here.residuals.shape[1] + meter.spread[noise] ** -2.0
        slope[:, noise] = 0.0
    return curvature, slope


def _jacobian(meter: Metered, here: Optima, share: float, step_sd: float, *, both_sides: bool) -> Array:
    """Return (S, D, M) derivatives of the residuals; zero for the noise column."""
    count, dimension = here.theta.shape
    columns = np.array([c for c in range(dimension) if c != meter.problem.noise_column])
    sd = 1.0 / np.sqrt(np.einsum("sii->si", here.curvature))
    longest = np.inf if both_sides else STEPS[1]
    step = np.clip(step_sd * sd, STEPS[0] * meter.spread, longest * meter.spread)
    lower, upper = meter.domain.bounds
    circle = meter.domain.periodic
    step = np.minimum(step, np.where(circle, np.inf, 0.25 * (upper - lower)))
    up = np.where(circle, here.theta + step, np.minimum(here.theta + step, upper))
    down = np.where(circle, here.theta - step, np.maximum(here.theta - step, lower))
    if not both_sides:  # whichever side has room
        up = np.where(up - here.theta < 0.5 * step, down, up)
    ends = (up, down) if both_sides else (up,)
    trials = np.repeat(here.theta[None, :, None, :], len(ends), axis=0).repeat(len(columns), axis=2)
    for side, end in enumerate(ends):
        for k, column in enumerate(columns):
            trials[side, :, k, column] = end[:, column]
    flat = meter.domain.fold(trials.reshape(-1, dimension))
    flat = np.clip(flat, lower, upper)
    found = meter.residuals(flat, share).reshape(len(ends), count, len(columns), -1)
    other = found[1] if both_sides else here.residuals[:, None, :]
    width = (up - down if both_sides else up - here.theta)[:, columns]
    out = np.zeros((count, dimension, here.residuals.shape[1]))
    out[:, columns] = (found[0] - other) / width[:, :, None]
    finite = np.isfinite(out)
    return out if finite.all() else np.where(finite, out, 0.0)


def _prior_slopes(meter: Metered, theta: Array) -> tuple[Array, Array]:
    """Return slope and minus the curvature (S, D) of the log prior by differences; zero beside its ends."""
    count, dimension = theta.shape
    step = PRIOR_STEP * meter.spread
    moved = theta + step * np.stack([np.eye(dimension), -np.eye(dimension)])[:, :, None, :]  # (2, D, S, D)
    flat = meter.domain.fold(moved.reshape(-1, dimension))
    values = meter.problem.log_prior(np.concatenate([theta, flat]))
    values[count:][~meter.domain.inside(flat)] = -np.inf
    up, down = values[count:].reshape(2, dimension, count)
    whole = np.isfinite(up) & np.isfinite(down)
    up, down = np.where(whole, up, 0.0), np.where(whole, down, 0.0)
    middle = np.where(whole, values[:count], 0.0)
    return ((up - down) / (2.0 * step[:, None])).T, ((2.0 * middle - up - down) / step[:, None] ** 2).T


def _best_step(meter: Metered, here: Optima, curvature: Array, slope: Array, share: float) -> Optima:
    """Try steps of several dampings within the bounds and keep the best that gains."""
    count, dimension = slope.shape
    lower, upper = meter.domain.bounds
    stuck = ~meter.domain.periodic & (((here.theta <= lower) & (slope < 0.0)) | ((here.theta >= upper) & (slope > 0.0)))
    free = ~stuck
    matrix = np.where(free[:, :, None] & free[:, None, :], curvature, 0.0)
    diagonal = np.where(free, np.einsum("sii->si", curvature), 1.0)
    index = np.arange(dimension)
    trials = []
    for factor in DAMPINGS:
        damped = matrix.copy()
        damped[:, index, index] = diagonal * (1.0 + (factor * here.damping)[:, None])
        move = np.linalg.solve(damped, np.where(free, slope, 0.0)[:, :, None])[:, :, 0]
        trials.append(meter.domain.clip(here.theta + move))
    flat = np.concatenate(trials)
    residuals = meter.residuals(flat, share)
    flat, value = meter.posterior(flat, residuals)
    table = np.concatenate([here.value[None], value.reshape(len(DAMPINGS), count)])
    best = np.argmax(table, axis=0)
    rows = np.where(best == 0, 0, (best - 1) * count + np.arange(count))
    won = best > 0
    damping = here.damping * np.where(won, 0.3 * DAMPINGS[np.maximum(best - 1, 0)], 30.0)
    return Optima(
        np.where(won[:, None], flat[rows], here.theta),
        np.where(won, value[rows], here.value),
        np.where(won[:, None], residuals[rows], here.residuals),
        np.clip(damping, 1e-8, 1e8),
        curvature,
    )
