"""Mean and standard deviation of what is learned as a coordinate: a value, or the logarithm of one above zero."""

from __future__ import annotations

import math

WIDEST = 4.0
"""Variance of a logarithm that is believed at most: beyond, a Gaussian says nothing of the tail that makes the mean."""


def moments_of(coordinate: float, variance: float, positive: bool) -> tuple[float, float]:
    """Return the mean and the standard deviation of a value whose coordinate is a Gaussian, both in its unit.

    Args:
        coordinate: mean of the Gaussian.
        variance: of it.
        positive: whether the coordinate is the value's logarithm, so that the value is log-normal.
    """
    if not positive:
        return coordinate, math.sqrt(variance)
    variance = min(variance, WIDEST)
    mean = math.exp(coordinate + 0.5 * variance)
    return mean, mean * math.sqrt(math.expm1(variance))
