"""Power of the likelihood-ratio test: how far a model has to be off to be noticed.

With noise of unit variance and a misfit of squared length lambda outside of what the model's own parameters can take
up, twice the gain in log likelihood of K more parameters follows a noncentral chi-square distribution with K degrees
of freedom and noncentrality lambda (Wald 1943).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from pbrl_mismatch.errors import MismatchError

Array = NDArray[np.float64]

MOST = 1e4
"""Beyond this noncentrality everything is noticed."""


def power(noncentrality: Array, parameters: int, level: float) -> Array:
    """Return the chance that an effect is noticed at a level.

    Args:
        noncentrality: lambda, any shape.
        parameters: K of the effect.
        level: of false alarms.
    """
    limit = chi2.isf(level, parameters)
    bounded = np.clip(np.nan_to_num(noncentrality, posinf=MOST), 0.0, MOST)
    return np.where(bounded > 1e-12, ncx2.sf(limit, parameters, np.maximum(bounded, 1e-12)), level)


def needed(parameters: int, level: float, wanted: float) -> float:
    """Return the noncentrality at which the power is as wanted.

    Raises:
        MismatchError: the power wanted is not between the level and one.
    """
    if not 0.0 < level < wanted < 1.0:
        raise MismatchError(f"power: expected 0 < level < power < 1, got level {level} and power {wanted}")
    return float(brentq(lambda value: float(power(np.array(value), parameters, level)) - wanted, 0.0, 1e3))
