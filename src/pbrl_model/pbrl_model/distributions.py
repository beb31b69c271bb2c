"""Univariate distributions of thesis table 2: sample and log density, with their support.

Sampling takes the generator; densities take arrays of any shape and are -inf outside the support and for NaN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import i0e, log_ndtr, ndtr, ndtri

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

LOG_2PI = math.log(2.0 * math.pi)


class Distribution(Protocol):
    """What a prior needs of each of its parts."""

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the ends of the support."""
        ...

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n,) values."""
        ...

    def log_prob(self, x: ArrayLike) -> Array:
        """Return the log density [nat], of the shape of `x`."""
        ...


@dataclass(frozen=True)
class LogNormal:
    """log x ~ Normal(log median, sigma^2).

    Attributes:
        median: half of the mass lies below [unit of x].
        sigma: spread of log x [1].
    """

    median: float
    sigma: float

    def __post_init__(self) -> None:
        _require(self.median > 0.0 and math.isfinite(self.median), "LogNormal", "a median above zero", self.median)
        _require(self.sigma > 0.0 and math.isfinite(self.sigma), "LogNormal", "sigma above zero", self.sigma)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return (0, inf)."""
        return 0.0, math.inf

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n,) values."""
        return self.median * np.exp(self.sigma * rng.standard_normal(n))

    def log_prob(self, x: ArrayLike) -> Array:
        """Return the log density [nat], of the shape of `x`."""
        value = np.asarray(x, dtype=float)
        inside = (value > 0.0) & (value < math.inf)
        log_x = np.log(np.where(inside, value, 1.0))
        z = (log_x - math.log(self.median)) / self.sigma
        return np.where(inside, -0.5 * z * z - log_x - math.log(self.sigma) - 0.5 * LOG_2PI, -np.inf)


@dataclass(frozen=True)
class TruncatedNormal:
    """Normal(mean, sd^2) cut off outside [lower, upper] and scaled up again.

    Attributes:
        mean: of the normal before the cut; may lie outside.
        sd: likewise.
        lower: end of the support.
        upper: end of the support.
    """

    mean: float
    sd: float
    lower: float
    upper: float

    def __post_init__(self) -> None:
        _require(math.isfinite(self.mean), "TruncatedNormal", "a finite mean", self.mean)
        _require(self.sd > 0.0 and math.isfinite(self.sd), "TruncatedNormal", "sd above zero", self.sd)
        ordered = math.isfinite(self.lower) and math.isfinite(self.upper) and self.lower < self.upper
        _require(ordered, "TruncatedNormal", "finite lower < upper", (self.lower, self.upper))

    @property
    def bounds(self) -> tuple[float, float]:
        """Return (lower, upper)."""
        return self.lower, self.upper

    def _standard(self) -> tuple[float, float, float]:
        """Return the cut in standard units, mirrored into the left tail, where `ndtr` is precise, and the sign."""
        alpha, beta = (self.lower - self.mean) / self.sd, (self.upper - self.mean) / self.sd
        return (-beta, -alpha, -1.0) if alpha > 0.0 else (alpha, beta, 1.0)

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n,) values."""
        alpha, beta, sign = self._standard()
        share = ndtr(alpha) + rng.random(n) * (ndtr(beta) - ndtr(alpha))
        return np.clip(self.mean + sign * self.sd * ndtri(share), self.lower, self.upper)

    def log_prob(self, x: ArrayLike) -> Array:
        """Return the log density [nat], of the shape of `x`."""
        value = np.asarray(x, dtype=float)
        alpha, beta, _ = self._standard()
        low, high = float(log_ndtr(alpha)), float(log_ndtr(beta))
        log_mass = high + math.log1p(-math.exp(low - high))
        z = (value - self.mean) / self.sd
        inside = (value >= self.lower) & (value <= self.upper)
        return np.where(inside, -0.5 * z * z - 0.5 * LOG_2PI - math.log(self.sd) - log_mass, -np.inf)


@dataclass(frozen=True)
class VonMises:
    """Density proportional to exp(kappa cos(x - mean)) on the circle.

    Samples lie in [-pi, pi]; the density is of period 2 pi and takes any angle.

    Attributes:
        mean: [rad].
        kappa: concentration; 0: every direction alike.
    """

    mean: float
    kappa: float

    def __post_init__(self) -> None:
        _require(math.isfinite(self.mean), "VonMises", "a finite mean [rad]", self.mean)
        _require(self.kappa >= 0.0 and math.isfinite(self.kappa), "VonMises", "kappa of at least zero", self.kappa)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return (-pi, pi)."""
        return -math.pi, math.pi

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n,) values."""
        turned = self.mean + rng.vonmises(0.0, self.kappa, n)
        return turned - 2.0 * math.pi * np.round(turned / (2.0 * math.pi))

    def log_prob(self, x: ArrayLike) -> Array:
        """Return the log density [nat], of the shape of `x`."""
        value = np.asarray(x, dtype=float)
        inside = np.isfinite(value)
        cosine = np.cos(np.where(inside, value, self.mean) - self.mean)
        log_norm = LOG_2PI + math.log(float(i0e(self.kappa)))
        return np.where(inside, self.kappa * (cosine - 1.0) - log_norm, -np.inf)


@dataclass(frozen=True)
class Uniform:
    """The same density everywhere on [lower, upper]."""

    lower: float
    upper: float

    def __post_init__(self) -> None:
        ordered = math.isfinite(self.lower) and math.isfinite(self.upper) and self.lower < self.upper
        _require(ordered, "Uniform", "finite lower < upper", (self.lower, self.upper))

    @property
    def bounds(self) -> tuple[float, float]:
        """Return (lower, upper)."""
        return self.lower, self.upper

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n,) values."""
        return rng.uniform(self.lower, self.upper, n)

    def log_prob(self, x: ArrayLike) -> Array:
        """Return the log density [nat], of the shape of `x`."""
        value = np.asarray(x, dtype=float)
        inside = (value >= self.lower) & (value <= self.upper)
        return np.where(inside, -math.log(self.upper - self.lower), -np.inf)


def _require(holds: bool, name: str, expected: str, got: object) -> None:
    if not holds:
        raise ModelError(f"{name}: expected {expected}, got {got}")
