"""A population of walkers that learns the shape of a mode: differential evolution, annealed from where climbs ended.

A curvature says what a mode is like at one point. Where friction sticks and slips the log density has kinks: a mode is
many smooth pieces side by side, and a climb ends on one of them. Walkers that start from all the ends, at a
temperature that makes the ends alike, and cool while they move by each other's differences (ter Braak 2006), find
out how the pieces hang together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.inference.importance import effective
from pbrl_model.inference.mixture import Mixture, inside_draws, stratified
from pbrl_model.inference.problem import Domain

Array = NDArray[np.float64]
LogDensity = Callable[[Array], Array]

COOLING = 0.3
"""Each colder level leaves this share of the walkers effective."""
LEVELS = 40
"""Levels at most: then the walkers are as cold as they get."""
JUMP = 0.1
"""Share of moves by a whole difference, which leads from one place to another that is like it."""
JITTER = 0.02
"""Size of the noise in every move, in standard deviations of the population."""


@dataclass(frozen=True)
class WalkOptions:
    """Effort for every population.

    Attributes:
        walkers: in each.
        moves: of every walker at each temperature on the way.
        settle: moves at the last temperature before any is remembered.
        remember: moves of which every fourth is remembered.
        components: of the mixture that is learned from where walkers were.
    """

    walkers: int = 64
    moves: int = 4
    settle: int = 8
    remember: int = 8
    components: int = 3


@dataclass(frozen=True)
class Walked:
    """Where walkers have been at the last temperature.

    Attributes:
        points: (n, D).
        values: (n,) log densities.
        last: (N, D) where they are now.
        last_values: (N,).
        cold: whether the last temperature is one.
    """

    points: Array
    values: Array
    last: Array
    last_values: Array
    cold: bool


def populate(rng: np.random.Generator, log_density: LogDensity, first: Mixture, options: WalkOptions) -> Walked | None:
    """Let walkers start from a mixture, cool them, and remember where they go.

    Args:
        rng: source of randomness.
        log_density: (P, D) -> (P,).
        first: where they start.
        options: effort.

    Returns:
        What they have seen, or None where no start has a finite density.
    """
    domain = first.domain
    points = np.concatenate([inside_draws(rng, first, options.walkers), domain.clip(first.mean)])
    values = log_density(points)
    points, values = points[np.isfinite(values)], values[np.isfinite(values)]
    if len(points) < 4:
        return None
    beta, weights = 0.0, values - first.log_density(points)
    if effective(weights) >= COOLING * len(points):
        beta = 1.0
    for _ in range(LEVELS):
        if beta < 1.0:
            beta, weights = _colder(beta, values)
        rows = stratified(rng, np.exp(weights - weights.max()) / np.exp(weights - weights.max()).sum(), options.walkers)
        points, values = points[rows], values[rows]
        if beta == 1.0:
            break
        points, values = moved(rng, log_density, domain, points, values, options.moves, beta)
    return wander(rng, log_density, domain, points, values, options, beta)


def wander(
    rng: np.random.Generator,
    log_density: LogDensity,
    domain: Domain,
    points: Array,
    values: Array,
    options: WalkOptions,
    beta: float = 1.0,
) -> Walked:
    """Let walkers settle at one temperature, then remember where they go."""
    points, values = moved(rng, log_density, domain, points, values, options.settle, beta)
    seen, heights = [], []
    for _ in range(max(1, options.remember // 4)):
        points, values = moved(rng, log_density, domain, points, values, 4, beta)
        seen.append(points)
        heights.append(values)
    return Walked(np.concatenate(seen), np.concatenate(heights), points, values, beta == 1.0)


def _colder(beta: float, values: Array) -> tuple[float, Array]:
    """Return the next inverse temperature and the log weights that lead there."""
    wanted = COOLING * len(values)
    if effective((1.0 - beta) * values) >= wanted:
        return 1.0, (1.0 - beta) * values
    low, high = np.log(1e-12), np.log(1.0 - beta)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(np.exp(middle) * values) >= wanted else (low, middle)
    return beta + float(np.exp(low)), np.exp(low) * values


def moved(
    rng: np.random.Generator,
    log_density: LogDensity,
    domain: Domain,
    points: Array,
    values: Array,
    moves: int,
    beta: float = 1.0,
) -> tuple[Array, Array]:
    """Move every walker by differences of others, half of them at a time so that detailed balance holds.

    Args:
        rng: source of randomness.
        log_density: (P, D) -> (P,).
        domain: of the points.
        points: (N, D).
        values: (N,) their log densities.
        moves: of every walker.
        beta: inverse temperature.
    """
    points, values = points.copy(), values.copy()
    count, dimension = points.shape
    usual = 2.38 / np.sqrt(2.0 * dimension)
    for _ in range(moves):
        halves = np.array_split(rng.permutation(count), 2)
        for own, other in (halves, halves[::-1]):
            if len(other) < 2 or len(own) == 0:
                continue
            first = rng.integers(0, len(other), len(own))
            second = (first + rng.integers(1, len(other), len(own))) % len(other)
            length = np.where(rng.random(len(own)) < JUMP, 1.0, usual * rng.uniform(0.2, 1.0, len(own)))
            spread = np.std(domain.offset(points[other], points[other[0]]), axis=0)
            step = length[:, None] * domain.offset(points[other[first]], points[other[second]])
            step += JITTER * spread * rng.standard_normal(step.shape)
            trial = domain.fold(points[own] + step)
            height = log_density(trial)
            taken = np.log(rng.random(len(own))) < beta * (height - values[own])
            points[own[taken]], values[own[taken]] = trial[taken], height[taken]
    return points, values


def learned(rng: np.random.Generator, points: Array, domain: Domain, components: int, rounds: int = 25) -> Mixture:
    """Return the mixture of at most so many components that fits points (n, D) of equal weight.

    A component needs its share of the points to be informed: there are never more than one for 4 (D + 1) of them.
    """
    dimension = domain.dimension
    count = int(np.clip(len(points) // (4 * (dimension + 1)), 1, components))
    centre = points[0]
    offsets = domain.offset(points, centre)
    covariance = np.cov(offsets.T).reshape(dimension, dimension)
    covariance += np.diag(1e-6 * np.diag(covariance) + 1e-300)
    if count == 1:
        means = domain.clip(centre + offsets.mean(axis=0))[None]
    else:
        means = points[rng.choice(len(points), count, replace=False)]
    shrunk = covariance * count ** (-2.0 / dimension)
    mixture = Mixture.around(means, np.repeat(shrunk[None], count, axis=0), np.ones(count), domain)
    flat = np.zeros(len(points))
    for _ in range(rounds if count > 1 else 5):
        mixture = mixture.adapted(points, flat)
    return mixture
