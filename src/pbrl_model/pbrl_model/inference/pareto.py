"""The tail of importance weights: Pareto's k, which tells whether their mean can be believed (PSIS).

The same estimate as ArviZ's `psislw`, here without its import of seconds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

Array = NDArray[np.float64]

FEW_WEIGHTS = 25
"""Fewer weights than this above zero have no tail to judge."""
LEAST_TAIL = 5
"""A generalised Pareto distribution is not fitted to fewer."""
ALIKE = 1e-9
"""Log weights whose range is below this have no tail."""
PRIOR_SIZE, PRIOR_K = 10, 0.5
"""The estimate is drawn towards k = 0.5 as by ten weights more (Vehtari et al. 2024)."""


def pareto_shape(log_weights: Array) -> float:
    """Return Pareto's k of the upper tail of weights given by their logs (n,), in any order and scale.

    Infinite where there are too few weights to tell, or where a few carry everything; -inf where all are alike.
    """
    positive = np.sort(log_weights[np.isfinite(log_weights)])
    if len(positive) < FEW_WEIGHTS:
        return math.inf
    if positive[-1] - positive[0] < ALIKE:
        return -math.inf
    size = math.ceil(min(len(positive) / 5.0, 3.0 * math.sqrt(len(positive))))
    scaled = positive - positive[-1]
    cutoff = max(scaled[-size - 1], math.log(np.finfo(float).tiny))
    tail = scaled[scaled > cutoff]
    if len(tail) < LEAST_TAIL:
        return math.inf
    return generalised_pareto(np.exp(tail) - math.exp(cutoff))


def generalised_pareto(excess: Array) -> float:
    """Return the shape k of a generalised Pareto distribution of excesses (n,), ascending (Zhang and Stephens 2009)."""
    n = len(excess)
    points = 30 + math.floor(math.sqrt(n))
    b = 1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))
    b = b / (3.0 * excess[int(n / 4.0 + 0.5) - 1]) + 1.0 / excess[-1]
    k = np.mean(np.log1p(-b[:, None] * excess), axis=1)
    log_likelihood = n * (np.log(-b / k) - k - 1.0)
    weights = np.exp(log_likelihood - logsumexp(log_likelihood))
    heavy = weights >= 10.0 * np.finfo(float).eps
    b_mean = np.sum(b[heavy] * weights[heavy]) / np.sum(weights[heavy])
    shape = float(np.mean(np.log1p(-b_mean * excess)))
    return (n * shape + PRIOR_SIZE * PRIOR_K) / (n + PRIOR_SIZE)
