"""Compiled: series made white that carry sensor noise and a texture that is correlated along the way."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def whitened(series: Array, step: Array, sensor: float, texture: float, length: float, out: Array) -> float:
    """Divide series by the Cholesky factor of their common covariance; return half its log determinant.

    The covariance is sensor^2 on the diagonal plus texture^2 exp(-way / length): a Kalman filter over one state
    (Ornstein-Uhlenbeck) does it in one pass, exactly.

    Args:
        series: (n, k), each column one series.
        step: (n,) way since the row before [rad]; infinite where a new pull begins.
        sensor: standard deviation of white noise.
        texture: standard deviation of what is correlated.
        length: way over which it is [rad].
        out: (n, k) filled with the white series.
    """
    rows, columns = series.shape
    state = np.zeros(columns)
    variance, half = texture * texture, 0.0
    white = sensor * sensor
    for n in range(rows):
        kept = math.exp(-step[n] / length)
        variance = kept * kept * variance + texture * texture * (1.0 - kept * kept)
        total = variance + white
        scale, gain = 1.0 / math.sqrt(total), variance / total
        for k in range(columns):
            state[k] *= kept
            left = series[n, k] - state[k]
            out[n, k] = left * scale
            state[k] += gain * left
        variance *= white / total
        half += 0.5 * math.log(total)
    return half
