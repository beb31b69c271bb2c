"""Damped least squares (Levenberg-Marquardt) of many starts at once, the nuisances of each window eliminated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.search.objective import Objective, Reduced, nuisance_step, reduce
from pbrl_mismatch.search.quiet import Holding, of_little

Array = NDArray[np.float64]

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e8
EASIER, HARDER = 0.3, 6.0
TRIALS = 4
ROUNDS, SHORTER = 4, 0.3
"""Steps of the nuisances alone at most; how much shorter a window's next one is where one was too long."""
FRESH = 2
"""Slopes in the nuisances are taken anew every so many steps."""
SETTLED = 0.02
"""A gain below this [nat] of all starts ends the climb."""
PATIENCE = 2
"""A start that gains less than that in so many steps one after the other is left where it is."""


@dataclass(frozen=True)
class Peak:
    """Where a climb has come to, for P starts.

    Attributes:
        objective: what was minimised.
        coordinates: (P, K).
        nuisance: (P, W, NUISANCES).
        misfit: (P, W) of the data, not scaled.
        weight: (P, W) of each window: one over its scale squared.
        reduced: normal equations there.
        evidence: (P,) log evidence by Laplace [nat], up to what is common to all hypotheses over these windows.
        settled: (P,) whether the last step gained next to nothing.
    """

    objective: Objective
    coordinates: Array
    nuisance: Array
    misfit: Array
    weight: Array
    reduced: Reduced
    evidence: Array
    settled: NDArray[np.bool_]

    def covariance(self, row: int) -> Array:
        """Return (K, K) of the coordinates at one point."""
        matrix = np.einsum("w,wkl->kl", self.weight[row], self.reduced.matrix[row])
        return np.linalg.inv(matrix + np.diag(self.objective.hypothesis.spread**-2.0))

    @property
    def sigma(self) -> Array:
        """Return (P,) the scale of the noise over all windows, at least one."""
        return np.sqrt(np.maximum(1.0, self.misfit.sum(axis=1) / self.objective.observations))

    @property
    def ranked(self) -> NDArray[np.int64]:
        """Return (P,) the rows, the highest evidence first; a law that has run away has none, and is last."""
        return np.argsort(-self.evidence, kind="stable")

    @property
    def best(self) -> int:
        """Return the row of the highest evidence."""
        return int(self.ranked[0])

    def take(self, rows: NDArray[np.int64]) -> Peak:
        """Return some of the points."""
        r = self.reduced
        return Peak(
            self.objective,
            self.coordinates[rows],
            self.nuisance[rows],
            self.misfit[rows],
            self.weight[rows],
            Reduced(r.matrix[rows], r.vector[rows], r.gain[rows], r.shift[rows], r.log_det[rows]),
            self.evidence[rows],
            self.settled[rows],
        )


def _cost(objective: Objective, coordinates: Array, misfit: Array) -> Array:
    """Return (P,) minus twice the log posterior at the best scales."""
    return -2.0 * objective.likelihood(misfit) + objective.prior_misfit(coordinates)


def log_evidence(objective: Objective, coordinates: Array, misfit: Array, reduced: Reduced) -> Array:
    """Return (P,) log evidence by Laplace at points, up to a constant of the windows [nat]."""
    spread = objective.hypothesis.spread
    matrix, _ = reduced.weighed(objective.weights(misfit))
    _, log_det = np.linalg.slogdet(matrix * np.outer(spread, spread) + np.eye(len(spread)))
    value = objective.likelihood(misfit) - 0.5 * reduced.log_det
    return value - 0.5 * objective.prior_misfit(coordinates) - 0.5 * log_det


def climb(
    objective: Objective,
    coordinates: Array,
    nuisance: Array | None = None,
    *,
    iterations: int = 12,
    rough: bool = False,
    spread: Array | None = None,
) -> Peak:
    """Minimise from many starts.

    Args:
        objective: hypothesis and windows.
        coordinates: (P, K) starts.
        nuisance: (P, W, NUISANCES) to begin with; None: at rest.
        iterations: linearisations at most.
        rough: keep the slopes in the nuisances from the start to the end; else they are taken anew for the evidence.
        spread: (P, W, R, NUISANCES) slopes in the nuisances to begin with; None: taken at the starts.
    """
    u = objective.hypothesis.believable(coordinates)
    walk = _Walk(
        u,
        objective.at_rest(len(u)) if nuisance is None else nuisance.copy(),
        np.full(len(u), FIRST_DAMPING),
        np.full(len(u), math.inf),
        Holding(len(u), objective.hypothesis.spread**-2.0),
    )
    idle = np.zeros(len(u), dtype=np.int64)
    stale = 0 if spread is None else 1
    slopes = None if spread is None else spread.copy()
    for iteration in range(iterations):
        on = np.flatnonzero(idle < PATIENCE)
        if len(on) == 0:
            break
        # How the start and a steady wrench move the poses hardly depends on what acts besides.
        fresh = (iteration + stale) % FRESH == 0
        linear = objective.linearise(walk.u[on], walk.z[on], None if fresh or slopes is None else slopes[on])
        slopes = _kept(slopes, on, linear.spread)
        walk.z[on], residual, misfit = settled(objective, walk.u[on], walk.z[on], linear.spread, linear.residual)
        walk.gained[on] = 0.0
        _step(objective, walk, on, reduce(replace(linear, residual=residual), walk.z[on]), misfit, slopes)
        idle[on] = np.where(walk.gained[on] < SETTLED, idle[on] + 1, 0)
        if np.all(walk.gained < SETTLED):
            break
    linear = objective.linearise(walk.u, walk.z, slopes if rough else None)
    reduced = reduce(linear, walk.z)
    misfit = objective.misfit(linear.residual, walk.z)
    evidence = log_evidence(objective, walk.u, misfit, reduced)
    weight, ended = objective.weights(misfit), walk.gained < 1.0
    return Peak(objective, walk.u, walk.z, misfit, weight, reduced, evidence, ended)


@dataclass
class _Walk:
    """Where a climb's P starts are on their way.

    Attributes:
        u: (P, K) coordinates.
        z: (P, W, NUISANCES) nuisances.
        damping: (P,) of the next step.
        gained: (P,) by the last step [nat].
        holding: which starts step without what the data say nothing of.
    """

    u: Array
    z: Array
    damping: Array
    gained: Array
    holding: Holding


def _step(
    objective: Objective, walk: _Walk, on: NDArray[np.int64], reduced: Reduced, misfit: Array, slopes: Array
) -> None:
    """Move starts by a step that gains, a shorter one where the first does not; where none does, leave them.

    Args:
        objective: see `climb`.
        walk: changed.
        on: which starts.
        reduced: normal equations of those.
        misfit: (len(on), W) there.
        slopes: (P, W, R, NUISANCES) in the nuisances, of all starts.
    """
    hypothesis, prior_precision = objective.hypothesis, objective.hypothesis.spread**-2.0
    cost, most = _cost(objective, walk.u[on], misfit), 3.0 * hypothesis.spread
    matrix, vector = reduced.weighed(objective.weights(misfit))
    curvature, quiet = matrix + np.diag(prior_precision), of_little(matrix, prior_precision)
    pull = vector - (walk.u[on] - hypothesis.mean) * prior_precision
    open_rows = np.arange(len(on))
    for _ in range(TRIALS):
        now = on[open_rows]
        damped = curvature[open_rows] + walk.damping[now, None, None] * _diagonal(curvature[open_rows])
        damped += walk.holding.added(now, quiet[open_rows])
        step = np.linalg.solve(damped, pull[open_rows, :, None])[..., 0]
        step *= np.minimum(1.0, 1.0 / np.max(np.abs(step) / most + 1e-12, axis=1))[:, None]
        step = hypothesis.believable(walk.u[now] + step) - walk.u[now]
        shift = reduced.shift[open_rows] - (reduced.gain[open_rows] @ step[:, None, :, None])[..., 0]
        trial_u, trial_z = walk.u[now] + step, walk.z[now] + shift
        trial_z, _, found = settled(objective, trial_u, trial_z, slopes[now])
        trial = _cost(objective, trial_u, found)
        better = trial < cost[open_rows]
        rows = now[better]
        walk.u[rows], walk.z[rows] = trial_u[better], trial_z[better]
        walk.gained[rows] = 0.5 * (cost[open_rows[better]] - trial[better])
        walk.damping[rows] = np.maximum(walk.damping[rows] * EASIER, LEAST_DAMPING)
        walk.holding.stepped(rows, walk.gained[rows])
        open_rows, now = open_rows[~better], now[~better]
        # First without what is quiet, and only then a shorter step.
        shorter = walk.holding.failed(now, quiet[open_rows])
        walk.damping[shorter] = np.minimum(walk.damping[shorter] * HARDER, MOST_DAMPING)
        if len(open_rows) == 0:
            break


def settled(
    objective: Objective, coordinates: Array, nuisance: Array, spread: Array, residual: Array | None = None
) -> tuple[Array, Array, Array]:
    """Move the nuisances alone, each window's as long as it gains; return them, residuals and misfits (P, W).

    Where feet stick or let go, a step in everything at once lands beside the valley's floor, where the cost says
    nothing of the coordinates.
    """
    if residual is None:
        residual = objective.residual(coordinates, nuisance)
    z, here = nuisance, objective.misfit(residual, nuisance)
    share = np.ones(here.shape)
    for _ in range(ROUNDS):
        trial = z + share[..., None] * nuisance_step(spread, residual, z)
        found = objective.residual(coordinates, trial)
        there = objective.misfit(found, trial)
        better = there < here
        z, residual = np.where(better[..., None], trial, z), np.where(better[..., None], found, residual)
        gained = float(np.max(np.where(better, here - there, 0.0), initial=0.0))
        here = np.minimum(here, there)
        share = np.where(better, 1.0, SHORTER * share)
        if gained < SETTLED:
            break
    return z, residual, here


def _kept(known: Array | None, rows: NDArray[np.int64], found: Array) -> Array:
    """Return what is known of all starts with some rows as they were found; at first all are."""
    if known is None:
        return found
    known[rows] = found
    return known


def _diagonal(matrices: Array) -> Array:
    """Return (P, K, K) their diagonals as matrices."""
    return matrices * np.eye(matrices.shape[-1])
