"""Problems whose posterior and evidence are known, for the tests of inference."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Residuals:
    """A problem given by its residuals and independent priors, uniform or normal.

    Attributes:
        whitened: (P, D) -> (P, M) residuals at s = 1.
        low: (D,) lower ends of uniform priors; NaN for a normal one.
        high: (D,) likewise.
        scale: (D,) standard deviations of normal priors around zero.
        circles: columns that are periodic.
        noise: column of ln s, or None.
        mirrored: whether theta and -theta are the same thing.
    """

    whitened: Callable[[Array], Array]
    low: tuple[float, ...]
    high: tuple[float, ...]
    scale: tuple[float, ...] = ()
    circles: tuple[int, ...] = ()
    noise: int | None = None
    mirrored: bool = False
    density: Callable[[Array], Array] | None = None
    calls: list[int] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"theta_{k}" for k in range(len(self.low)))

    @property
    def bounds(self) -> Array:
        low = np.where(np.isnan(self.low), -np.inf, self.low)
        return np.stack([low, np.where(np.isnan(self.high), np.inf, self.high)])

    @property
    def periodic(self) -> NDArray[np.bool_]:
        return np.isin(np.arange(len(self.low)), self.circles)

    @property
    def noise_column(self) -> int | None:
        return self.noise

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        d = len(self.low)
        flat = np.asarray(self.low) + rng.random((n, d)) * (np.asarray(self.high) - np.asarray(self.low))
        normal = rng.standard_normal((n, d)) * (np.asarray(self.scale) if self.scale else 1.0)
        return np.where(np.isnan(self.low), normal, flat)

    def log_prior(self, theta: Array) -> Array:
        low, high = self.bounds
        scale = np.asarray(self.scale) if self.scale else np.ones(len(self.low))
        flat = np.where((theta >= low) & (theta <= high), -np.log(np.where(np.isinf(high), 1.0, high - low)), -np.inf)
        normal = -0.5 * (theta / scale) ** 2 - np.log(scale) - 0.5 * math.log(2 * math.pi)
        return np.sum(np.where(np.isnan(self.low), normal, flat), axis=1)

    def log_likelihood(self, theta: Array) -> Array:
        self.calls.append(len(theta))
        if self.density is not None:
            return self.density(theta)
        r = self.whitened(theta)
        log_s = theta[:, self.noise] if self.noise is not None else np.zeros(len(theta))
        return -0.5 * np.sum(r**2, axis=1) * np.exp(-2 * log_s) - r.shape[1] * log_s

    def residuals(self, theta: Array, share: float = 1.0) -> Array:
        self.calls.append(len(theta))
        return self.whitened(theta)

    def images(self, theta: Array) -> Array:
        return np.stack([theta, -theta]) if self.mirrored else theta[None]


def linear(rows: int = 20, dimension: int = 4, seed: int = 1) -> tuple[Residuals, float, Array, Array]:
    """Return y = A theta + noise with a standard normal prior; log evidence, posterior mean and covariance."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((rows, dimension)) * np.geomspace(0.2, 20.0, dimension)
    y = a @ rng.standard_normal(dimension) + rng.standard_normal(rows)
    whole = np.eye(rows) + a @ a.T
    evidence = -0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1])
    covariance = np.linalg.inv(np.eye(dimension) + a.T @ a)
    nan = (math.nan,) * dimension
    return Residuals(lambda t: t @ a.T - y, nan, nan), float(evidence), covariance @ a.T @ y, covariance
