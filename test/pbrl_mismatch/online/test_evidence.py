"""The evidence of a window is an e-value, whatever the noise; what was foretold is learned as least squares would."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.online.evidence import Noise, Window, adjusted, grown, log_e_value, no_sharper
from pbrl_mismatch.online.options import MonitorOptions

FORCES = (1.0, 3.0, 10.0)


def window(rng: np.random.Generator, scale: float, wrench: float = 0.0, numbers: int = 30) -> Window:
    """A window of independent numbers, three directions of which a wrench would move."""
    strength = np.array([0.6, 0.3, 0.1])
    left = np.linalg.qr(rng.normal(size=(numbers, 3)))[0]
    residual = scale * rng.normal(size=numbers) + wrench * left @ strength
    return Window(residual, np.zeros((numbers, 2)), strength, left.T @ residual)


def test_its_mean_is_one_under_the_model() -> None:
    rng = np.random.default_rng(0)
    noise = Noise(40.0, 40.0)
    weak = (0.5, 1.0)  # with larger ones the mean is one, too, but of values so rare that no sample has them
    values = [
        math.exp(log_e_value(window(rng, math.sqrt(noise.squares / rng.chisquare(noise.freedom))), noise, weak))
        for _ in range(8_000)
    ]
    assert np.mean(values) == pytest.approx(1.0, abs=4.0 * np.std(values) / math.sqrt(len(values)))


def test_it_depends_on_the_noise_only_through_what_is_known_of_it() -> None:
    one, large = (window(np.random.default_rng(1), scale) for scale in (1.0, 7.0))
    known = log_e_value(one, Noise(100.0, 100.0), FORCES)
    scaled = log_e_value(large, Noise(100.0, 100.0 * 49.0), FORCES)
    assert known == pytest.approx(scaled)


def test_it_grows_with_the_wrench_and_without_one_it_falls() -> None:
    values = [
        np.mean([log_e_value(window(np.random.default_rng(k), 1.0, w), Noise(400.0, 400.0), FORCES) for k in range(50)])
        for w in (0.0, 10.0, 20.0, 40.0)
    ]
    assert values[0] < 0.0 and np.all(np.diff(values) > 0.0) and values[-1] > 100.0


def test_windows_tell_the_scale_of_the_noise() -> None:
    rng, noise = np.random.default_rng(2), Noise()
    for _ in range(60):
        noise = noise.with_window(window(rng, 1.7, wrench=30.0))
    assert noise.scale == pytest.approx(1.7, rel=0.1)
    assert noise.freedom <= 400.0 + 1e-9


def test_adjusting_window_by_window_is_least_squares_over_all() -> None:
    rng = np.random.default_rng(3)
    prior, truth = np.diag([0.5, 2.0]), np.array([0.4, -1.0])
    mean, covariance = np.zeros(2), prior.copy()
    slopes, data = rng.normal(size=(4, 6, 2)), []
    for slope in slopes:
        seen = slope @ truth + 0.1 * rng.normal(size=6)
        data.append(seen)
        lower = np.linalg.cholesky(np.eye(6) + slope @ covariance @ slope.T)
        whitened = np.linalg.solve(lower, seen - slope @ mean), np.linalg.solve(lower, slope)
        mean, covariance = adjusted(*whitened, mean, covariance)
    rows = slopes.reshape(-1, 2)
    precision = np.linalg.inv(prior) + rows.T @ rows
    np.testing.assert_allclose(mean, np.linalg.solve(precision, rows.T @ np.concatenate(data)), atol=1e-10)
    np.testing.assert_allclose(covariance, np.linalg.inv(precision), atol=1e-10)


def test_however_much_is_heard_something_of_the_first_spread_is_kept() -> None:
    rng = np.random.default_rng(5)
    root, turn = rng.normal(size=(4, 4)), np.linalg.qr(rng.normal(size=(4, 4)))[0]
    first, shares = root @ root.T, np.array([0.01, 0.1, 0.5, 1.0])
    basis = root @ turn
    kept = no_sharper((basis * shares**2) @ basis.T, first, 0.3)
    np.testing.assert_allclose(kept, (basis * np.maximum(shares, 0.3) ** 2) @ basis.T, atol=1e-9)
    change = rng.normal(size=(4, 4))  # other coordinates say the same
    other = no_sharper(change @ (basis * shares**2) @ basis.T @ change.T, change @ first @ change.T, 0.3)
    np.testing.assert_allclose(other, change @ kept @ change.T, atol=1e-8)


def test_the_sum_over_beginnings_keeps_its_promise() -> None:
    """R reaches c in n windows with a chance of at most n / c, for e-values of mean one (Doob)."""
    rng, level, count, streams = np.random.default_rng(4), 200.0, 20, 4000
    alarms = 0
    for values in rng.normal(-0.5 * 1.5**2, 1.5, (streams, count)):
        statistic, highest = -np.inf, -np.inf
        for value in values:
            statistic = grown(statistic, value)
            highest = max(highest, statistic)
        alarms += highest >= math.log(level)
    assert 0.2 * count / level < alarms / streams < count / level


def test_the_grids_share_the_promise() -> None:
    options = MonitorOptions(false_alarm=0.02, horizon=600.0, windows=(1.0, 2.0), hop=0.5)
    windows = sum(options.horizon / length for length, _ in options.grids)
    assert len(options.grids) == 6 and windows == 2 * 600.0 + 4 * 300.0
    windows += 300.0  # and what lasts
    assert windows / math.exp(options.threshold) == pytest.approx(0.02)
