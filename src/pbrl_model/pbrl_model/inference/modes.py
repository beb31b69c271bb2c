"""The mode finder: many starts at once, a horizon that grows, symmetric descriptions mapped, duplicates merged.

An open-loop likelihood is a needle: over a long horizon almost every start is lost. So the search begins with a short
one, in which every model is nearly right, and grows it as the fit improves. Waves of starts go on until the best mode
has been found several times over: a mode that one start in a wave finds is one of which others like it may be missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference.metered import Metered
from pbrl_model.inference.mixture import inverse
from pbrl_model.inference.optimise import Optima, begin, climb, slopes
from pbrl_model.inference.problem import Domain

Array = NDArray[np.float64]

SAME = 5.0
"""Ends nearer than so many standard deviations (times the root of the dimension) are one mode."""
SAME_START = 0.01
"""While climbing, starts nearer than this share of the prior's spread in every column are one."""
NEGLIGIBLE = 14.0
"""A mode whose mass is smaller by so many nats than the largest is left out."""


@dataclass(frozen=True)
class SearchOptions:
    """How wide and how long to search.

    Attributes:
        screen: prior draws compared on the shortest horizon in every wave.
        starts: of them that climb.
        shares: of the horizon, one a stage; the last is 1.
        keep: share of the starts kept after each stage but the last.
        iterations: of each stage at most; starts that have arrived rest.
        waves: at most so many.
        hits: waves end when the best mode was found by so many starts.
        most: modes kept, descriptions of the same thing counted once.
    """

    screen: int = 256
    starts: int = 64
    shares: tuple[float, ...] = tuple(k / 10 for k in range(1, 11))
    keep: float = 0.7
    iterations: int = 20
    waves: int = 6
    hits: int = 3
    most: int = 8

    def __post_init__(self) -> None:
        if not self.shares or self.shares[-1] != 1.0 or list(self.shares) != sorted(self.shares) or self.shares[0] <= 0:
            raise ModelError(f"search: expected shares that grow to 1, got {self.shares}")
        if (
            min(self.screen, self.starts, self.iterations, self.waves, self.hits, self.most) < 1
            or not 0.0 < self.keep <= 1.0
        ):
            raise ModelError(f"search: expected counts of at least 1 and keep in (0, 1], got {self}")


@dataclass(frozen=True)
class Modes:
    """What was found.

    Attributes:
        theta: (M, D), best first.
        value: (M,) log densities up to a constant.
        covariance: (M, D, D) of the Gaussian that fits there.
        hits: (M,) starts that ended there, or at another description of the same.
        starts: that were sent out.
        dropped: (n, D) modes of some mass that the cap left out.
    """

    theta: Array
    value: Array
    covariance: Array
    hits: NDArray[np.int64]
    starts: int
    dropped: Array


def find_modes(
    rng: np.random.Generator,
    meter: Metered,
    options: SearchOptions,
    guesses: Array | None = None,
    max_calls: int = 1_000_000,
) -> Modes:
    """Search the prior's support for modes.

    Args:
        rng: source of randomness.
        meter: of the problem.
        options: effort.
        guesses: (G, D) starts beside the prior's draws, or None.
        max_calls: no further wave begins once so many were made.

    Raises:
        ModelError: no start has a finite density.
    """
    ends: list[tuple[Optima, NDArray[np.int64]]] = []
    modes = None
    for wave in range(options.waves):
        ends.append(_wave(rng, meter, options, guesses if wave == 0 else None))
        hits = np.concatenate([end[1] for end in ends])
        modes = _merged(meter, _joined([end[0] for end in ends]), hits, options.most, options.starts * (wave + 1))
        if (modes is not None and modes.hits[0] >= options.hits) or meter.calls >= max_calls:
            break
    if modes is None:
        raise ModelError("search: expected a start of finite density, got none; check that the prior allows the data")
    return modes


def _wave(
    rng: np.random.Generator, meter: Metered, options: SearchOptions, guesses: Array | None
) -> tuple[Optima, NDArray[np.int64]]:
    """Send one wave of starts out; return where they end and by how many starts each end was reached."""
    draws = meter.domain.clip(meter.problem.sample_prior(rng, options.screen))
    if guesses is not None and len(guesses):
        draws = np.concatenate([draws, meter.domain.clip(guesses)])
    screened = begin(meter, draws, options.shares[0])
    rows = np.argsort(-screened.value, kind="stable")[: options.starts]
    optima, hits = screened.take(rows), np.ones(len(rows), dtype=np.int64)
    for stage, share in enumerate(options.shares):
        if stage:
            damping, curvature = optima.damping, optima.curvature
            fresh = begin(meter, optima.theta, share)
            optima = Optima(fresh.theta, fresh.value, fresh.residuals, np.maximum(damping, 1e-4), curvature)
        optima = climb(meter, optima, share, options.iterations)
        optima, hits = _distinct(meter, optima, hits)
        if stage < len(options.shares) - 1:
            kept = np.argsort(-optima.value, kind="stable")[: max(2, round(options.keep * len(optima.value)))]
            optima, hits = optima.take(kept), hits[kept]
    return optima, hits


def _distinct(meter: Metered, optima: Optima, hits: NDArray[np.int64]) -> tuple[Optima, NDArray[np.int64]]:
    """Merge starts that have come together, other descriptions of the same included; best first."""
    order = [row for row in np.argsort(-optima.value, kind="stable") if np.isfinite(optima.value[row])]
    kept: list[int] = []
    counts: list[int] = []
    for row in order:
        same = None
        if kept:
            images = meter.problem.images(optima.theta[row : row + 1])[:, 0]
            offset = np.abs(meter.domain.offset(images[:, None], optima.theta[kept][None])) / meter.spread
            near = np.flatnonzero(np.all(offset < SAME_START, axis=2).any(axis=0))
            same = int(near[0]) if len(near) else None
        if same is None:
            kept.append(int(row))
            counts.append(int(hits[row]))
        else:
            counts[same] += int(hits[row])
    return optima.take(np.array(kept, dtype=np.int64)), np.array(counts, dtype=np.int64)


def _joined(parts: list[Optima]) -> Optima:
    columns = zip(*[(o.theta, o.value, o.residuals, o.damping, o.curvature) for o in parts], strict=True)
    return Optima(*[np.concatenate(column) for column in columns])


def _merged(meter: Metered, ends: Optima, hits: NDArray[np.int64], most: int, starts: int) -> Modes | None:
    """Return distinct modes of some mass with their covariances, or None where no end has a finite density."""
    order = np.argsort(-ends.value, kind="stable")
    order = order[np.isfinite(ends.value[order])]
    if len(order) == 0:
        return None
    # A mode far below the best in density could only make up for it with a volume that no prior offers.
    order = order[ends.value[order] > ends.value[order[0]] - 3.0 * NEGLIGIBLE][: 4 * most]
    ends, hits = ends.take(order), hits[order]
    curvature, _ = slopes(meter, ends, 1.0, both_sides=True)
    covariance = inverse(curvature)
    kept: list[int] = []
    counts: list[int] = []
    for row in range(len(ends.theta)):
        images = meter.problem.images(ends.theta[row : row + 1])[:, 0]
        distance = [np.min(distances(meter.domain, images, ends.theta[k], covariance[k])) for k in kept]
        if distance and min(distance) < SAME * np.sqrt(meter.domain.dimension):
            counts[int(np.argmin(distance))] += int(hits[row])
        else:
            kept.append(row)
            counts.append(int(hits[row]))
    mass = ends.value[kept] + 0.5 * np.linalg.slogdet(covariance[kept])[1]
    heavy = np.flatnonzero(mass > mass.max() - NEGLIGIBLE)
    heavy = heavy[np.argsort(-mass[heavy], kind="stable")]
    rows = np.array(kept)[heavy[:most]]
    return Modes(
        ends.theta[rows],
        ends.value[rows],
        covariance[rows],
        np.array(counts)[heavy[:most]],
        starts,
        ends.theta[np.array(kept)[heavy[most:]]],
    )


def distances(domain: Domain, points: Array, mean: Array, covariance: Array) -> Array:
    """Return the distances (n,) of points (n, D) from a mean, in standard deviations of its covariance."""
    white = np.linalg.solve(np.linalg.cholesky(covariance), domain.offset(points, mean).T)
    return np.asarray(np.sqrt(np.einsum("in,in->n", white, white)))
