"""A weighted cloud of particles between two densities, and what can be done with the weights alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Index = NDArray[np.int64]

RIDGE = 1e-9
"""Share of a column's variance that is added to a covariance, so that it has an inverse."""


@dataclass(frozen=True)
class Cloud:
    """What the next step needs.

    Attributes:
        position: (P, D).
        log_weight: (P,) normalised.
        group: (P,) number of the group that each particle belongs to.
        base: (P,) log density at the start of the path.
        gain: (P,) what is added to it on the way.
        temperature: how far the cloud has come, 0 to 1.
        log_evidence: of everything on the way so far [nat].
        log_scale: of the proposals.
    """

    position: Array
    log_weight: Array
    group: Index
    base: Array
    gain: Array
    temperature: float
    log_evidence: float
    log_scale: float

    @property
    def log_density(self) -> Array:
        """Return (P,) unnormalised log densities at the cloud's temperature."""
        return at_temperature(self.base, self.gain, self.temperature)

    @property
    def weight(self) -> Array:
        """Return (P,) normalised weights."""
        return np.exp(self.log_weight)

    @property
    def ess(self) -> float:
        """Return the effective sample size of the weights."""
        return effective(self.log_weight)


def at_temperature(base: Array, gain: Array, temperature: float) -> Array:
    """Return base + temperature * gain; at temperature 0 the gain does not count, not even an infinite one."""
    return base + temperature * gain if temperature > 0.0 else base


def no_nan(values: Array) -> Array:
    """Return log densities with minus infinity for those that are no number."""
    return np.where(np.isnan(values), -np.inf, values)


def effective(log_weight: Array) -> float:
    """Return 1 / sum of squared normalised weights; 0 where all weights are zero."""
    top = log_weight.max()
    if not np.isfinite(top):
        return 0.0
    weight = np.exp(log_weight - top)
    return float(weight.sum() ** 2 / np.sum(weight**2))


def normalised(log_weight: Array) -> tuple[Array, float]:
    """Return log weights that sum to one, and the logarithm of what they summed to.

    Raises:
        ModelError: all are zero, or one is NaN.
    """
    top = log_weight.max()
    if not np.isfinite(top):
        raise ModelError("smc: expected a particle that the data allow, got none: the prior excludes them")
    total = float(top + np.log(np.sum(np.exp(log_weight - top))))
    return log_weight - total, total


def systematic(rng: np.random.Generator, weight: Array, count: int) -> Index:
    """Return (count,) rows drawn with probability `weight`, one from each of `count` equal parts (Kitagawa 1996)."""
    place = (rng.random() + np.arange(count)) / count
    total = np.cumsum(weight)
    return np.minimum(np.searchsorted(total / total[-1], place, side="right"), len(weight) - 1).astype(np.int64)


def resample(rng: np.random.Generator, cloud: Cloud) -> Cloud:
    """Return the cloud with equal weights: heavy particles several times, light ones not at all."""
    rows = systematic(rng, cloud.weight, len(cloud.position))
    return replace(
        cloud,
        position=cloud.position[rows],
        log_weight=np.full(len(rows), -np.log(len(rows))),
        group=cloud.group[rows],
        base=cloud.base[rows],
        gain=cloud.gain[rows],
    )


def covariances(position: Array, weight: Array, group: Index) -> dict[int, Array]:
    """Return the (D, D) weighted covariance of each group.

    A group of few is drawn towards what the groups have in common, so that each has an inverse.
    """
    dimension = position.shape[1]
    numbers = np.unique(group)
    spread, count, pooled = {}, {}, np.zeros((dimension, dimension))
    for number in numbers.tolist():
        own = weight * (group == number)
        share = own.sum()
        if share <= 0.0:
            spread[number], count[number] = np.zeros((dimension, dimension)), 0.0
            continue
        centred = position - own @ position / share
        spread[number] = (centred * (own / share)[:, None]).T @ centred
        count[number] = float(share**2 / np.sum(own**2))
        pooled += share * spread[number]
    ridge = np.diag(RIDGE * np.maximum(np.diag(pooled), 1e-12))
    out = {}
    for number in numbers.tolist():
        own_share = count[number] / (count[number] + dimension) if len(numbers) > 1 else 1.0
        out[number] = own_share * spread[number] + (1.0 - own_share) * pooled + ridge
    return out


def regrouped(cloud: Cloud) -> Cloud:
    """Return the cloud with each particle in the group whose Gaussian gives it the highest density.

    Particles cross from one mode to another while the density is still flat; one that kept the number of where it came
    from would make the steps of its old group as long as the way that it has gone.
    """
    numbers = np.unique(cloud.group)
    if len(numbers) == 1:
        return cloud
    spread = covariances(cloud.position, cloud.weight, cloud.group)
    scores = []
    for number in numbers.tolist():
        own = cloud.weight * (cloud.group == number)
        share = max(float(own.sum()), 1e-300)
        factor = np.linalg.cholesky(spread[number])
        white = np.linalg.solve(factor, (cloud.position - own @ cloud.position / share).T)
        scores.append(np.log(share) - np.log(np.diag(factor)).sum() - 0.5 * np.sum(white**2, axis=0))
    return replace(cloud, group=numbers[np.argmax(scores, axis=0)])
