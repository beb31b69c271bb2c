"""Kalman smoother for noisy, unevenly sampled positions: poses are smoothed, never differenced.

Each coordinate is a position whose acceleration is white noise of density q (the smoother of a cubic spline).
The noise of the samples and q are chosen by maximum likelihood of the innovations, so that a tag of 3 mm and a
joint encoder of 0.1 mm are both read for what they are. Gaps, and times between samples, cost nothing: the
smoother answers at any time with its uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

LOG10_RATIO = (-4.0, 12.0)
"""Bounds of log10(q / noise variance) [1/s^3] for the search."""
START_VARIANCE = (1e4, 1e8)
"""Variance of position and speed [1/s^2] before the first sample, in units of one sample's variance: knows nothing."""


@dataclass(frozen=True)
class Smoothed:
    """A coordinate at the times asked for.

    Attributes:
        position: (n,) mean.
        velocity: (n,) mean.
        covariance: (n, 2, 2) of (position, velocity).
        noise: standard deviation of one sample.
        density: q, spectral density of the acceleration.
    """

    position: Array
    velocity: Array
    covariance: Array
    noise: float
    density: float


@numba.njit(cache=True)
def _smooth(
    time: Array, value: Array, noise_variance: float, density: float, start: Array, mean: Array, covariance: Array
) -> tuple[float, float, int]:
    """Filter forward and smooth back (Rauch-Tung-Striebel); NaN values are times asked for.

    Returns (sum of squared normalised innovations, sum of their log variances, how many).
    """
    n = time.shape[0]
    x, v = start[0], 0.0
    a, b, c = start[1], 0.0, start[2]  # covariance [[a, b], [b, c]]
    before_mean = np.empty((n, 2))
    before = np.empty((n, 3))
    after = np.empty((n, 3))
    squares, logs, count = 0.0, 0.0, 0
    for k in range(n):
        if k > 0:
            h = time[k] - time[k - 1]
            x += h * v
            a, b, c = (
                a + 2 * h * b + h * h * c + density * h**3 / 3,
                b + h * c + density * h * h / 2,
                c + density * h,
            )
        before_mean[k, 0], before_mean[k, 1] = x, v
        before[k, 0], before[k, 1], before[k, 2] = a, b, c
        if not math.isnan(value[k]):
            variance = a + noise_variance
            innovation = value[k] - x
            gain_x, gain_v = a / variance, b / variance
            x += gain_x * innovation
            v += gain_v * innovation
            # Written so that it stays positive: c before b before a.
            c -= gain_v * b
            b *= noise_variance / variance
            a *= noise_variance / variance
            if count >= 2:  # the first two only place the line
                squares += innovation * innovation / variance
                logs += math.log(variance)
            count += 1
        mean[k, 0], mean[k, 1] = x, v
        after[k, 0], after[k, 1], after[k, 2] = a, b, c
    covariance[n - 1, 0, 0], covariance[n - 1, 0, 1] = a, b
    covariance[n - 1, 1, 0], covariance[n - 1, 1, 1] = b, c
    for k in range(n - 2, -1, -1):
        h = time[k + 1] - time[k]
        a, b, c = after[k, 0], after[k, 1], after[k, 2]
        p, r, s = before[k + 1, 0], before[k + 1, 1], before[k + 1, 2]
        determinant = p * s - r * r
        if determinant <= 0.0 or h == 0.0:
            if h == 0.0:
                mean[k] = mean[k + 1]
            covariance[k] = covariance[k + 1]
            continue
        # gain = after F^T before^-1 with F = [[1, h], [0, 1]]
        m00, m01, m10, m11 = a + h * b, b, b + h * c, c
        g00 = (m00 * s - m01 * r) / determinant
        g01 = (m01 * p - m00 * r) / determinant
        g10 = (m10 * s - m11 * r) / determinant
        g11 = (m11 * p - m10 * r) / determinant
        dx = mean[k + 1, 0] - before_mean[k + 1, 0]
        dv = mean[k + 1, 1] - before_mean[k + 1, 1]
        mean[k, 0] += g00 * dx + g01 * dv
        mean[k, 1] += g10 * dx + g11 * dv
        d0 = covariance[k + 1, 0, 0] - p
        d1 = covariance[k + 1, 0, 1] - r
        d2 = covariance[k + 1, 1, 1] - s
        covariance[k, 0, 0] = a + g00 * g00 * d0 + 2 * g00 * g01 * d1 + g01 * g01 * d2
        off = b + g00 * g10 * d0 + (g00 * g11 + g01 * g10) * d1 + g01 * g11 * d2
        covariance[k, 0, 1] = off
        covariance[k, 1, 0] = off
        covariance[k, 1, 1] = c + g10 * g10 * d0 + 2 * g10 * g11 * d1 + g11 * g11 * d2
    return squares, logs, count


def _noise_and_density(time: Array, value: Array, start: Array, floor: float) -> tuple[float, float]:
    """Return the sample variance and density that make the innovations most likely."""
    mean, covariance = np.empty((len(time), 2)), np.empty((len(time), 2, 2))

    def variance_and_cost(log_ratio: float) -> tuple[float, float]:
        squares, logs, count = _smooth(time, value, 1.0, 10.0**log_ratio, start, mean, covariance)
        used = max(count - 2, 1)
        variance = max(squares / used, floor**2)
        return variance, used * math.log(variance) + logs + squares / variance

    grid = np.linspace(*LOG10_RATIO, 17)
    best = float(grid[int(np.argmin([variance_and_cost(ratio)[1] for ratio in grid]))])
    found = minimize_scalar(lambda r: variance_and_cost(r)[1], bounds=(best - 1.0, best + 1.0), method="bounded")
    variance, _ = variance_and_cost(float(found.x))
    return variance, variance * 10.0 ** float(found.x)


def smooth(time: Array, value: Array, at: Array, *, floor: float = 1e-5) -> Smoothed:
    """Smooth one coordinate.

    Args:
        time: (n,) increasing [s].
        value: (n,) samples [m or rad, unwrapped].
        at: (m,) increasing times wanted [s].
        floor: the noise of one sample is never taken to be smaller.

    Returns:
        Position and velocity at `at`, with their covariance.

    Raises:
        ModelError: fewer than four samples, or one that is not finite.
    """
    time, value, at = (np.asarray(array, dtype=float) for array in (time, value, at))
    if len(time) < 4:
        raise ModelError(f"expected at least 4 poses to smooth, got {len(time)}; record a longer episode")
    if not (np.all(np.isfinite(value)) and np.all(np.isfinite(time))):
        raise ModelError("expected finite poses to smooth, got a NaN or an infinity; cut it out of the recording")
    start = np.array([value[0], *START_VARIANCE])
    variance, density = _noise_and_density(time, value, start, floor)
    start[1:] *= variance  # the search above ran in units of one sample's variance
    times = np.concatenate([time, at])
    order = np.argsort(times, kind="stable")
    values = np.concatenate([value, np.full(len(at), np.nan)])[order]
    mean, covariance = np.empty((len(times), 2)), np.empty((len(times), 2, 2))
    _smooth(times[order], values, variance, density, start, mean, covariance)
    where = np.empty(len(times), dtype=int)
    where[order] = np.arange(len(times))
    rows = where[len(time) :]
    return Smoothed(mean[rows, 0], mean[rows, 1], covariance[rows], math.sqrt(variance), density)
