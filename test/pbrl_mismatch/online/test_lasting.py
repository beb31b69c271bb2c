"""What lasts: its bet pays where no single window does, and is fair under the model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.online.evidence import Noise
from pbrl_mismatch.online.lasting import Belief

KNOWN = Noise(1e9, 1e9)
"""Noise of unit variance, known exactly."""


def belief(*spread: float) -> Belief:
    covariance = np.diag(np.square(spread))
    return Belief(np.zeros(len(spread)), covariance, covariance)


def test_what_two_windows_are_worth_is_what_they_are_worth_together() -> None:
    rng = np.random.default_rng(0)
    slope, residual, at = rng.normal(size=(12, 2)), rng.normal(size=12), np.array([0.3, -0.2])
    begun = belief(0.8, 0.5)
    whole, end = begun.after(residual, slope, at, KNOWN)
    first, between = begun.after(residual[:5], slope[:5], at, KNOWN)
    second, last = between.after(residual[5:], slope[5:], at, KNOWN)
    # Densities are up to a constant of the noise's freedom: that of no window at all.
    nothing, _ = begun.after(residual[:0], slope[:0], at, KNOWN)
    assert first + second - 2.0 * nothing == pytest.approx(whole - nothing, abs=1e-4)
    np.testing.assert_allclose(last.mean, end.mean, atol=1e-9)
    np.testing.assert_allclose(last.covariance, end.covariance, atol=1e-9)


def test_its_ratio_has_a_mean_of_one_under_the_model() -> None:
    rng = np.random.default_rng(1)
    slope = 0.4 * rng.normal(size=(6, 2))
    model, other = belief(0.5, 0.05), belief(0.5, 0.5)
    ratios = []
    for _ in range(20_000):
        drawn = rng.normal(size=2) * [0.5, 0.05]
        residual = slope @ drawn + rng.normal(size=6)
        ratios.append(math.exp(np.subtract(*(b.after(residual, slope, np.zeros(2), KNOWN)[0] for b in (other, model)))))
    assert np.mean(ratios) == pytest.approx(1.0, abs=4.0 * np.std(ratios) / math.sqrt(len(ratios)))


def test_an_offset_of_half_the_noise_is_found_in_many_windows_and_in_none() -> None:
    rng = np.random.default_rng(2)
    model, other, gained = belief(0.02), belief(0.5), []
    for _ in range(100):
        slope = np.ones((4, 1))
        residual = 0.4 + rng.normal(size=4)
        (by_other, other), (by_model, model) = (b.after(residual, slope, np.zeros(1), KNOWN) for b in (other, model))
        gained.append(by_other - by_model)
    assert max(gained) < 6.0 and sum(gained) > 14.0
