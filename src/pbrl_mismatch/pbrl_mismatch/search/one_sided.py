"""A test against what can only be positive: a misfit to the other side is none of it.

Of an estimate b with covariance W, of which the first two numbers cannot be negative, the statistic is how much nearer
to b the nearest point that can be is than zero,

    T = |b|^2 - min_(t_1, t_2 >= 0) |b - t|^2,   |x|^2 = x^T W^-1 x.

At zero T is a mixture of chi-squares with as many degrees of freedom as stay free (Kudo 1963; Gourieroux, Holly and
Monfort 1982): with correlation r of the two, the chance that both stay is 1/4 + asin(r) / 2 pi, that neither does
1/4 - asin(r) / 2 pi. Where the noise is estimated each is F in its place (Wolak 1987).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import f as f_distribution

Array = NDArray[np.float64]

SIGNED = 2
"""Numbers that cannot be negative; they come first."""


def one_sided(estimate: Array, covariance: Array, degrees: int) -> float:
    """Return the chance of an estimate that far off to the sides it can be off to, if nothing is off.

    Args:
        estimate: (K,) of which the first two cannot be negative.
        covariance: (K, K) if nothing is off.
        degrees: of freedom with which the noise was estimated.
    """
    free = len(estimate) - SIGNED
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    seen = root @ estimate
    # A number that can have any sign is one that cannot be negative less another.
    _, left = nnls(np.hstack([root, -root[:, SIGNED:]]), seen)
    statistic = max(float(seen @ seen) - left**2, 0.0)
    correlation = covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1])
    both = 0.25 + math.asin(correlation) / (2.0 * math.pi)
    shares = {free: 0.5 - both, free + 1: 0.5, free + 2: both}
    return sum(
        share * (float(f_distribution.sf(statistic / count, count, degrees)) if count else float(statistic <= 0.0))
        for count, share in shares.items()
    )
