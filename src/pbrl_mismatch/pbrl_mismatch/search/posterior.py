"""Draws of what a recording allows a hypothesis: along ridges and past borders that a Gaussian at its peak knows not.

When a load was put down may be all the same for a second, and a cord's anchor lie anywhere along it: there Laplace's
deviations are those of the steepest place. Draws are by differential evolution (ter Braak 2006): each point of a
population moves by the difference of two others, so that steps have the density's own shape. The population begins at
Laplace's Gaussian, spreads in a flattened density, and is cooled; where that Gaussian is right, it is left as it is.
Some end in a side peak that moves do not lead out of, hundreds of nats down: while it is cooled the population is drawn
anew by the density's own growth (population annealing, Hukushima and Iba 2003).
Differences of points lie along straight ridges alone: that of a cord is made straight first (`search.cords`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.search.climb import Peak
from pbrl_mismatch.search.cords import Cord, bent, cords_of, log_volume, straightened
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_model.inference.cloud import no_nan, systematic

Array = NDArray[np.float64]

POPULATION, HOT, COOLING, KEPT = 48, 40, 60, 60
"""Points, and generations: in the flattened density, while it is cooled, and of those that are kept."""
FLAT = 0.3
"""Power of the density that the population spreads in."""
LEAP, JITTER = 0.1, 1e-3
"""Share of moves by a whole difference, from mode to mode; noise of a move, in Laplace's deviations."""
EVEN = 0.5
"""Where the log density less Laplace's, at its own draws, varies by less [nat], nothing is to be spread or cooled."""
UNWOUND = 0.3
"""The population begins with lengths of cords scattered by so much beyond Laplace, as logarithms."""
SHORTEST = 0.4
"""The least that a difference is scaled by, over the best scale of a Gaussian."""


class Density:
    """Log density of a hypothesis's coordinates around one peak, each window's nuisances integrated out.

    How the start and a steady wrench move the poses hardly depends on the coordinates: they are linearised once, at the
    peak. Windows have their best scales, as in `search.objective`.
    """

    def __init__(self, peak: Peak) -> None:
        """Linearise at the first point of a peak."""
        self._objective, self._nuisance = peak.objective, peak.nuisance[:1]
        self._spread = self._objective.linearise(peak.coordinates[:1], self._nuisance).spread[0]
        inner = np.swapaxes(self._spread, -1, -2) @ self._spread
        self._inverse = np.linalg.inv(inner + np.eye(inner.shape[-1]))

    def __call__(self, points: Array) -> Array:
        """Return (n,) the log density at points (n, K), up to a constant [nat]."""
        residual = self._objective.residual(points, np.repeat(self._nuisance, len(points), axis=0))
        centred = residual + np.einsum("wrk,wk->wr", self._spread, self._nuisance[0])
        # The inverse of 1 + S S^T is 1 - S (1 + S^T S)^-1 S^T.
        along = np.einsum("wrk,pwr->pwk", self._spread, centred)
        squares = np.sum(centred**2, axis=-1) - np.einsum("pwk,wkl,pwl->pw", along, self._inverse, along)
        return self._objective.likelihood(squares) - 0.5 * self._objective.prior_misfit(points)


def with_draws(rng: np.random.Generator, fitted: Fitted, workers: int = 1) -> Fitted:
    """Return a fitted hypothesis with draws of its coordinates.

    What the grippers' poses say of a hold that gives way is a Gaussian of its own: such a hypothesis stays as it is.

    Args:
        rng: of the draws.
        fitted: over simulated windows.
        workers: threads; the bytes do not depend on it.
    """
    if GRASP_COMPLIANCE in fitted.hypothesis.effects:
        return fitted
    return replace(fitted, draws=evolved(rng, fitted.peak, workers))


def evolved(rng: np.random.Generator, peak: Peak, workers: int = 1) -> Array:
    """Return draws (POPULATION * KEPT, K) of the density around the first point of a peak, in so many threads."""
    density, hypothesis = Density(peak), peak.objective.hypothesis
    with ThreadPoolExecutor(workers) as pool:

        def of_all(points: Array) -> Array:
            return np.concatenate(list(pool.map(density, np.array_split(points, workers))))

        return _evolved(rng, peak, hypothesis, of_all)


def _evolved(rng: np.random.Generator, peak: Peak, hypothesis: Hypothesis, density: Callable[[Array], Array]) -> Array:
    cords = cords_of(hypothesis, peak.coordinates[0], peak.objective.cuts.track)
    size, half = len(hypothesis.spread), POPULATION // 2
    points, here, gaussian = _begun(rng, peak, hypothesis, density, cords)
    cooled = [] if gaussian else [*np.full(HOT, FLAT), *np.geomspace(FLAT, 1.0, COOLING)]
    cooled += [1.0] * KEPT
    jitter = JITTER * points.std(axis=0)
    kept = np.empty((len(cooled), POPULATION, size))
    before = cooled[0]
    for generation, power in enumerate(cooled):
        if power > before:
            rows = systematic(rng, np.exp((power - before) * (here - here.max())), POPULATION)
            points, here, before = points[rows], here[rows], power
        for movers, others in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
            first, second = points[others][rng.integers(0, half, (2, half))]
            scale = 2.38 / math.sqrt(2.0 * size) * rng.uniform(SHORTEST, 1.0, half)
            scale[rng.random(half) < LEAP] = 1.0
            trial = points[movers] + scale[:, None] * (first - second) + jitter * rng.standard_normal((half, size))
            told = bent(cords, trial)
            allowed = np.all(hypothesis.believable(told) == told, axis=1)
            there = density(told) + log_volume(cords, trial)
            taken = allowed & (np.log(rng.random(half)) < power * (there - here[movers]))
            points[movers] = np.where(taken[:, None], trial, points[movers])
            here[movers] = np.where(taken, there, here[movers])
        kept[generation] = bent(cords, points)
    return kept[-KEPT:].reshape(-1, size)


def _begun(
    rng: np.random.Generator,
    peak: Peak,
    hypothesis: Hypothesis,
    density: Callable[[Array], Array],
    cords: Sequence[Cord],
) -> tuple[Array, Array, bool]:
    """Return a population, straightened, with its log density there, and whether Laplace's Gaussian is right."""
    values, vectors = np.linalg.eigh(peak.covariance(0))
    normal = rng.standard_normal((POPULATION, len(values)))
    drawn = peak.coordinates[0] + normal @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    told = hypothesis.believable(drawn)
    here = density(told)
    gaussian = np.array_equal(told, drawn) and float(np.std(here + 0.5 * np.sum(normal**2, axis=1))) < EVEN
    points = straightened(cords, told)
    if cords and not gaussian:
        points[:, [cord.length for cord in cords]] += UNWOUND * rng.standard_normal((POPULATION, len(cords)))
        told = hypothesis.believable(bent(cords, points))
        points, here = straightened(cords, told), density(told)
    return points, no_nan(here + log_volume(cords, points)), gaussian
