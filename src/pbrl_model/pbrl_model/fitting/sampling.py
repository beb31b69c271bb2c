"""Draws from a posterior whose modes are known: adaptive importance sampling, or the thesis's Metropolis chains."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.fitting.coordinates import Coordinates
from pbrl_model.fitting.polish import Modes
from pbrl_model.fitting.target import FrozenTarget, Target
from pbrl_model.inference import mcmc
from pbrl_model.inference.importance import PARETO_LIMIT, Defence, Weighted, importance_sample
from pbrl_model.inference.laplace import Tops, climb
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.problem import Domain

Array = NDArray[np.float64]

ENOUGH = 100.0
"""Effective samples from which an evidence counts as known: its error is then below 0.1 nat."""
LEAST_DRAWS = 500
"""The population that counts is not made smaller, however few draws are asked for."""
LEARNING_DRAWS, LEARNING_ROUNDS = 400, 6
ATTEMPTS = 3
"""So often the effort is doubled before an evidence is given up."""
LEAST_SHARE = 0.05
"""No mode starts with less of the draws, over those of the largest, however little its Gaussian holds."""
HOPELESS = 60.0
"""Modes this much below the best are not climbed from [nat]: least squares may have left a climb of a tenth of it."""
HOPELESS_ESS = 5.0
"""Weights that have collapsed on fewer effective samples than this are not helped by twice the effort."""
WIDER = 1.5
"""The mixture's first components are this much wider than the curvature at the modes says, in variance."""


@dataclass(frozen=True)
class Sampled:
    """What a sampler returns.

    Attributes:
        position: (C, n, D) draws of equal weight.
        log_evidence: [nat]; NaN where it was not computed or did not converge.
        log_evidence_sd: its standard error.
        ess: effective samples of the importance weights; NaN for chains.
        pareto_k: shape of the weights' tail; NaN for chains.
        acceptance: (C, 2) share of proposals taken, what is simulated and scales; NaN for importance sampling.
        notes: what did not work, in sentences.
    """

    position: Array
    log_evidence: float
    log_evidence_sd: float
    ess: float
    pareto_k: float
    acceptance: Array
    notes: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """Tell whether importance weights gave an evidence."""
        return math.isfinite(self.log_evidence)


def shares(modes: Modes) -> Array:
    """Return (M,) how much of the posterior each mode holds, as far as its Gaussian tells."""
    _, log_det = np.linalg.slogdet(modes.covariance)
    mass = modes.point.log_density + 0.5 * log_det
    share = np.exp(mass - mass.max())
    return share / share.sum()


def chains(
    rng: np.random.Generator, target: Target, modes: Modes, *, count: int, burn_in: int, draws: int, thin: int
) -> Sampled:
    """Run block-wise adaptive Metropolis chains from modes drawn by their shares (thesis 5.3.2).

    A linearisation that is frozen at each chain's mode goes before the exact density (delayed acceptance).
    """
    share = shares(modes)
    chosen = modes.take(np.sort(rng.choice(len(share), size=count, p=share)))
    frozen = FrozenTarget(target, chosen.point.position, chosen.point.linear).density
    nuisance = chosen.point.linear.nuisance

    def exact(position: Array, rows: NDArray[np.int64]) -> Array:
        return target.full_log_density(position, nuisance[rows])

    simulated = target.simulated
    blocks = (
        mcmc.Block(tuple(range(simulated))),
        mcmc.Block(tuple(range(simulated, target.dimension)), keeps_memo=True),
    )
    state = mcmc.init(frozen, chosen.point.position, chosen.covariance, blocks, exact)
    found = mcmc.run(rng, state, frozen, blocks, burn_in=burn_in, draws=draws, thin=thin, exact=exact)
    return Sampled(found.position, math.nan, math.nan, math.nan, math.nan, found.acceptance)


def weights(tops: Tops) -> Array:
    """Return (M,) how much of the posterior each top holds, as far as its Gaussian tells, none of them nothing."""
    _, log_det = np.linalg.slogdet(tops.covariance)
    mass = tops.log_density + 0.5 * log_det
    return np.maximum(np.exp(mass - mass.max()), LEAST_SHARE)


def weighted(rng: np.random.Generator, target: Target, modes: Modes, *, draws: int) -> Sampled:
    """Sample by importance from a mixture at the modes, over physics and noise at once, on the exact density.

    Where the weights do not allow an evidence the effort is doubled; where that does not help either, it is said.

    Args:
        rng: source of randomness.
        target: log density.
        modes: of it.
        draws: of equal weight to return.
    """
    coordinates = Coordinates(target)
    modes = modes.take(np.flatnonzero(modes.point.log_density > modes.point.log_density.max() - HOPELESS))
    seeds = coordinates.of(modes.point.position)
    first, nuisance = seeds, modes.point.linear.nuisance

    def log_density(points: Array) -> Array:
        offset = (points[:, None] - first) / coordinates.scale
        return coordinates.log_density(points, nuisance[np.argmin(np.sum(offset**2, axis=-1), axis=1)])

    guess = coordinates.covariance(modes.point.position, modes.covariance)
    tops = climb(log_density, seeds, guess, coordinates.scale)
    mixture = Mixture.around(tops.position, WIDER * tops.covariance, weights(tops), Domain.unbounded(target.dimension))
    defence = Defence(coordinates.sample_prior, coordinates.log_prior)
    for attempt in range(ATTEMPTS):
        effort = 2**attempt
        found = importance_sample(
            rng,
            log_density,
            mixture,
            draws=effort * max(draws, LEAST_DRAWS),
            learning_draws=effort * LEARNING_DRAWS,
            rounds=LEARNING_ROUNDS,
            defence=defence,
        )
        if _trusted(found) or found.ess < HOPELESS_ESS:
            break
        mixture = found.mixture
    position = coordinates.describe(rng, found.resampled(rng, draws))
    evidence, error = found.log_evidence, found.log_evidence_sd
    notes: tuple[str, ...] = ()
    if not _trusted(found):
        notes = (
            f"the evidence did not converge ({found.ess:.0f} effective samples, Pareto k {found.pareto_k:.2f}): "
            "it is not given",
        )
        evidence = error = math.nan
    return Sampled(position[None], evidence, error, found.ess, found.pareto_k, np.full((1, 2), np.nan), notes)


def sampled(
    rng: np.random.Generator, target: Target, modes: Modes, *, draws: int, count: int, burn_in: int, thin: int
) -> Sampled:
    """Sample by importance; chains stand in where weights collapse on so few draws that they show no spread.

    Args:
        rng: source of randomness.
        target: log density.
        modes: of it.
        draws: of equal weight to return; chains return so many together, or a few more.
        count: of the chains.
        burn_in: steps of each in which it adapts.
        thin: steps for each draw kept.
    """
    found = weighted(rng, target, modes, draws=draws)
    if found.converged:
        return found
    run = chains(rng, target, modes, count=count, burn_in=burn_in, draws=math.ceil(draws / count), thin=thin)
    return replace(run, notes=tuple(f"{note}, and the draws are those of Metropolis chains" for note in found.notes))


def _trusted(found: Weighted) -> bool:
    return found.ess >= ENOUGH and found.pareto_k < PARETO_LIMIT
