"""From modes to a mixture: the shape of each mode is learned once, and every other description of it is a copy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pbrl_model.inference.facets import ProbeOptions, facets, probed
from pbrl_model.inference.importance import FEWEST, Seen, Weighted, flattened, teach
from pbrl_model.inference.metered import Metered
from pbrl_model.inference.mixture import Mixture, inverse, positive
from pbrl_model.inference.modes import NEGLIGIBLE, SAME, Modes, distances
from pbrl_model.inference.population import Walked, WalkOptions, learned, populate, wander
from pbrl_model.inference.problem import Domain, Problem

Array = NDArray[np.float64]

NEAR = 0.1
"""Optima nearer than this share of the prior's spread in every column share their walkers."""
COVER, COVER_SHARE = 2.0, 0.1
"""Covariance of the component that covers the whole of a mode, over the mode's, and its share of the draws."""
COVER_POINTS = 4
"""Points seen for each column, at least, to know how wide the whole is."""
LEAST_SHARE = 0.01
"""No mode gets a smaller share of the first draws: its mass is a guess until it is weighted."""
AXIS_STEP = 1e-3
"""Axes of a covariance are carried over to another description by differences of this share."""


@dataclass(frozen=True)
class Shapes:
    """What is known of the modes.

    Attributes:
        mixture: components of every mode in every description.
        mode: (K,) the mode that each component belongs to; another description of a mode is another mode.
        best: (M, D) the best point of every mode.
        alone: a mixture for each mode, one description of it.
    """

    mixture: Mixture
    mode: NDArray[np.int64]
    best: Array
    alone: tuple[Mixture, ...]


def starting_shapes(rng: np.random.Generator, meter: Metered, modes: Modes, options: ProbeOptions) -> list[Mixture]:
    """Return a mixture for each group of optima that lie side by side, one description of each."""
    return [probed(rng, meter, *_one_description(meter, modes, group), options) for group in grouped(meter, modes)]


def taught_shapes(
    rng: np.random.Generator, meter: Metered, alone: Sequence[Mixture], draws: int, rounds: int
) -> Shapes:
    """Teach each mode's mixture by importance sampling, one description of it, and return all descriptions together."""
    mixtures, masses, best = [], [], []
    for first in alone:
        mixture, seen = teach(rng, meter.log_density, first, draws, rounds)
        masses.append(seen.log_evidence(None))
        mixtures.append(covered(mixture, seen) if np.isfinite(masses[-1]) else mixture)
        best.append(seen.best() if np.isfinite(masses[-1]) else first.mean[0])
    return assembled(meter.problem, mixtures, np.array(masses), np.array(best))


def covered(mixture: Mixture, seen: Seen) -> Mixture:
    """Return the mixture with one more component as wide as the whole; as it is where too few points were seen."""
    points, log_weights = seen.weighted(None)
    if len(points) < COVER_POINTS * mixture.domain.dimension:
        return mixture
    log_weights = flattened(log_weights, FEWEST * (mixture.domain.dimension + 1))
    weights = np.exp(log_weights - logsumexp(log_weights))
    centre = points[np.argmax(weights)]
    offset = mixture.domain.offset(points, centre)
    shift = np.einsum("n,ni->i", weights, offset)
    spread = np.einsum("n,ni,nj->ij", weights, offset - shift, offset - shift)
    middle = mixture.domain.clip(centre + shift)
    whole = Mixture.around(middle[None], positive(COVER * spread)[None], np.ones(1), mixture.domain, mixture.dof)
    return joined([mixture, whole], (1.0 - COVER_SHARE, COVER_SHARE))


def walked_shapes(
    rng: np.random.Generator, meter: Metered, shapes: Shapes, found: Weighted, walk: WalkOptions, probe: ProbeOptions
) -> list[Mixture]:
    """Return mixtures of each mode learned anew, from walkers that set out from its share of a weighted sample."""
    out = []
    for number, known in enumerate(shapes.alone):
        start = of_mode(rng, meter, shapes, found, number, walk.walkers)
        walked: Walked | None
        if len(np.unique(start, axis=0)) > 2 * meter.domain.dimension:
            walked = wander(rng, meter.log_density, meter.domain, start, meter.log_density(start), walk)
        else:  # the sample has collapsed on a few points
            walked = populate(rng, meter.log_density, known, walk)
        if walked is None or len(np.unique(walked.last, axis=0)) <= 2 * meter.domain.dimension:
            out.append(known)
            continue
        seen = learned(rng, walked.points, meter.domain, walk.components)
        scale = inverse(np.einsum("k,kij->ij", seen.weight, seen.scale))
        out.append(joined([known, seen, facets(meter, walked.last, scale, probe)], (1 / 3, 1 / 3, 1 / 3)))
    return out


def of_mode(rng: np.random.Generator, meter: Metered, shapes: Shapes, found: Weighted, number: int, n: int) -> Array:
    """Return up to n draws of equal weight that belong to a mode, in the description in which its mixture is alone."""
    draws = found.resampled(rng, 8 * n)
    if len(draws) == 0:
        return draws
    images = meter.problem.images(draws)
    fit = np.stack([[m.log_density(image) for image in images] for m in shapes.alone])  # (modes, S, draws)
    nearest = np.argmax(fit[number], axis=0)
    own = np.argmax(fit.max(axis=1), axis=0) == number
    return meter.domain.fold(images[nearest, np.arange(len(draws))])[own][:n]


def joined(mixtures: Sequence[Mixture], shares: Sequence[float]) -> Mixture:
    """Return one mixture of several, each with its share (sum 1)."""
    return Mixture(
        np.concatenate([m.mean for m in mixtures]),
        np.concatenate([m.scale for m in mixtures]),
        np.concatenate([share * m.weight for share, m in zip(shares, mixtures, strict=True)]),
        mixtures[0].domain,
        mixtures[0].dof,
    )


def grouped(meter: Metered, modes: Modes) -> list[list[int]]:
    """Return modes in groups that lie side by side, in whichever description they do."""
    groups: list[list[int]] = []
    for row in range(len(modes.theta)):
        images = meter.problem.images(modes.theta[row : row + 1])[:, 0]
        joins = [group for group in groups if any(_beside(meter, modes, images, other) for other in group)]
        merged = [other for group in joins for other in group]
        groups = [group for group in groups if group not in joins] + [[*merged, row]]
    return groups


def _beside(meter: Metered, modes: Modes, images: Array, other: int) -> bool:
    offset = np.abs(meter.domain.offset(images, modes.theta[other])) / meter.spread
    far = distances(meter.domain, images, modes.theta[other], modes.covariance[other])
    return bool(np.any(np.all(offset < NEAR, axis=1)) or far.min() < 2.0 * SAME * np.sqrt(meter.domain.dimension))


def _one_description(meter: Metered, modes: Modes, group: list[int]) -> tuple[Array, Array]:
    """Return theta and covariances of a group's modes, each in the description that is nearest to the first's."""
    theta, covariance = [], []
    for row in group:
        places, covariances = described(meter.problem, meter.domain, modes.theta[row], modes.covariance[row])
        offset = np.abs(meter.domain.offset(places, modes.theta[group[0]])) / meter.spread
        nearest = int(np.argmin(offset.max(axis=1)))
        theta.append(places[nearest])
        covariance.append(covariances[nearest])
    return np.array(theta), np.array(covariance)


def described(problem: Problem, domain: Domain, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Return every description of a component: means (S, D) and covariances (S, D, D), the given one first.

    The axes of the covariance are carried over one by one.
    """
    axes = np.linalg.cholesky(covariance).T
    middle = problem.images(mean[None])[:, 0]
    up, down = problem.images(mean + AXIS_STEP * axes), problem.images(mean - AXIS_STEP * axes)
    carried = domain.offset(up, down) / (2.0 * AXIS_STEP)
    return domain.clip(middle), np.einsum("sai,saj->sij", carried, carried)


def assembled(problem: Problem, mixtures: list[Mixture], masses: Array, best: Array) -> Shapes:
    """Return the mixture of all descriptions of the modes that matter, each with its mass."""
    finite = np.isfinite(masses)
    if not np.any(finite):
        masses = np.zeros(len(masses))
    heavy = [k for k in range(len(masses)) if masses[k] > np.max(masses) - NEGLIGIBLE]
    shares = np.exp(masses[heavy] - logsumexp(masses[heavy]))
    domain = mixtures[0].domain
    means: list[Array] = []
    scales: list[Array] = []
    weights: list[float] = []
    mode: list[int] = []
    places: list[Array] = []
    for share, k in zip(shares, heavy, strict=True):
        images = domain.clip(problem.images(best[k][None])[:, 0])
        others = [s for s in range(len(images)) if not _seen(domain, images[s], images[:s])]
        numbers = range(len(places), len(places) + len(others))
        places.extend(images[others])
        for mean, scale, weight in zip(mixtures[k].mean, mixtures[k].scale, mixtures[k].weight, strict=True):
            theta, scaled = described(problem, domain, mean, scale)
            means.extend(theta[others])
            scales.extend(scaled[others])
            weights.extend([max(share, LEAST_SHARE) * weight / len(others)] * len(others))
            mode.extend(numbers)
    total = np.array(weights) / np.sum(weights)
    mixture = Mixture(np.array(means), np.array(scales), total, domain, mixtures[0].dof)
    return Shapes(mixture, np.array(mode), np.array(places), tuple(mixtures[k] for k in heavy))


def _seen(domain: Domain, place: Array, others: Array) -> bool:
    return any(np.allclose(domain.offset(place, other), 0.0, rtol=0.0, atol=1e-12) for other in others)
