"""The shape of a mode from slopes at many places: local Gaussians that a curvature at the optimum alone would miss.

Residuals are nearly linear in the parameters wherever nothing switches between sticking and slipping, so the posterior
is nearly a Gaussian there, cut at the next switch: it has facets, often so thin that no random step leads from one to
the next. But the slopes of the residuals at one point tell the whole Gaussian of the facet whose side the point is on,
however far below it the point lies. So probes are sent out around an optimum, near and far; each is asked for its
slopes and moved to the middle that they tell, a few times over. Probes that agree are merged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference.metered import Metered
from pbrl_model.inference.mixture import Mixture, inside_draws, inverse, positive
from pbrl_model.inference.optimise import begin, slopes

Array = NDArray[np.float64]

STEP_SD = 0.05
"""Finite difference in standard deviations of the whole: shorter than a facet is thick."""
WIDTHS = (1.0, 4.0, 30.0)
"""Probes start from covariances of the optima times these, as far as the prior's spread goes."""
ALIKE = 1.0
"""Gaussians whose symmetric divergence is below this [nat] are one."""
WIDENED = 1.2
"""Covariances of components over those of the Gaussians."""
FARTHEST = 4.0
"""A probe moves at most so many standard deviations (times the root of the dimension) at once."""
LIGHT = 15.0
"""Facets whose mass, were they not cut, is smaller by so many nats than the largest are left out."""


@dataclass(frozen=True)
class ProbeOptions:
    """Effort for each mode. A probe costs D calls a step.

    Attributes:
        probes: sent out.
        steps: of each.
        most: facets kept; those that most probes agree on.
    """

    probes: int = 72
    steps: int = 3
    most: int = 12

    def __post_init__(self) -> None:
        if min(self.probes, self.steps, self.most) < 1:
            raise ModelError(f"probes: expected counts of at least 1, got {self}")


def probed(rng: np.random.Generator, meter: Metered, theta: Array, covariance: Array, options: ProbeOptions) -> Mixture:
    """Return the facets around optima as a mixture.

    Args:
        rng: source of randomness.
        meter: of the problem.
        theta: (M, D) optima that lie side by side.
        covariance: (M, D, D) at them.
        options: effort.
    """
    probes = [theta]
    for width in WIDTHS:
        wide = inverse(inverse(covariance) / width + np.diag(meter.spread**-2.0))
        around = Mixture.around(theta, wide, np.ones(len(theta)), meter.domain)
        probes.append(inside_draws(rng, around, max(1, options.probes // len(WIDTHS))))
    scale = inverse(covariance).mean(axis=0)
    return facets(meter, np.concatenate(probes), scale, options)


def facets(meter: Metered, probes: Array, scale: Array, options: ProbeOptions) -> Mixture:
    """Return the mixture of the local Gaussians that probes lead to.

    Args:
        meter: of the problem.
        probes: (n, D) places to begin at.
        scale: (D, D) a curvature that scales the finite differences.
        options: effort.
    """
    places, found = probes, []
    for step in range(options.steps):
        local = _local_gaussians(meter, places, scale)
        places = local.reached
        if step > 0 or options.steps == 1:  # the first are as far off as the probes are
            found.append(local)
    every = _Gaussians(*map(np.concatenate, zip(*[vars(each).values() for each in found], strict=True)))
    heavy = every.mass > np.max(every.mass) - LIGHT
    every = every.take(np.flatnonzero(heavy))
    rows, counts = _agreed(meter, every)
    kept = np.argsort(-counts, kind="stable")[: options.most]
    chosen = every.take(rows[kept])
    weight = np.maximum(counts[kept], 0.05 * counts.max()).astype(float)
    return Mixture.around(meter.domain.clip(chosen.mean), WIDENED * chosen.covariance, weight, meter.domain)


@dataclass(frozen=True)
class _Gaussians:
    """Local Gaussians: mean (n, D), covariance and precision (n, D, D), log mass (n,), where a step leads (n, D)."""

    mean: Array
    covariance: Array
    precision: Array
    mass: Array
    reached: Array

    def take(self, rows: NDArray[np.int64]) -> _Gaussians:
        return _Gaussians(
            self.mean[rows], self.covariance[rows], self.precision[rows], self.mass[rows], self.reached[rows]
        )


def _local_gaussians(meter: Metered, places: Array, scale: Array) -> _Gaussians:
    here = begin(meter, places, 1.0)
    here = here.take(np.flatnonzero(np.isfinite(here.value)))
    same = np.repeat(positive(scale)[None], len(here.theta), axis=0)
    curvature, slope = slopes(meter, replace(here, curvature=same), 1.0, step_sd=STEP_SD)
    precision, covariance = positive(curvature), inverse(curvature)
    shift = np.einsum("sij,sj->si", covariance, slope)
    rise = np.maximum(np.einsum("si,si->s", shift, slope), 1e-300)
    limit = FARTHEST * np.sqrt(meter.domain.dimension)
    reached = meter.domain.clip(here.theta + shift * np.minimum(1.0, limit / np.sqrt(rise))[:, None])
    mass = here.value + 0.5 * rise + 0.5 * np.linalg.slogdet(covariance)[1]
    return _Gaussians(here.theta + shift, covariance, precision, mass, reached)


def _agreed(meter: Metered, gaussians: _Gaussians) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return one row of each group of Gaussians that are alike, and the groups' sizes; heaviest first."""
    mean, covariance, precision = gaussians.mean, gaussians.covariance, gaussians.precision
    left = np.argsort(-gaussians.mass, kind="stable")
    rows, counts = [], []
    while len(left):
        row = left[0]
        offset = meter.domain.offset(mean[left], mean[row])
        traces = np.einsum("sij,ji->s", precision[left], covariance[row])
        traces += np.einsum("ij,sji->s", precision[row], covariance[left])
        between = np.einsum("si,sij,sj->s", offset, precision[left] + precision[row], offset)
        alike = 0.25 * (traces - 2.0 * mean.shape[1] + between) < ALIKE
        alike[0] = True
        rows.append(row)
        counts.append(int(alike.sum()))
        left = left[~alike]
    return np.array(rows, dtype=np.int64), np.array(counts, dtype=np.int64)
