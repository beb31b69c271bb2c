"""Sparse regression of a wrench on features: subsets weighed by their evidence, checked by stability.

y_t = F_t c + e_t with e_t ~ N(0, S_t + tau^2 G), S_t the measured covariance, tau what no feature explains, and
Gaussian priors on the coefficients as wide as would explain three times the wrench that is there. The evidence of a
subset then has a closed form, which knows the covariance of each moment and the units of each coefficient; a threshold
on coefficients (sequentially thresholded least squares, Brunton et al. 2016) would compare newtons with kilograms, and
relevance determination by optimisation keeps whichever of two features that are alike it met first. Features are added
while the evidence gains more than trying so many costs, and dropped where it gains by that. How often each is chosen
from random halves of the recording (Meinshausen and Buehlmann 2010) is told with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.unknown.features import Feature
from pbrl_mismatch.unknown.samples import Samples, samples_of
from pbrl_model.transforms import yaw_matrices

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MOST_TERMS = 5
PRIOR_WIDTH = 3.0
LEFT_OVER = (0.03, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Sizes of what no feature explains that are tried, over the root mean square of the wrench."""
FLOOR, OWN = 0.15, 3
"""Size of the wrist sensor's own error [N], and how many columns it has."""
PROBE = 1.0
"""Size with which a feature is passed through the smoother [N]."""
HALVES, BLOCKS = 24, 12
"""Random halves of so many blocks of time, for stability."""


@dataclass(frozen=True)
class Term:
    """One feature that was chosen.

    Attributes:
        feature: what it is.
        mean: (k,) coefficients [the feature's unit].
        sd: (k,) their standard deviations.
        stability: share of random halves of the recording from which it is chosen too, 0..1.
        share: of the wrench's squares that is explained with it and not without it, 0..1.
    """

    feature: Feature
    mean: Array
    sd: Array
    stability: float
    share: float


@dataclass(frozen=True)
class SparseLaw:
    """A combination of few features.

    Attributes:
        terms: the chosen ones, by the share that they explain.
        share: of the wrench's squares that all of them explain, 0..1; noise is never explained.
        evidence: log evidence over that of nothing [nat].
        left_over: size of what they do not explain [N].
    """

    terms: tuple[Term, ...]
    share: float
    evidence: float
    left_over: float


class _Normal:
    """Normal equations of all features for one size of the left-over, by blocks of time."""

    def __init__(self, samples: Samples, design: Array, prior: Array, left_over: float, blocks: Index) -> None:
        noise = samples.covariance + left_over**2 * np.diag(samples.scale**2)
        root = np.linalg.inv(np.linalg.cholesky(noise))
        self.design, self.target = root @ design, np.einsum("nij,nj->ni", root, samples.wrench)
        self.prior, self.left_over = prior, left_over
        grams = np.einsum("nik,nil->nkl", self.design, self.design)
        pulls = np.einsum("nik,ni->nk", self.design, self.target)
        squares = np.sum(self.target**2, axis=1)
        constants = 2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
        self.gram = np.stack([grams[blocks == b].sum(axis=0) for b in range(BLOCKS)])
        self.pull = np.stack([pulls[blocks == b].sum(axis=0) for b in range(BLOCKS)])
        self.constant = np.stack([(constants - squares)[blocks == b].sum() for b in range(BLOCKS)])

    def posterior(self, columns: Index) -> tuple[Array, Array]:
        """Return mean and covariance of some columns' coefficients."""
        matrix = self.gram.sum(axis=0)[np.ix_(columns, columns)] + np.diag(self.prior[columns] ** -2.0)
        covariance = np.linalg.inv(matrix)
        return covariance @ self.pull.sum(axis=0)[columns], covariance

    def evidence(self, columns: Index, gram: Array, pull: Array, constant: float) -> float:
        """Return the log evidence of some columns, up to a constant of the samples [nat]."""
        width = self.prior[columns]
        matrix = np.eye(len(columns)) + gram[np.ix_(columns, columns)] * np.outer(width, width)
        root = np.linalg.cholesky(matrix)
        along = np.linalg.solve(root, pull[columns] * width)
        return 0.5 * constant + 0.5 * float(along @ along) - float(np.sum(np.log(np.diagonal(root))))


def sparse_law(
    rng: np.random.Generator, samples: Samples, features: Sequence[Feature], floor: float = FLOOR
) -> SparseLaw:
    """Find the few features that explain a wrench.

    Args:
        rng: draws halves of the recording.
        samples: moments that are about independent.
        features: at those moments.
        floor: size of the wrist sensor's own error [N].
    """
    design = np.concatenate([*(feature.values for feature in features), yaw_matrices(samples.heading)], axis=-1)
    ends = np.cumsum([len(feature.parts) for feature in features])
    columns = [np.arange(end - len(feature.parts), end) for feature, end in zip(features, ends, strict=True)]
    size = float(np.sqrt(np.mean((samples.wrench / samples.scale) ** 2)))
    strength = np.sqrt(np.mean(np.sum((design / samples.scale[:, None]) ** 2, axis=1), axis=0) / 2.0)
    prior = PRIOR_WIDTH * size / np.maximum(strength, 1e-9)
    prior[-OWN:] = floor * samples.scale
    order = np.argsort(samples.time, kind="stable")
    blocks = np.empty(len(samples), dtype=np.int64)
    blocks[order] = np.arange(len(samples)) * BLOCKS // len(samples)
    systems = [_Normal(samples, design, prior, share * size, blocks) for share in LEFT_OVER]
    everything = np.arange(BLOCKS)
    chosen, gained, system = _selected(systems, columns, everything)
    if not chosen:
        return SparseLaw((), 0.0, 0.0, size)
    counts = np.zeros(len(features))
    for _ in range(HALVES):
        half = rng.choice(BLOCKS, BLOCKS // 2, replace=False)
        counts[_selected([system], columns, half)[0]] += 1.0
    return _told(samples, features, columns, chosen, system, gained, counts / HALVES)


def _with_own(columns: Sequence[Index], prior: Array) -> Index:
    """Return columns of features and of the sensor's own error."""
    return np.concatenate([*columns, np.arange(len(prior) - OWN, len(prior))]).astype(np.int64)


def _selected(systems: Sequence[_Normal], columns: Sequence[Index], blocks: Index) -> tuple[list[int], float, _Normal]:
    """Return the chosen features, the gain in evidence and the system with the likeliest left-over."""
    sums = [
        (each.gram[blocks].sum(axis=0), each.pull[blocks].sum(axis=0), float(each.constant[blocks].sum()))
        for each in systems
    ]

    def value(features: Sequence[int]) -> tuple[float, int]:
        held = _with_own([columns[k] for k in features], systems[0].prior)
        values = [each.evidence(held, *told) for each, told in zip(systems, sums, strict=True)]
        return max(values), int(np.argmax(values))

    cost = math.log(len(columns))
    chosen: list[int] = []
    nothing, which = value(chosen)
    now = nothing
    while len(chosen) < MOST_TERMS:
        trials = [(value([*chosen, k]), k) for k in range(len(columns)) if k not in chosen]
        (best, system), k = max(trials)
        if best <= now + cost:
            break
        chosen, now, which = [*chosen, k], best, system
        for other in chosen[:-1]:
            without = [each for each in chosen if each != other]
            trial, system = value(without)
            if trial > now - cost:
                chosen, now, which = without, trial, system
    return chosen, now - nothing, systems[which]


def _told(
    samples: Samples,
    features: Sequence[Feature],
    columns: Sequence[Index],
    chosen: Sequence[int],
    system: _Normal,
    gained: float,
    stability: Array,
) -> SparseLaw:
    held = _with_own([columns[k] for k in chosen], system.prior)
    mean, covariance = system.posterior(held)
    rest = system.target - system.design[..., held] @ mean
    spread = np.sqrt(np.diag(covariance)) * _widening(rest)
    terms, first = [], 0
    share = _share(samples, _predicted(features, chosen, mean))
    for k in chosen:
        part = slice(first, first + len(columns[k]))
        first = part.stop
        others = [each for each in chosen if each != k]
        fewer = system.posterior(_with_own([columns[each] for each in others], system.prior))[0]
        alone = max(share - _share(samples, _predicted(features, others, fewer)), 0.0)
        terms.append(Term(features[k], mean[part], spread[part], float(stability[k]), alone))
    terms.sort(key=lambda term: -term.share)
    return SparseLaw(tuple(terms), share, gained, system.left_over)


def refined(
    track: Track,
    row: Array,
    residual: ResidualWrench,
    law: SparseLaw,
    features: Sequence[Feature],
    rows: Index,
    floor: float = FLOOR,
) -> SparseLaw:
    """Return a law with its coefficients estimated through the smoother.

    Each feature is added to the felt wrench, and what the smoother makes of it is what the coefficient multiplies: a
    smoother that holds back fast changes does the same to both sides.

    Args:
        track: what was recorded.
        row: (WIDTH,) of the model that lacks the wrench.
        residual: its residual.
        law: as found on the smoothed wrench.
        features: at every moment of the track.
        rows: moments that are compared.
        floor: size of the wrist sensor's own error [N].
    """
    if not law.terms:
        return law
    known = {feature.name: feature for feature in features}
    seen = [
        _through(track, row, residual, known[term.feature.name].values[..., k])[rows]
        for term in law.terms
        for k in range(len(term.mean))
    ]
    moments = samples_of(track, residual).take(rows)
    design = np.concatenate([np.stack(seen, -1), yaw_matrices(moments.heading)], axis=-1)
    noise = moments.covariance + law.left_over**2 * np.diag(moments.scale**2)
    root = np.linalg.inv(np.linalg.cholesky(noise))
    flat, target = root @ design, np.einsum("nij,nj->ni", root, moments.wrench)
    gram = np.einsum("nik,nil->kl", flat, flat)
    prior = 1e-9 * np.diag(gram)
    prior[-OWN:] = (floor * moments.scale) ** -2.0
    pull = np.einsum("nik,ni->k", flat, target)

    def solved(columns: Index) -> tuple[Array, Array, float]:
        covariance = np.linalg.inv(gram[np.ix_(columns, columns)] + np.diag(prior[columns]))
        mean = covariance @ pull[columns]
        law_alone = columns < design.shape[-1] - OWN
        return mean, covariance, _share(moments, design[..., columns[law_alone]] @ mean[law_alone])

    everything = np.arange(design.shape[-1])
    mean, covariance, share = solved(everything)
    spread = np.sqrt(np.diag(covariance)) * _widening(target - flat @ mean)
    terms, first = [], 0
    for term in law.terms:
        part = np.arange(first, first + len(term.mean))
        first = int(part[-1]) + 1
        alone = max(share - solved(np.setdiff1d(everything, part))[2], 0.0)
        terms.append(replace(term, mean=mean[part], sd=spread[part], share=alone))
    terms.sort(key=lambda term: -term.share)
    return replace(law, terms=tuple(terms), share=share)


def _through(track: Track, row: Array, residual: ResidualWrench, values: Array) -> Array:
    """Return (T, 3) what the smoother makes of a wrench (T, 3) in world axes that the model lacks."""
    unit = PROBE / max(float(np.sqrt(np.mean(values**2))), 1e-9)
    told = residual_wrench(_pushed(track, unit * values), row, size=residual.size)
    return (residual.world - told.world) / unit


def _pushed(track: Track, world: Array) -> Track:
    """Return a track whose sensor felt a wrench (T, 3) at the centre of mass, world axes, more."""
    c, s, arm = track.mount[:, 0], track.mount[:, 1], track.mount[:, 2:4]
    turned = np.stack([c * world[:, 0] + s * world[:, 1], -s * world[:, 0] + c * world[:, 1]], -1)
    moment = world[:, 2] - (arm[:, 0] * world[:, 1] - arm[:, 1] * world[:, 0])
    return replace(track, felt=track.felt + np.column_stack([turned, moment]))


def _predicted(features: Sequence[Feature], chosen: Sequence[int], mean: Array) -> Array:
    if not chosen:
        return np.zeros(features[0].values.shape[:2])
    design = np.concatenate([features[k].values for k in chosen], axis=-1)
    return design @ mean[: design.shape[-1]]


def _widening(rest: Array) -> float:
    """Return by how much errors are larger because what is left (N, 3) at one moment is like that at the next."""
    power = float(np.sum(rest**2))
    alike = float(np.sum(rest[1:] * rest[:-1])) / power if power > 0.0 else 0.0
    alike = min(max(alike, 0.0), 0.9)
    return math.sqrt((1.0 + alike) / (1.0 - alike) * max(1.0, power / rest.size))


def _share(samples: Samples, predicted: Array) -> float:
    """Return the share of the estimated wrench's squares that is predicted, 0..1."""
    before = float(np.sum((samples.wrench / samples.scale) ** 2))
    after = float(np.sum(((samples.wrench - predicted) / samples.scale) ** 2))
    return float(np.clip(1.0 - after / before, 0.0, 1.0)) if before > 0.0 else 0.0
