"""How much an outcome would say about which hypothesis is true: pairwise distances of Gaussian mixtures.

With outcomes y ~ N(m_i, C_i) under hypothesis i, which has probability p_i, the mutual information of hypothesis and
outcome lies between

    -sum_i p_i ln sum_j p_j exp(-B_ij)   and   -sum_i p_i ln sum_j p_j exp(-D_ij),

B the Bhattacharyya distance, D the Kullback-Leibler divergence (Kolchinsky and Tracey, "Estimating mixture entropy
with pairwise distances", Entropy 19 (2017) 361). Both are zero where all hypotheses say the same and at most the
entropy of p; neither needs noise to be drawn, so that two pushes are never ranked by its chance.

A hypothesis that is little known, a cord that may be taut or slack, is no Gaussian: one as wide as its outcomes would
seem easy to tell from a hypothesis that says "nothing moves", though half of its own draws say so too. So exp(-B) is
never taken to be less than the mean of exp(-B) between single draws of the one and the Gaussian of the other. That
makes hypotheses more alike and the lower bound lower.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def information_bounds(
    probability: Array, mean: Array, covariance: Array, draws: Array | None = None, noise: Array | None = None
) -> tuple[Array, Array]:
    """Return lower and upper bounds (C,) of the information in each of C experiments [bit].

    Args:
        probability: (H,) of the hypotheses, summing to one.
        mean: (H, C, D) of the outcome.
        covariance: (H, C, D, D).
        draws: (H, S, C, D) outcomes without noise for draws of each hypothesis's parameters; None: Gaussians alone.
        noise: (C, D, D) covariance of a draw's outcome; needed with `draws`.
    """
    count = len(probability)
    root = np.linalg.cholesky(covariance)
    log_det = 2.0 * np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
    inverse = np.linalg.inv(covariance)
    middle = np.zeros((count, count, mean.shape[1]))
    divergence = np.zeros_like(middle)
    for i in range(count):
        for j in range(count):
            if i == j:
                continue
            off = (mean[i] - mean[j])[..., None]
            both = 0.5 * (covariance[i] + covariance[j])
            squares = _quadratic(off, np.linalg.solve(both, off))
            middle[i, j] = squares / 8.0 + 0.5 * (np.linalg.slogdet(both)[1] - 0.5 * (log_det[i] + log_det[j]))
            trace = np.trace(inverse[j] @ covariance[i], axis1=-2, axis2=-1)
            squares = _quadratic(off, inverse[j] @ off)
            divergence[i, j] = 0.5 * (trace - mean.shape[2] + squares + log_det[j] - log_det[i])
    alike = np.exp(-np.maximum(middle, 0.0))
    if draws is not None and noise is not None:
        alike = np.maximum(alike, _alike_by_draws(mean, covariance, log_det, draws, noise))
    return _bits(probability, alike), _bits(probability, np.exp(-np.maximum(divergence, 0.0)))


def _alike_by_draws(mean: Array, covariance: Array, log_det: Array, draws: Array, noise: Array) -> Array:
    """Return (H, H, C) mean of exp(-B) between draws of one hypothesis and the Gaussian of another, the larger way."""
    count, noise_log_det = len(mean), np.linalg.slogdet(noise)[1]
    one_way = np.ones((count, count, mean.shape[1]))
    for j in range(count):
        both = 0.5 * (noise + covariance[j])
        whiten = np.linalg.inv(np.linalg.cholesky(both))
        spread = 0.5 * (np.linalg.slogdet(both)[1] - 0.5 * (noise_log_det + log_det[j]))
        for i in range(count):
            if i != j:
                off = np.einsum("cde,sce->scd", whiten, draws[i] - mean[j])
                one_way[i, j] = np.mean(np.exp(-np.sum(off**2, axis=-1) / 8.0 - np.maximum(spread, 0.0)), axis=0)
    return np.maximum(one_way, np.swapaxes(one_way, 0, 1))


def _quadratic(left: Array, right: Array) -> Array:
    return np.sum(left[..., 0] * right[..., 0], axis=-1)


def _bits(probability: Array, alike: Array) -> Array:
    """Return (C,) -sum_i p_i log2 sum_j p_j alike_ij."""
    mixed = np.einsum("j,ijc->ic", probability, alike)
    return np.maximum(-(probability @ np.log(np.maximum(mixed, 1e-300))) / math.log(2.0), 0.0)
