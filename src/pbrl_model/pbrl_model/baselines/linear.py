"""Linear regression of displacements: much bias, little variance (thesis section 5.5.1, "LR")."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray

from pbrl_model.baselines.per_body import PerBodyRegression

Array = NDArray[np.float64]


class LinearRegression(PerBodyRegression):
    """Ordinary least squares with an intercept, a model for each body."""

    def __init__(self) -> None:
        super().__init__(LinearRegressor)


class LinearRegressor:
    """y = b + B x by least squares; of the solutions that fit alike, the one with the least slopes.

    Features are brought to unit spread first, so that what is least does not hang on their units; a feature that never
    varied has no slope.
    """

    def __init__(self) -> None:
        self._slopes = np.zeros((0, 0))
        self._intercept = np.zeros(0)

    def fit(self, features: Array, outputs: Array) -> Self:
        """Learn from features (n, p) and outputs (n, q), n >= 1; return self."""
        middle, scale = standard(features)
        mean = outputs.mean(axis=0)
        slopes = np.linalg.lstsq((features - middle) / scale, outputs - mean, rcond=None)[0]
        self._slopes = slopes / scale[:, None]
        self._intercept = mean - middle @ self._slopes
        return self

    def predict(self, features: Array) -> Array:
        """Return outputs (m, q) for features (m, p)."""
        return features @ self._slopes + self._intercept


def standard(features: Array) -> tuple[Array, Array]:
    """Return means (p,) and standard deviations (p,) of features (n, p), one where a feature does not vary."""
    middle, spread = features.mean(axis=0), features.std(axis=0)
    same = spread <= 1e-12 * np.maximum(1.0, np.abs(middle))  # rounding alone makes a constant's spread not zero
    return middle, np.where(same, 1.0, spread)
