"""Locally weighted regression (thesis equations 17-20, "LWR"): a linear model around each query.

The weight of an example at distance d from the query is exp(-d^2 / lambda), d in features of unit spread, and only the
k nearest count. The fit has an intercept and a small ridge on its slopes, so that a query with few neighbours gets
their weighted mean instead of a singular system.
"""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pbrl_model.baselines.linear import standard
from pbrl_model.baselines.per_body import PerBodyRegression
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

NEIGHBOURS = 1000  # thesis table 3
BANDWIDTH = 1.5  # thesis table 3
BANDWIDTHS = tuple(BANDWIDTH * 2.0**power for power in range(-4, 11))
"""Among these the bandwidth is chosen where it is to be learned; the widest is all but a plain linear regression."""
RIDGE = 1e-4  # of the total weight, on slopes of features of unit spread
CHUNK = 2_000_000  # distances that are held at once


class LocallyWeightedRegression(PerBodyRegression):
    """Locally weighted regression, a model for each body.

    Args:
        neighbours: k, how many of the nearest examples count.
        bandwidth: lambda, in squared standard deviations of the features; None: for each body the one of `BANDWIDTHS`
            with the least error when each example is predicted from the others (thesis section 5.5.1: the kernel's
            hyper-parameters are learned).
    """

    def __init__(self, neighbours: int = NEIGHBOURS, bandwidth: float | None = BANDWIDTH) -> None:
        LocalRegressor(neighbours, bandwidth)  # a bad option is told here, not in `fit`
        super().__init__(lambda: LocalRegressor(neighbours, bandwidth))


class LocalRegressor:
    """y(x) = b + B x with b and B fitted anew around every query.

    Args:
        neighbours: k.
        bandwidth: lambda; None: learned by leaving one out.

    Attributes:
        bandwidth: lambda in use; `BANDWIDTH` until one was learned.
    """

    def __init__(self, neighbours: int = NEIGHBOURS, bandwidth: float | None = BANDWIDTH) -> None:
        if neighbours < 1:
            raise ModelError(f"LWR: expected at least one neighbour, got {neighbours}")
        if bandwidth is not None and not (math.isfinite(bandwidth) and bandwidth > 0.0):
            raise ModelError(f"LWR: expected a bandwidth above zero, got {bandwidth!r}")
        self._neighbours = neighbours
        self._learn_bandwidth = bandwidth is None
        self.bandwidth = BANDWIDTH if bandwidth is None else bandwidth

    def fit(self, features: Array, outputs: Array) -> Self:
        """Keep features (n, p) and outputs (n, q), n >= 1, and choose the bandwidth if asked to; return self."""
        self._middle, self._scale = standard(features)
        self._points = (features - self._middle) / self._scale
        self._outputs = outputs
        design = np.column_stack([np.ones(len(features)), self._points])
        self._squares = (design[:, :, None] * design[:, None, :]).reshape(len(design), -1)
        self._products = (design[:, :, None] * outputs[:, None, :]).reshape(len(design), -1)
        if self._learn_bandwidth and len(features) > 1:
            errors = [self._left_out_error(bandwidth) for bandwidth in BANDWIDTHS]
            self.bandwidth = BANDWIDTHS[int(np.argmin(errors))]
        return self

    def predict(self, features: Array) -> Array:
        """Return outputs (m, q) for features (m, p)."""
        queries = (features - self._middle) / self._scale
        out = np.empty((len(queries), self._outputs.shape[1]))
        step = max(1, CHUNK // len(self._points))
        for first in range(0, len(queries), step):
            some = queries[first : first + step]
            out[first : first + step] = self._solve(some, self._distances(some), self.bandwidth)
        return out

    def _distances(self, queries: Array) -> Array:
        """Return (m, n) squared distances from queries to examples."""
        squares = np.einsum("ij,ij->i", self._points, self._points)
        own = np.einsum("ij,ij->i", queries, queries)
        return np.maximum(own[:, None] + squares - 2.0 * queries @ self._points.T, 0.0)

    def _solve(self, queries: Array, distance: Array, bandwidth: float) -> Array:
        """Fit around each query and evaluate there (equations 18 and 19)."""
        if distance.shape[1] > self._neighbours:
            farthest = np.partition(distance, self._neighbours - 1, axis=1)[:, self._neighbours - 1, None]
            distance = np.where(distance <= farthest, distance, np.inf)
        # Weights relative to the nearest: far from all examples each alone would be zero.
        weight = np.exp((distance.min(axis=1, keepdims=True) - distance) / bandwidth)
        size = queries.shape[1] + 1
        normal = (weight @ self._squares).reshape(-1, size, size)
        slopes = np.arange(1, size)
        normal[:, slopes, slopes] += RIDGE * weight.sum(axis=1)[:, None]
        right = (weight @ self._products).reshape(len(queries), size, -1)
        coefficients = np.linalg.solve(normal, right)
        return coefficients[:, 0] + np.einsum("mi,mij->mj", queries, coefficients[:, 1:])

    def _left_out_error(self, bandwidth: float) -> float:
        """Return the mean squared error, each output over its variance, of predicting each example from the others."""
        distance = self._distances(self._points)
        np.fill_diagonal(distance, np.inf)
        error = self._solve(self._points, distance, bandwidth) - self._outputs
        spread = standard(self._outputs)[1]
        return float(np.mean((error / spread) ** 2))
