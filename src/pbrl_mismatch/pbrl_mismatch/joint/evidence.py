"""Evidence of a set of laws: strengths and signs in closed form, places and texture by Laplace, checked by sampling.

The force is y = C b + e in n cells: C the laws' shapes, b their strengths, e sensor noise plus a texture that is
correlated along the way (an Ornstein-Uhlenbeck process). The texture is what keeps this honest: whatever no law
explains is paid for by it, so that a few hundred neighbouring cells do not count as a few hundred facts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, minimize
from scipy.special import log_ndtr

from pbrl_mismatch.joint.laws import DEGREE, FRICTION, Law, Strength, Unknown
from pbrl_mismatch.joint.pull import Pull
from pbrl_mismatch.joint.texture_kernel import whitened

Array = NDArray[np.float64]

LOG_TWO_PI = math.log(2.0 * math.pi)
SENSOR_FLOOR = 0.15
"""No law and no sensor is right to less than this in one cell [N]: sharper, every small step would be a proof."""
TEXTURE_LENGTH = 3.0 * DEGREE
"""Roughness is forgotten over this way [rad]. It is not learned: a texture that is free to be long is a law in disguise
that takes what a catch does over twenty degrees; what holds over more than this has to be explained."""
FAR = 1e12
"""In place of an infinite cost."""
SLOPE_STEP, CURVE_STEP = 1e-5, 2e-3
"""Finite differences for slopes and curvatures, as shares of a prior's spread."""
TAILS = 5.0
"""Degrees of freedom of the Student t that proposals are drawn from."""


def noise_unknowns() -> tuple[Unknown, ...]:
    """Return what is learned of the noise: how strong the texture is [N]."""
    return (Unknown("texture", "N", 0.3, 1.0, positive=True),)


@dataclass(frozen=True)
class Hypothesis:
    """Constant friction and some laws."""

    laws: tuple[Law, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Return the names of what it adds to the baseline."""
        return tuple(law.effect for law in self.laws)

    def unknowns(self, pull: Pull) -> tuple[Unknown, ...]:
        """Return places and widths of all laws, then the texture."""
        return (*(each for law in self.laws for each in law.unknowns(pull)), *noise_unknowns())

    def strengths(self, pull: Pull) -> tuple[Strength, ...]:
        """Return what is solved for: friction first, then the laws'."""
        return tuple(each for law in (FRICTION, *self.laws) for each in law.strengths(pull))

    def columns(self, pull: Pull, values: Array) -> Array:
        """Return (n, k) shapes at values (K,) of the unknowns; the texture's is not used."""
        parts, factor, at = [FRICTION.shape(pull, values[:0])], None, 0
        for law in self.laws:
            count = len(law.unknowns(pull))
            shape = law.shape(pull, values[at : at + count])
            at += count
            if law.multiplies:
                factor = shape if factor is None else factor * shape
            else:
                parts.append(shape)
        columns = np.hstack(parts)
        return columns if factor is None else columns * factor


@dataclass(frozen=True)
class Solved:
    """Strengths at given places and noise: a Gaussian, cut at zero where one is positive."""

    mean: Array
    covariance: Array
    log_likelihood: float

    def likeliest(self, positive: NDArray[np.bool_]) -> Array:
        """Return the likeliest strengths (k,) that have the signs they must have, all together."""
        if np.all(self.mean[positive] >= 0.0):
            return self.mean
        root = np.linalg.cholesky(np.linalg.inv(self.covariance)).T
        lower = np.where(positive, 0.0, -np.inf)
        return np.asarray(lsq_linear(root, root @ self.mean, (lower, np.inf)).x)

    def moments(self, positive: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return means and standard deviations (k,), of each alone, with the cut."""
        sd = np.sqrt(np.diag(self.covariance))
        z = self.mean / sd
        mills = np.exp(-0.5 * z**2 - 0.5 * LOG_TWO_PI - log_ndtr(z))
        mean = np.where(positive, self.mean + sd * mills, self.mean)
        # Far out in the tail the cut Gaussian is an exponential, and the difference below loses all digits.
        cut = sd * np.sqrt(np.clip(1.0 - mills * (z + mills), 1e-6, 1.0))
        return mean, np.where(positive, cut, sd)


class Problem:
    """The log posterior of one hypothesis in the coordinates of its unknowns.

    Attributes:
        pull: what was felt.
        hypothesis: what is held against it.
        unknowns: K of them.
        mean: (K,) of the prior.
        spread: (K,) of the prior.
    """

    def __init__(self, pull: Pull, hypothesis: Hypothesis) -> None:
        self.pull, self.hypothesis = pull, hypothesis
        self.unknowns = hypothesis.unknowns(pull)
        strengths = hypothesis.strengths(pull)
        self.mean = np.array([each.mean for each in self.unknowns])
        self.spread = np.array([each.spread for each in self.unknowns])
        self.positive = np.array([each.positive for each in strengths])
        self._believed = np.array([each.spread for each in strengths])
        self._white = np.empty((len(pull), 1 + len(strengths)))

    def values(self, coordinates: Array) -> Array:
        """Return (K,) values of coordinates."""
        pairs = zip(self.unknowns, coordinates.tolist(), strict=True)
        return np.array([unknown.value(coordinate) for unknown, coordinate in pairs])

    def solved(self, coordinates: Array) -> Solved:
        """Solve for the strengths; the likelihood is that of the force, strengths integrated out.

        Signs count by each strength's own distribution: exact for one, near enough where strengths are not alike.
        """
        values = self.values(coordinates)
        series = np.column_stack([self.pull.force, self.hypothesis.columns(self.pull, values)])
        half = whitened(series, self.pull.step, SENSOR_FLOOR, values[-1], TEXTURE_LENGTH, self._white)
        felt, shapes = self._white[:, 0], self._white[:, 1:] * self._believed
        information = shapes.T @ shapes + np.eye(shapes.shape[1])
        covariance = np.linalg.inv(information)
        unit = covariance @ (shapes.T @ felt)
        log_likelihood = (
            -0.5 * (felt @ felt - unit @ information @ unit)
            - half
            - 0.5 * float(np.linalg.slogdet(information)[1])
            - 0.5 * len(felt) * LOG_TWO_PI
        )
        sure = unit / np.sqrt(np.diag(covariance))
        signs = float(np.sum(math.log(2.0) + log_ndtr(sure[self.positive])))
        believed = self._believed
        return Solved(unit * believed, covariance * np.outer(believed, believed), log_likelihood + signs)

    def log_density(self, coordinates: Array) -> float:
        """Return log likelihood plus log prior of the coordinates [nat]."""
        away = (coordinates - self.mean) / self.spread
        if not np.all(np.isfinite(away)) or np.abs(away).max() > 30.0:
            return -FAR
        prior = -0.5 * float(away @ away) - float(np.log(self.spread).sum()) - 0.5 * len(away) * LOG_TWO_PI
        density = self.solved(coordinates).log_likelihood + prior
        return density if math.isfinite(density) else -FAR

    def _cost(self, away: Array) -> float:
        return -self.log_density(self.mean + self.spread * away)

    def climb(self, start: Array) -> Array:
        """Return the coordinates (K,) of the best point that is reached from a start."""
        options = {"maxiter": 60, "gtol": 1e-3, "eps": SLOPE_STEP}
        found = minimize(self._cost, (start - self.mean) / self.spread, method="BFGS", options=options)
        return self.mean + self.spread * found.x

    def curvature(self, peak: Array) -> Array:
        """Return (K, K) second derivatives of the cost in coordinates divided by the prior's spread."""
        at, size = (peak - self.mean) / self.spread, len(peak)
        steps = CURVE_STEP * np.eye(size)
        centre = self._cost(at)
        ahead = np.array([self._cost(at + step) for step in steps])
        behind = np.array([self._cost(at - step) for step in steps])
        matrix = np.diag((ahead + behind - 2.0 * centre) / CURVE_STEP**2)
        for i in range(size):
            for j in range(i):
                both = self._cost(at + steps[i] + steps[j]) + self._cost(at - steps[i] - steps[j])
                mixed = (both - ahead[i] - ahead[j] - behind[i] - behind[j] + 2.0 * centre) / (2.0 * CURVE_STEP**2)
                matrix[i, j] = matrix[j, i] = mixed
        return matrix


@dataclass(frozen=True)
class Explained:
    """One hypothesis at its best point.

    Attributes:
        problem: what was climbed on.
        coordinates: (K,) of the best point.
        covariance: (K, K) of the coordinates there, or of the samples.
        evidence: log evidence [nat].
        checked: standard error of the evidence by importance sampling [nat]; NaN where it is by Laplace alone.
        settled: whether the best point is a peak, and samples, if any, agree with it.
    """

    problem: Problem
    coordinates: Array
    covariance: Array
    evidence: float
    checked: float
    settled: bool

    @property
    def hypothesis(self) -> Hypothesis:
        """Return what was held against the pull."""
        return self.problem.hypothesis

    @cached_property
    def values(self) -> Array:
        """Return (K,) values of the unknowns."""
        return self.problem.values(self.coordinates)

    @cached_property
    def solved(self) -> Solved:
        """Return the strengths there."""
        return self.problem.solved(self.coordinates)

    def value(self, name: str) -> float:
        """Return one unknown's value."""
        return float(self.values[[each.name for each in self.problem.unknowns].index(name)])

    def law_force(self, pull: Pull) -> Array:
        """Return (n,) what the laws alone say of the cells of any pull of this door [N]."""
        return self.hypothesis.columns(pull, self.values) @ self.solved.likeliest(self.problem.positive)


def explained(problem: Problem, starts: Array) -> Explained:
    """Climb from starts (m, K) and take the best point, its evidence by Laplace."""
    tops = [problem.climb(start) for start in starts]
    peak = max(tops, key=problem.log_density)
    vectors, covariance, settled = _laplace(problem, peak)
    evidence = problem.log_density(peak) + 0.5 * len(peak) * LOG_TWO_PI + float(vectors)
    return Explained(problem, peak, covariance, evidence, math.nan, settled)


def _laplace(problem: Problem, peak: Array) -> tuple[float, Array, bool]:
    """Return half the log determinant of the covariance, the covariance (K, K), and whether it is a peak."""
    size, turn = np.linalg.eigh(problem.curvature(peak))
    settled = bool(size.min() > 0.0)
    size = np.maximum(size, 1.0)  # the prior alone curves so much
    scaled = (turn / size) @ turn.T
    half = -0.5 * float(np.log(size).sum()) + float(np.log(problem.spread).sum())
    return half, scaled * np.outer(problem.spread, problem.spread), settled


def checked(rng: np.random.Generator, found: Explained, draws: int = 1500) -> Explained:
    """Return an explanation with evidence and covariance by importance sampling around its best point.

    Where fewer than a twentieth of the draws count, the Laplace value stays and the explanation says that it has not
    settled.
    """
    problem, size = found.problem, len(found.coordinates)
    factor = np.linalg.cholesky(found.covariance)
    normal = rng.standard_normal((draws, size))
    stretch = np.sqrt(rng.chisquare(TAILS, draws) / TAILS)[:, None]
    unit = normal / stretch
    points = found.coordinates + unit @ factor.T
    proposal = (
        math.lgamma(0.5 * (TAILS + size))
        - math.lgamma(0.5 * TAILS)
        - 0.5 * size * math.log(TAILS * math.pi)
        - float(np.log(np.diag(factor)).sum())
        - 0.5 * (TAILS + size) * np.log1p(np.sum(unit**2, axis=1) / TAILS)
    )
    log_weight = np.array([problem.log_density(point) for point in points]) - proposal
    top = log_weight.max()
    weight = np.exp(log_weight - top)
    share = weight / weight.sum()
    count = 1.0 / float(np.sum(share**2))
    if count < draws / 20:
        return replace(found, settled=False)
    mean = share @ points
    covariance = (points - mean).T @ (share[:, None] * (points - mean))
    error = float(weight.std() / weight.mean() / math.sqrt(draws))
    return replace(found, covariance=covariance, evidence=top + math.log(weight.mean()), checked=error)
