"""Adaptive importance sampling from a mixture: draws, log evidence, and whether they can be trusted.

Rounds of draws teach the mixture (population Monte Carlo, Cappe et al. 2008); while only a few draws carry all the
weight, weights are flattened until enough count, so that a mixture can creep up to a posterior it did not know. The
estimate is made from the last population alone, drawn from a mixture that does not depend on it: unbiased, with an
error that can be computed. A share of the draws comes from the prior: where data are weak the weights are bounded by
the likelihood's ratio to its mean, whatever the mixture is like.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pbrl_model.errors import ModelError
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.pareto import pareto_shape

Array = NDArray[np.float64]
LogDensity = Callable[[Array], Array]

PARETO_LIMIT = 0.7
"""Above it the mean of the weights converges too slowly to be believed (Vehtari et al. 2024)."""
ENOUGH = 0.4
"""Learning ends when this share of a round's calls are effective samples."""
FEWEST = 1.5
"""Weights are flattened until so many samples count for each component's means and scales (times D + 1)."""


@dataclass(frozen=True)
class Defence:
    """The prior as a component of its own.

    Attributes:
        sample: (rng, n) -> (n, D).
        log_density: (P, D) -> (P,).
        share: of the draws, in [0, 1).
    """

    sample: Callable[[np.random.Generator, int], Array]
    log_density: LogDensity
    share: float = 0.05


@dataclass(frozen=True)
class Weighted:
    """One population and what it says.

    Attributes:
        samples: (N, D) within the domain, of positive density.
        log_weights: (N,) log target minus log proposal, not normalised.
        log_target: (N,) as the target returned it.
        proposals: draws made, those of weight zero included.
        calls: rows for which the target was evaluated.
        mixture: that the population was drawn from.
    """

    samples: Array
    log_weights: Array
    log_target: Array
    proposals: int
    calls: int
    mixture: Mixture

    @property
    def log_evidence(self) -> float:
        """Return the log of the integral of the target [nat]; -inf where no draw has weight."""
        if len(self.log_weights) == 0:
            return -math.inf
        return float(logsumexp(self.log_weights)) - math.log(self.proposals)

    @property
    def log_evidence_sd(self) -> float:
        """Return the standard error of the log evidence [nat]; it means nothing where Pareto's k is above 0.7."""
        if len(self.log_weights) == 0:
            return math.inf
        return math.sqrt(max(1.0 / self.ess - 1.0 / self.proposals, 0.0))

    @property
    def ess(self) -> float:
        """Return Kish's effective sample size, (sum w)^2 / sum w^2."""
        return effective(self.log_weights)

    @property
    def pareto_k(self) -> float:
        """Return the shape of the weights' tail; infinite where there are too few to tell."""
        return pareto_shape(self.log_weights)

    def resampled(self, rng: np.random.Generator, n: int) -> Array:
        """Return (n, D) of equal weight, in random order."""
        weights = np.exp(self.log_weights - logsumexp(self.log_weights))
        rows = np.searchsorted(np.cumsum(weights), (rng.random() + np.arange(n)) / n * weights.sum(), side="right")
        return self.samples[rng.permutation(np.minimum(rows, len(weights) - 1))]


def effective(log_weights: Array) -> float:
    """Return (sum w)^2 / sum w^2 of unnormalised log weights."""
    if len(log_weights) == 0:
        return 0.0
    return float(np.exp(2.0 * logsumexp(log_weights) - logsumexp(2.0 * log_weights)))


def population(
    rng: np.random.Generator, log_density: LogDensity, mixture: Mixture, draws: int, defence: Defence | None = None
) -> Weighted:
    """Draw one population and weigh it.

    Args:
        rng: source of randomness.
        log_density: (P, D) -> (P,) log of the target, unnormalised.
        mixture: to draw from.
        draws: how many, those outside the domain included.
        defence: the prior as a component, or None.
    """
    from_prior = 0 if defence is None else round(defence.share * draws)
    points, inside = mixture.sample(rng, draws - from_prior)
    points = points[inside]
    if defence is not None and from_prior:
        points = np.concatenate([points, mixture.domain.fold(defence.sample(rng, from_prior))])
    target = log_density(points) if len(points) else np.zeros(0)
    if np.any(target == np.inf):
        raise ModelError("importance sampling: expected log densities below infinity, got infinity")
    alive = np.isfinite(target)
    points, target = points[alive], target[alive]
    log_weights = target - log_proposal(mixture, points, defence, draws)
    return Weighted(points, log_weights, target, draws, len(alive), mixture)


def log_proposal(mixture: Mixture, points: Array, defence: Defence | None, draws: int) -> Array:
    """Return the log densities (n,) with which points (n, D) were proposed in a population of so many draws."""
    out = mixture.log_density(points)
    share = 0.0 if defence is None else round(defence.share * draws) / draws
    if defence is None or share == 0.0:
        return out
    return np.logaddexp(math.log1p(-share) + out, math.log(share) + defence.log_density(points))


def flattened(log_weights: Array, least: float) -> Array:
    """Return the log weights times the largest power in [0, 1] that leaves `least` effective samples."""
    if effective(log_weights) >= least or len(log_weights) <= least:
        return log_weights
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle * log_weights) >= least else (low, middle)
    return low * log_weights


@dataclass(frozen=True)
class Seen:
    """All populations so far, each draw weighed against the mean of all proposals (Cornuet et al. 2012).

    A draw that its own proposal hardly expected, but a later one does, then has no outsized weight.
    """

    rounds: tuple[Weighted, ...] = ()

    @property
    def calls(self) -> int:
        """Return rows for which the target was evaluated."""
        return sum(found.calls for found in self.rounds)

    def and_also(self, found: Weighted) -> Seen:
        """Return these and one more."""
        return Seen((*self.rounds, found))

    def weighted(self, defence: Defence | None) -> tuple[Array, Array]:
        """Return the points (n, D) of all rounds and their log weights (n,)."""
        points = np.concatenate([found.samples for found in self.rounds])
        target = np.concatenate([found.log_target for found in self.rounds])
        proposals = [log_proposal(found.mixture, points, defence, found.proposals) for found in self.rounds]
        sizes = np.log([found.proposals for found in self.rounds])
        return points, target - logsumexp(np.array(proposals) + sizes[:, None], axis=0)

    def best(self) -> Array:
        """Return the point (D,) of the highest density."""
        points = np.concatenate([found.samples for found in self.rounds])
        return np.array(points[np.argmax(np.concatenate([found.log_target for found in self.rounds]))])

    def log_evidence(self, defence: Defence | None) -> float:
        """Return the log evidence by all draws: a good guess, though its error is not known."""
        return float(logsumexp(self.weighted(defence)[1])) if any(len(f.samples) for f in self.rounds) else -math.inf


def teach(
    rng: np.random.Generator,
    log_density: LogDensity,
    mixture: Mixture,
    draws: int,
    rounds: int,
    *,
    enough: float = ENOUGH,
    defence: Defence | None = None,
) -> tuple[Mixture, Seen]:
    """Return the mixture after some rounds of learning, and what was seen on the way; see `importance_sample`."""
    seen = Seen()
    least = FEWEST * (mixture.domain.dimension + 1) * len(mixture.mean)
    for _ in range(rounds):
        found = population(rng, log_density, mixture, draws, defence)
        seen = seen.and_also(found)
        points, log_weights = seen.weighted(defence)
        if len(log_weights) == 0:
            break
        mixture = mixture.adapted(points, flattened(log_weights, least))
        if found.ess > enough * found.calls:
            break
    return mixture, seen


def importance_sample(
    rng: np.random.Generator,
    log_density: LogDensity,
    mixture: Mixture,
    *,
    draws: int = 4000,
    learning_draws: int = 1000,
    rounds: int = 4,
    enough: float = ENOUGH,
    defence: Defence | None = None,
) -> Weighted:
    """Teach the mixture for some rounds, then draw the population that counts.

    Args:
        rng: source of randomness.
        log_density: (P, D) -> (P,) log of the target, unnormalised; -inf or NaN where it is zero.
        mixture: first components, for example at the optima.
        draws: of the last population.
        learning_draws: of each round before.
        rounds: at most so many.
        enough: learning ends when this share of a round's calls are effective samples.
        defence: the prior as a component, or None.
    """
    taught, seen = teach(rng, log_density, mixture, learning_draws, rounds, enough=enough, defence=defence)
    last = population(rng, log_density, taught, draws, defence)
    return replace(last, calls=seen.calls + last.calls)
