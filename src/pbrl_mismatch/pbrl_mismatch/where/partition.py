"""A left-out wrench over time in stretches: none in some, constant in some frame in each of the others.

Moments are cut where that makes them likeliest: the wrench of a stretch is integrated out, so that its evidence in each
frame has a closed form, and the best cuts of all are found by dynamic programming (optimal partitioning, Jackson et
al. 2005). Every cut costs what trying it everywhere does. What is left over beside the measured covariance is as large
as is likeliest, as in `unknown.regression`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.unknown.regression import LEFT_OVER, PRIOR_WIDTH
from pbrl_mismatch.unknown.samples import Samples
from pbrl_mismatch.where.axes import FRAMES, axes_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Stretch:
    """Moments in which the wrench is constant in a frame, or none.

    Attributes:
        first: index of the first moment.
        end: one more than that of the last.
        there: whether there is a wrench.
        frames: probability of each frame, if there is one.
        mean: (3,) of the wrench in the likeliest frame [N, N, N m]; zeros where there is none.
        sd: (3,) standard deviations.
    """

    first: int
    end: int
    there: bool
    frames: Mapping[str, float]
    mean: Array
    sd: Array

    @property
    def frame(self) -> str:
        """Return the likeliest frame."""
        return max(self.frames, key=self.frames.__getitem__)


@dataclass(frozen=True)
class Change:
    """When a stretch gives way to the next: a mean and a standard deviation [s]."""

    time: float
    sd: float


@dataclass(frozen=True)
class Partition:
    """The likeliest stretches.

    Attributes:
        stretches: in order, covering every moment.
        changes: between them.
        evidence: log evidence, the cuts' cost in it [nat].
        left_over: what no stretch explains, as a force [N].
    """

    stretches: tuple[Stretch, ...]
    changes: tuple[Change, ...]
    evidence: float
    left_over: float

    @property
    def there(self) -> NDArray[np.bool_]:
        """Return (N,) the moments at which there is a wrench."""
        return np.concatenate([np.full(each.end - each.first, each.there) for each in self.stretches])


def partition(samples: Samples) -> Partition:
    """Cut moments into stretches in which a wrench is constant in a frame, or none.

    Args:
        samples: N moments that are about independent, in order.
    """
    size = math.sqrt(max(float(np.mean((samples.wrench / samples.scale) ** 2)), 1e-12))
    tried = [StretchEvidence(samples, size, share * size) for share in LEFT_OVER]
    reached = [_cut(each, len(samples)) for each in tried]
    best = max(range(len(tried)), key=lambda k: reached[k][0])
    found, (evidence, cuts) = tried[best], reached[best]
    return Partition(
        tuple(found.stretch(first, end) for first, end in pairwise(cuts)),
        tuple(_change(found, samples.time, begin, end) for begin, end in zip(cuts[:-2], cuts[2:], strict=True)),
        evidence,
        LEFT_OVER[best] * size,
    )


class StretchEvidence:
    """Evidence of every stretch of moments, for one size of what is left over."""

    def __init__(self, samples: Samples, size: float, left_over: float) -> None:
        noise = samples.covariance + left_over**2 * np.diag(samples.scale**2)
        root = np.linalg.inv(np.linalg.cholesky(noise))
        target = np.einsum("nij,nj->ni", root, samples.wrench)
        self._width = PRIOR_WIDTH * size * samples.scale
        self._gram, self._pull = {}, {}
        for frame in FRAMES:
            design = root @ axes_of(samples, frame) * self._width
            self._gram[frame] = _summed(np.einsum("nik,nil->nkl", design, design))
            self._pull[frame] = _summed(np.einsum("nik,ni->nk", design, target))
        constant = np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1) - 0.5 * np.sum(target**2, axis=1)
        self._constant = _summed(constant)

    def of_each(self, first: Index, end: Index) -> Array:
        """Return log evidences (4, n) of stretches with no wrench, and with one in each of `FRAMES` [nat]."""
        none = self._constant[end] - self._constant[first]
        found = [none]
        for frame in FRAMES:
            inverse, determinant = inverted(np.eye(3) + self._gram[frame][end] - self._gram[frame][first])
            pull = self._pull[frame][end] - self._pull[frame][first]
            quadratic = np.einsum("ni,nij,nj->n", pull, inverse, pull)
            found.append(none + 0.5 * quadratic - 0.5 * np.log(determinant))
        return np.stack(found)

    def of_all(self, first: Index, end: Index) -> Array:
        """Return log evidences (n,) of stretches: none is as probable before as any frame, all frames alike [nat]."""
        none, *some = self.of_each(first, end)
        return np.logaddexp(none, np.logaddexp.reduce(some, axis=0) - math.log(len(FRAMES))) - math.log(2.0)

    def stretch(self, first: int, end: int) -> Stretch:
        """Return what is likeliest of one stretch."""
        none, *some = self.of_each(np.array([first]), np.array([end]))[:, 0].tolist()
        weight = np.exp(np.array(some) - max(some))
        frames = dict(zip(FRAMES, (weight / weight.sum()).tolist(), strict=True))
        if none >= float(np.logaddexp.reduce(some)) - math.log(len(FRAMES)):
            return Stretch(first, end, False, frames, np.zeros(3), np.zeros(3))
        frame = FRAMES[int(np.argmax(weight))]
        inverse = np.linalg.inv(np.eye(3) + self._gram[frame][end] - self._gram[frame][first])
        mean = inverse @ (self._pull[frame][end] - self._pull[frame][first])
        return Stretch(first, end, True, frames, mean * self._width, np.sqrt(np.diag(inverse)) * self._width)


def inverted(matrices: Array) -> tuple[Array, Array]:
    """Return inverses (n, 3, 3) and determinants (n,) of symmetric matrices; many small ones are slow in LAPACK."""
    a, b, c = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 0, 2]
    d, e, f = matrices[:, 1, 1], matrices[:, 1, 2], matrices[:, 2, 2]
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * first + b * second + c * third
    fourth, fifth, sixth = a * f - c * c, b * c - a * e, a * d - b * b
    adjugate = np.stack([first, second, third, second, fourth, fifth, third, fifth, sixth], -1)
    return adjugate.reshape(-1, 3, 3) / determinant[:, None, None], determinant


def _summed(values: Array) -> Array:
    """Return running sums along the first axis, from nothing on."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])


def _cut(evidence: StretchEvidence, count: int) -> tuple[float, list[int]]:
    """Return the evidence of the best cuts, and where they are: from 0 to the number of moments."""
    first, end = np.triu_indices(count + 1, 1)
    value = np.full((count + 1, count + 1), -np.inf)
    value[first, end] = evidence.of_all(first, end)
    cost = math.log(max(count - 1, 1))
    best, back = np.full(count + 1, -np.inf), np.zeros(count + 1, dtype=np.int64)
    best[0] = cost  # the first stretch needs no cut before it
    for k in range(1, count + 1):
        reached = best[:k] + value[:k, k] - cost
        back[k] = int(np.argmax(reached))
        best[k] = reached[back[k]]
    cuts = [count]
    while cuts[-1] > 0:
        cuts.append(int(back[cuts[-1]]))
    return float(best[count]), cuts[::-1]


def _change(evidence: StretchEvidence, time: Array, begin: int, end: int) -> Change:
    """Return when the one change between two others is: everywhere between them, as likely as that is."""
    places = np.arange(begin + 1, end)
    likely = evidence.of_all(np.full_like(places, begin), places) + evidence.of_all(places, np.full_like(places, end))
    weight = np.exp(likely - likely.max())
    weight /= weight.sum()
    # Between two moments it may be anywhere.
    middle, gap = 0.5 * (time[places - 1] + time[places]), time[places] - time[places - 1]
    mean = float(weight @ middle)
    return Change(mean, math.sqrt(float(weight @ ((middle - mean) ** 2 + gap**2 / 12.0))))
