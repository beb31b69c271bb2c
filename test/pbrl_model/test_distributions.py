"""Distributions: densities integrate to one, samples follow them and lie in the support."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from pbrl_model.distributions import Distribution, LogNormal, TruncatedNormal, Uniform, VonMises
from pbrl_model.errors import ModelError

ALL: list[Distribution] = [
    LogNormal(20.0, 0.5),
    LogNormal(0.3, 1.5),
    TruncatedNormal(0.2, 0.4, 0.0, 1.0),
    TruncatedNormal(0.0, 5.0, -0.1, 0.4),
    TruncatedNormal(9.0, 1.0, 0.0, 1.0),
    TruncatedNormal(-9.0, 1.0, 0.0, 1.0),
    TruncatedNormal(0.5, 1e-3, 0.0, 1.0),
    VonMises(0.0, 0.0),
    VonMises(3.0, 4.0),
    VonMises(-1.0, 2000.0),
    Uniform(-2.0, 3.0),
]


def density(part: Distribution, x: float) -> float:
    return float(np.exp(part.log_prob(x)))


def integral(part: Distribution, low: float, high: float) -> float:
    """Integrate in pieces that see narrow peaks; the middle 1 - 1e-10 of the samples is where they are."""
    if high == np.inf:
        return quad(lambda u: density(part, np.exp(u)) * np.exp(u), -60.0, np.log(1e30), limit=500, points=[0.0, 3.0])[
            0
        ]
    marks = np.quantile(part.sample(np.random.default_rng(0), 2000), [0.0, 0.25, 0.5, 0.75, 1.0])
    edges = np.unique([low, *np.clip(marks, low, high), high])
    return sum(quad(lambda x: density(part, x), a, b, limit=500)[0] for a, b in pairwise(edges))


@pytest.mark.parametrize("part", ALL, ids=str)
def test_density_integrates_to_one(part: Distribution) -> None:
    assert integral(part, *part.bounds) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("part", ALL, ids=str)
def test_samples_lie_in_the_support_and_follow_the_density(part: Distribution) -> None:
    x = part.sample(np.random.default_rng(1), 4000)
    low, high = part.bounds
    assert x.shape == (4000,) and np.all((x >= low) & (x <= high)) and np.isfinite(part.log_prob(x)).all()
    # The probability integral transform of the samples is uniform.
    order = np.sort(x)
    inner = order[:: len(order) // 20]
    below = np.array([quad(lambda v: density(part, v), a, b, limit=200)[0] for a, b in pairwise(inner)])
    expected = np.diff(np.searchsorted(order, inner)) / len(order)
    np.testing.assert_allclose(below, expected, atol=0.03)


@pytest.mark.parametrize("part", ALL, ids=str)
def test_same_seed_same_bytes(part: Distribution) -> None:
    one, two = (part.sample(np.random.default_rng(7), 50) for _ in range(2))
    assert one.tobytes() == two.tobytes()


def test_densities_are_those_of_scipy() -> None:
    x = np.linspace(0.01, 0.99, 7)
    cut = stats.truncnorm((0.0 - 0.2) / 0.4, (1.0 - 0.2) / 0.4, 0.2, 0.4)
    np.testing.assert_allclose(TruncatedNormal(0.2, 0.4, 0.0, 1.0).log_prob(x), cut.logpdf(x))
    np.testing.assert_allclose(LogNormal(20.0, 0.5).log_prob(x), stats.lognorm(0.5, scale=20.0).logpdf(x))
    np.testing.assert_allclose(VonMises(3.0, 4.0).log_prob(x), stats.vonmises(4.0, 3.0).logpdf(x))


@pytest.mark.parametrize("part", ALL, ids=str)
def test_outside_and_nan_have_no_density(part: Distribution) -> None:
    assert part.log_prob(np.nan) == -np.inf
    low, high = part.bounds
    if isinstance(part, VonMises):
        np.testing.assert_allclose(part.log_prob(1.0 + 2 * np.pi), part.log_prob(1.0))
        assert part.log_prob(np.inf) == -np.inf
    else:
        np.testing.assert_array_equal(part.log_prob([low - 1e-9, high + 1e-9, -np.inf, np.inf]), -np.inf)


BAD = [
    lambda: LogNormal(0.0, 1.0),
    lambda: LogNormal(1.0, -1.0),
    lambda: LogNormal(float("nan"), 1.0),
    lambda: TruncatedNormal(0.0, 0.0, 0.0, 1.0),
    lambda: TruncatedNormal(0.0, 1.0, 1.0, 1.0),
    lambda: TruncatedNormal(float("nan"), 1.0, 0.0, 1.0),
    lambda: VonMises(0.0, -1.0),
    lambda: VonMises(float("inf"), 1.0),
    lambda: Uniform(0.0, float("inf")),
]


@pytest.mark.parametrize("make", BAD)
def test_impossible_settings_are_refused(make: object) -> None:
    with pytest.raises(ModelError, match="expected"):
        make()  # type: ignore[operator]
