"""What effects are laid on: a fitted hypothesis along the path that it and a left-out wrench together explain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.hypothesis import Hypothesis, step_sizes
from pbrl_mismatch.search.path.along import Along, lay_along
from pbrl_mismatch.search.path.climb import climb_along, weights
from pbrl_mismatch.search.path.turned import turned

Array = NDArray[np.float64]

COARSE, FINE = 8, 4
"""Steps between accelerations: for a first look, and for a climb or where more moves than the body."""
ITERATIONS = 8
ROUNDS, SAME_MASS, SETTLED = 3, 0.05, 1.0
"""A path is smoothed so many times at most: anew where the mass found along it is another by more than this, as a
logarithm, or the last time gained more than this [nat]."""


@dataclass(frozen=True)
class Look:
    """Windows along a path beside what a ground does there, all over the noise of the ground's windows.

    Attributes:
        along: the windows.
        weight: (1, W, 1) roots of the windows' weights under the ground.
        still: (R,) residuals of the ground.
        slope: (K, R) how they change with its coordinates, in units of their priors.
    """

    along: Along
    weight: Array
    still: Array
    slope: Array

    def residual(self, rows: Array) -> Array:
        """Return (P, R) residuals of models (P, WIDTH)."""
        return (self.along.residual(rows) * self.weight).reshape(len(rows), -1)


@dataclass(frozen=True)
class Traced:
    """A hypothesis fitted along the path that it and a left-out wrench together explain.

    Attributes:
        hypothesis: what was fitted.
        coordinates: (K,).
        evidence: log evidence by Laplace [nat], on the scale of simulated windows.
        log_posterior: density at that point, on the same scale [nat].
        noise_scale: scale of the noise that it needs over all windows, at least one.
        paid: for the scales that its windows need [nat].
        lacks: the wrench that was left out about the path, and the path.
        along: the windows.
    """

    hypothesis: Hypothesis
    coordinates: Array
    evidence: float
    log_posterior: float
    noise_scale: float
    paid: float
    lacks: ResidualWrench
    along: Along


@dataclass(frozen=True)
class Ground:
    """A fitted hypothesis along its path.

    Attributes:
        found: the fit, and the path.
        cuts: windows.
        floor: size of a sensor's own error [N].
    """

    found: Traced
    cuts: Cuts
    floor: float

    @property
    def hypothesis(self) -> Hypothesis:
        """Return what effects are laid on."""
        return self.found.hypothesis

    @property
    def coordinates(self) -> Array:
        """Return (K,) its best along the path."""
        return self.found.coordinates

    @property
    def lacks(self) -> ResidualWrench:
        """Return the wrench that it lacks, and the path."""
        return self.found.lacks

    @property
    def evidence(self) -> float:
        """Return its log evidence along the path [nat], which effects on it are held against."""
        return self.found.evidence

    @property
    def climbed(self) -> Along:
        """Return the windows that are climbed along."""
        return self.found.along

    @property
    def row(self) -> Array:
        """Return (WIDTH,) its parameter row."""
        return self.hypothesis.rows(self.coordinates[None])[0]

    @cached_property
    def believed(self) -> ResidualWrench:
        """Return what it would lack with mass and friction as was believed: what it lacks has bent them."""
        believed = self.hypothesis.as_believed(self.coordinates)
        return residual_wrench(self.cuts.track, self.hypothesis.rows(believed[None])[0])

    @cached_property
    def first(self) -> Look:
        """Return what draws are compared with."""
        return self._look(laid(self.cuts, self.row, self.lacks, self.floor, COARSE))

    @cached_property
    def fine(self) -> Look:
        """Return the same in small steps."""
        return self._look(self.climbed)

    def _look(self, along: Along) -> Look:
        steps = step_sizes(self.hypothesis)
        moved = self.coordinates + np.concatenate([np.zeros((1, len(steps))), np.diag(steps)])
        found = along.residual(self.hypothesis.rows(moved))
        weight = np.sqrt(weights(along, np.sum(found[:1] ** 2, axis=2)))[:, :, None]
        flat = (found * weight).reshape(len(found), -1)
        slope = (flat[:1] - flat[1:]) / steps[:, None] * self.hypothesis.spread[:, None]
        return Look(along, weight, flat[0], slope)


def laid(cuts: Cuts, row: Array, lacks: ResidualWrench, floor: float, stride: int) -> Along:
    """Return windows along the path that a model (WIDTH,) and the wrench that it lacks explain together."""
    return lay_along(cuts, lacks.path, float(row[COLUMN["mass"]]), floor, stride)


def ground_of(hypothesis: Hypothesis, coordinates: Array, cuts: Cuts, floor: float) -> Ground:
    """Fit a hypothesis along its own path, from coordinates (K,)."""
    return Ground(traced(hypothesis, coordinates[None], cuts, floor), cuts, floor)


def traced(hypothesis: Hypothesis, starts: Array, cuts: Cuts, floor: float) -> Traced:
    """Fit a hypothesis along its own path, which is smoothed anew with what was fitted along the last.

    Args:
        hypothesis: what is free.
        starts: (n, K); the first path is that of the first.
        cuts: windows.
        floor: size of a sensor's own error [N].
    """
    found: Traced | None = None
    off = math.inf
    lacks: ResidualWrench | None = None
    for _ in range(ROUNDS):
        row = hypothesis.rows(starts[:1])[0]
        lacks = residual_wrench(cuts.track, row, size=None if lacks is None else lacks.size, about=lacks)
        along = laid(cuts, row, lacks, floor, FINE)
        starts = turned(along, hypothesis, starts) if found is None else starts
        last = _traced_along(hypothesis, starts, along, lacks)
        gained = math.inf if found is None else last.evidence - found.evidence
        # How far a steady error of the sensor reaches was laid down with another mass than was found.
        if found is None or off > SAME_MASS or gained > 0.0:
            mass = float(hypothesis.rows(last.coordinates[None])[0, COLUMN["mass"]])
            found, off = last, abs(math.log(mass / float(row[COLUMN["mass"]])))
        if gained < SETTLED and off <= SAME_MASS:
            break
        starts = last.coordinates[None]
    assert found is not None
    return found


def _traced_along(hypothesis: Hypothesis, starts: Array, along: Along, lacks: ResidualWrench) -> Traced:
    """Fit a hypothesis along a path, from starts (n, K); the path is that of what was left out about it."""
    found = climb_along(along, hypothesis, starts, ITERATIONS)
    best = int(np.argmax(found.evidence))
    scale = float(np.sqrt(max(1.0, found.misfit[best].sum() / along.counts.sum())))
    evidence, density = float(found.evidence[best]), found.log_posterior(best)
    paid = -0.5 * float(along.counts @ np.log(weights(along, found.misfit[best : best + 1])[0]))
    return Traced(hypothesis, found.coordinates[best], evidence, density, scale, paid, lacks, along)


def traced_score(found: Traced, kept: Cuts, whole: Cuts, floor: float) -> float:
    """Return the log density of windows that are not kept, given those that are [nat]: evidence over evidence.

    Args:
        found: a fit to all windows.
        kept: windows to fit to.
        whole: those, and the ones that are held out.
        floor: size of a sensor's own error [N].
    """
    mass = float(found.hypothesis.rows(found.coordinates[None])[0, COLUMN["mass"]])
    start, evidence = found.coordinates[None], []
    for cuts in (kept, whole):
        along = lay_along(cuts, found.along.path, mass, floor, found.along.stride)
        fitted = climb_along(along, found.hypothesis, start, ITERATIONS)
        start = fitted.coordinates
        evidence.append(float(fitted.evidence[0]))
    return evidence[1] - evidence[0]
