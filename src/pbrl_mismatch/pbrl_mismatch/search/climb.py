"""Damped least squares (Levenberg-Marquardt) of many starts at once, the nuisances of each window eliminated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.search.objective import NUISANCES, Objective, Reduced, nuisance_step, reduce
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
PROMISED = 2e-3
"""A step of one window's nuisances is not tried where it would lower the misfit by less, were all linear."""
PATIENCE = 2
"""A start that gains less than that in so many steps one after the other is left where it is."""
OUTRUN, FADES = 10.0, 0.3
"""So is one that is behind the best by more than so many times what its last step gained; a step that failed leaves so
much of what was hoped for."""


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
        return Peak(
            self.objective,
            self.coordinates[rows],
            self.nuisance[rows],
            self.misfit[rows],
            self.weight[rows],
            self.reduced.take(rows),
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
) -> Peak:
    """Minimise from many starts.

    Args:
        objective: hypothesis and windows.
        coordinates: (P, K) starts.
        nuisance: (P, W, NUISANCES) to begin with; None: at rest.
        iterations: linearisations at most.
        rough: keep the slopes in the nuisances from the start to the end; else they are taken anew for the evidence.
    """
    walk = _begun(objective, coordinates, nuisance)
    idle = np.zeros(len(coordinates), dtype=np.int64)
    for iteration in range(iterations):
        on = np.flatnonzero((idle < PATIENCE) & (walk.behind <= OUTRUN * walk.hope))
        if len(on) == 0:
            break
        # How the start and a steady wrench move the poses hardly depends on what acts besides.
        fresh = iteration % FRESH == 0
        # Where no step has gained, all is as it was: the next ones are shorter.
        _linearise(objective, walk, on if fresh else on[walk.gained[on] > 0.0], fresh=fresh)
        walk.gained[on] = 0.0
        _step(objective, walk, on)
        walk.hope[on] = np.where(walk.gained[on] > 0.0, walk.gained[on], FADES * walk.hope[on])
        idle[on] = np.where(walk.gained[on] < SETTLED, idle[on] + 1, 0)
        if np.all(walk.gained[on] < SETTLED):
            break
    linear = objective.linearise(walk.u, walk.z, walk.slopes if rough else None)
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
        hope: (P,) what the next one may gain [nat].
        cost: (P,) minus twice the log posterior where they are, at the best scales.
        holding: which starts step without what the data say nothing of.
        slopes: (P, W, R, NUISANCES) in the nuisances, as they were last taken.
        reduced: normal equations of the last linearisation.
        misfit: (P, W) there.
    """

    u: Array
    z: Array
    damping: Array
    gained: Array
    hope: Array
    cost: Array
    holding: Holding
    slopes: Array
    reduced: Reduced
    misfit: Array

    @property
    def behind(self) -> Array:
        """Return (P,) how much less likely they are than the likeliest of them [nat]."""
        return 0.5 * (self.cost - self.cost.min())


def _begun(objective: Objective, coordinates: Array, nuisance: Array | None) -> _Walk:
    """Return a climb's starts; what is not yet known of them is written before it is read. Arguments as of `climb`."""
    u = objective.hypothesis.believable(coordinates)
    z = objective.at_rest(len(u)) if nuisance is None else nuisance.copy()
    count, windows, free = len(u), z.shape[1], u.shape[1]
    return _Walk(
        u,
        z,
        np.full(count, FIRST_DAMPING),
        np.full(count, math.inf),
        np.full(count, math.inf),
        np.zeros(count),
        Holding(count, objective.hypothesis.spread**-2.0),
        np.empty((count, windows, objective.cuts.weight[0].size, NUISANCES)),
        Reduced.room(count, windows, free),
        np.empty((count, windows)),
    )


def _linearise(objective: Objective, walk: _Walk, rows: NDArray[np.int64], *, fresh: bool) -> None:
    """Settle and linearise some starts where they are, with slopes in the nuisances taken anew or as they were."""
    if len(rows) == 0:
        return
    linear = objective.linearise(walk.u[rows], walk.z[rows], None if fresh else walk.slopes[rows])
    walk.slopes[rows] = linear.spread
    walk.z[rows], residual, walk.misfit[rows] = settled(
        objective, walk.u[rows], walk.z[rows], linear.spread, linear.residual
    )
    walk.reduced.put(rows, reduce(replace(linear, residual=residual), walk.z[rows]))


def _step(objective: Objective, walk: _Walk, on: NDArray[np.int64]) -> None:
    """Move starts by a step that gains, a shorter one where the first does not; where none does, leave them.

    Args:
        objective: see `climb`.
        walk: changed.
        on: which starts, as they were linearised.
    """
    hypothesis, prior_precision = objective.hypothesis, objective.hypothesis.spread**-2.0
    walk.cost[on], most = _cost(objective, walk.u[on], walk.misfit[on]), 3.0 * hypothesis.spread
    reduced = walk.reduced.take(on)
    matrix, vector = reduced.weighed(objective.weights(walk.misfit[on]))
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
        trial_z, _, found = settled(objective, trial_u, trial_z, walk.slopes[now])
        trial = _cost(objective, trial_u, found)
        better = trial < walk.cost[now]
        rows = now[better]
        walk.u[rows], walk.z[rows] = trial_u[better], trial_z[better]
        walk.gained[rows] = 0.5 * (walk.cost[rows] - trial[better])
        walk.cost[rows] = trial[better]
        walk.damping[rows] = np.maximum(walk.damping[rows] * EASIER, LEAST_DAMPING)
        walk.holding.stepped(rows, walk.gained[rows])
        open_rows, now = open_rows[~better], now[~better]
        # First without what is quiet, and only then a shorter step.
        shorter = walk.holding.failed(now, quiet[open_rows])
        walk.damping[shorter] = np.minimum(walk.damping[shorter] * HARDER, MOST_DAMPING)
        if len(open_rows) == 0:
            break


def settled(
    objective: Objective,
    coordinates: Array,
    nuisance: Array,
    spread: Array,
    residual: Array | None = None,
    rounds: int = ROUNDS,
) -> tuple[Array, Array, Array]:
    """Move the nuisances alone, each window's as long as it gains; return them, residuals and misfits (P, W).

    Where feet stick or let go, a step in everything at once lands beside the valley's floor, where the cost says
    nothing of the coordinates.

    Args:
        objective: hypothesis and windows.
        coordinates: (P, K).
        nuisance: (P, W, NUISANCES) to begin with.
        spread: (P, W, R, NUISANCES) slopes in the nuisances; one point's may stand for all.
        residual: (P, W, R) there, if it is known.
        rounds: steps of each window at most.
    """
    residual = objective.residual(coordinates, nuisance) if residual is None else residual.copy()
    spread = np.broadcast_to(spread, (*residual.shape, NUISANCES))
    z, here = nuisance.copy(), objective.misfit(residual, nuisance)
    share, going = np.ones(here.shape), np.ones(here.shape, dtype=np.bool_)
    for _ in range(rounds):
        step, promised = nuisance_step(spread[going], residual[going], z[going])
        worth = promised * share[going] * (2.0 - share[going]) > PROMISED
        going[going] = worth
        if not going.any():
            break
        trial = z.copy()
        trial[going] += share[going, None] * step[worth]
        found = objective.residual_of(going, coordinates, trial)
        there = objective.misfit(found, trial[going])
        gained = here[going] - there
        better = going.copy()
        better[going] = gained > 0.0
        z[better], residual[better], here[better] = trial[better], found[gained > 0.0], there[gained > 0.0]
        share[going] = np.where(gained > 0.0, 1.0, SHORTER * share[going])
        going[going] = (gained <= 0.0) | (gained > SETTLED)
    return z, residual, here


def _diagonal(matrices: Array) -> Array:
    """Return (P, K, K) their diagonals as matrices."""
    return matrices * np.eye(matrices.shape[-1])
