"""The Kalman smoother: against the same posterior by dense linear algebra, and calibrated."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.sensing.smoothing import START_VARIANCE, smooth


def dense(time: np.ndarray, value: np.ndarray, at: np.ndarray, noise: float, density: float) -> tuple[np.ndarray, ...]:
    """Posterior of position and velocity of an integrated Wiener process, by Gaussian conditioning."""
    origin = min(time[0], at[0])

    def covariance(a: np.ndarray, b: np.ndarray, da: int, db: int) -> np.ndarray:
        a, b = a[:, None] - origin, b[None, :] - origin
        low = np.minimum(a, b)
        position, speed = np.array(START_VARIANCE) * noise**2
        if (da, db) == (0, 0):
            return position + speed * a * b + density * (a * b * low - (a + b) * low**2 / 2 + low**3 / 3)
        if (da, db) == (1, 1):
            return speed + density * low
        if (da, db) == (0, 1):
            return speed * a + density * (a * low - low**2 / 2)
        return covariance(b[0] + origin, a[:, 0] + origin, 0, 1).T

    gram = covariance(time, time, 0, 0) + noise**2 * np.eye(len(time))
    answer = []
    for kind in (0, 1):
        cross = covariance(at, time, kind, 0)
        weight = np.linalg.solve(gram, cross.T).T
        mean = weight @ (value - value[0]) + (value[0] if kind == 0 else 0.0)
        answer += [mean, np.diag(covariance(at, at, kind, kind) - weight @ cross.T)]
    return tuple(answer)


@pytest.fixture
def signal() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.03, 0.1, 60))
    time = time[(time < 1.0) | (time > 1.6)]  # a gap
    truth = 0.3 * np.sin(time)
    return time, truth + 0.003 * rng.normal(size=len(time)), truth


def test_smoother_is_gaussian_conditioning(signal: tuple[np.ndarray, ...]) -> None:
    time, value, _ = signal
    at = np.linspace(time[0], time[-1], 40)
    found = smooth(time, value, at)
    mean, variance, speed, speed_variance = dense(time, value, at, found.noise, found.density)
    np.testing.assert_allclose(found.position, mean, atol=1e-6)
    np.testing.assert_allclose(found.velocity, speed, atol=1e-5)
    np.testing.assert_allclose(found.covariance[:, 0, 0], variance, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(found.covariance[:, 1, 1], speed_variance, rtol=1e-3, atol=1e-12)


def test_smoother_knows_its_noise_and_its_error() -> None:
    scores, noises = [], []
    time = np.arange(0, 12, 1 / 15)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        truth = 0.4 * np.sin(0.8 * time + seed)
        found = smooth(time, truth + 0.003 * rng.normal(size=len(time)), time)
        noises.append(found.noise)
        scores.append((found.position - truth) / np.sqrt(found.covariance[:, 0, 0]))
    assert np.median(noises) == pytest.approx(0.003, rel=0.1)
    assert 0.7 < np.std(scores) < 1.3


def test_a_straight_line_comes_back() -> None:
    time = np.linspace(0, 4, 40)
    found = smooth(time, 2.0 - 0.3 * time, np.array([0.5, 2.0, 3.7]))
    np.testing.assert_allclose(found.position, 2.0 - 0.3 * np.array([0.5, 2.0, 3.7]), atol=1e-6)
    np.testing.assert_allclose(found.velocity, -0.3, atol=1e-4)


def test_uncertainty_grows_in_a_gap(signal: tuple[np.ndarray, ...]) -> None:
    time, value, _ = signal
    found = smooth(time, value, np.array([0.7, 1.3, 2.0]))
    assert found.covariance[1, 0, 0] > 2 * max(found.covariance[0, 0, 0], found.covariance[2, 0, 0])


@pytest.mark.parametrize(
    ("time", "value", "message"),
    [
        (np.arange(3.0), np.zeros(3), "at least 4 poses"),
        (np.arange(5.0), np.array([0, 1, np.nan, 3, 4]), "finite"),
        (np.arange(5.0), np.array([0, 1, np.inf, 3, 4]), "finite"),
    ],
)
def test_what_cannot_be_smoothed_is_refused(time: np.ndarray, value: np.ndarray, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        smooth(time, value, time)
