"""A test to one side: even where nothing is off, deaf to the other side, and sharper than one to all sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from pbrl_mismatch.search.one_sided import one_sided

SURE = 10**7
"""Degrees of freedom of noise that is as good as known."""


def covariance(correlation: float, count: int) -> np.ndarray:
    """Return (count, count) of numbers of unlike size, of which the third goes along with both others a little."""
    alike = np.eye(count)
    alike[0, 1] = alike[1, 0] = correlation
    alike[2:, :2] = alike[:2, 2:] = 0.15
    spread = np.array([2e-4, 1e-3, 0.01, 3.0])[:count]
    return alike * np.outer(spread, spread)


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("correlation", [-0.85, 0.0, 0.6])
@pytest.mark.parametrize("degrees", [9, 80])
def test_chances_are_even_where_nothing_is_off(count: int, correlation: float, degrees: int) -> None:
    rng, wide = np.random.default_rng(count), covariance(correlation, count)
    drawn = rng.multivariate_normal(np.zeros(count), wide, 1500)
    noise = rng.chisquare(degrees, 1500) / degrees
    values = [one_sided(each, wide * size, degrees) for each, size in zip(drawn, noise, strict=True)]
    assert kstest(values, "uniform").pvalue > 0.01


def test_what_is_off_to_the_other_side_is_no_more_than_chance() -> None:
    wide = covariance(0.0, 3)
    wide[2, :2] = wide[:2, 2] = 0.0
    assert one_sided(np.array([-2e-3, -1e-2, 0.0]), wide, SURE) == pytest.approx(1.0)
    far = np.array([-2e-3, 1e-2, 0.0])
    without = one_sided(far * [0.0, 1.0, 1.0], wide, SURE)
    assert without < 1e-6
    assert one_sided(far, wide, SURE) == pytest.approx(without, rel=1e-6)


def test_it_is_sharper_than_one_to_all_sides_and_units_do_not_matter() -> None:
    rng, wide = np.random.default_rng(0), covariance(-0.5, 3)
    scale = np.array([1e3, 5.0, 0.2])
    for _ in range(50):
        far = np.abs(rng.standard_normal(3)) * np.sqrt(np.diag(wide)) * 2.0
        value = one_sided(far, wide, SURE)
        assert value < chi2.sf(far @ np.linalg.solve(wide, far), 3)
        assert one_sided(scale * far, wide * np.outer(scale, scale), SURE) == pytest.approx(value, rel=1e-6)
