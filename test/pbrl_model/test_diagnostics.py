"""Diagnostics: right where the answer is known, NaN where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.diagnostics import Convergence, convergence, effective_sample_size, split_rhat
from pbrl_model.parameters import free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.symmetry import equivalent_wheels


def autoregressive(rho: float, chains: int, n: int, seed: int = 0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    x = np.empty((chains, n))
    x[:, 0] = rng.standard_normal(chains)
    for k in range(1, n):
        x[:, k] = rho * x[:, k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(chains)
    return x


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_effective_samples_of_an_autoregression(rho: float) -> None:
    draws = autoregressive(rho, 4, 5000)
    assert effective_sample_size(draws) == pytest.approx(20000 * (1 - rho) / (1 + rho), rel=0.15)
    assert split_rhat(draws) == pytest.approx(1.0, abs=0.01)


def test_chains_in_different_places_have_not_arrived() -> None:
    draws = autoregressive(0.0, 4, 500) + np.arange(4)[:, None]
    assert split_rhat(draws) > 1.5


def test_nan_rather_than_invention() -> None:
    moving = autoregressive(0.0, 2, 100)
    assert np.isnan(effective_sample_size(moving[:, :7]))
    assert np.isnan(effective_sample_size(np.ones((2, 100))))
    assert np.isnan(effective_sample_size(np.stack([moving[0], np.ones(100)])))
    assert np.isnan(effective_sample_size(np.where(moving > 2, np.nan, moving)))
    assert np.isnan(split_rhat(moving[:1]))
    assert np.isfinite(effective_sample_size(moving[0]))
    assert Convergence(float("nan"), 1.0).arrived is None
    assert Convergence(500.0, 1.001).arrived and not Convergence(500.0, 1.2).arrived


def test_chains_in_equivalent_descriptions_of_one_wheel_agree() -> None:
    rng = np.random.default_rng(0)
    draws = rng.normal([20.0, 0.1, 0.1, 1.57, 0.05, 0.3], [1.0, 0.01, 0.01, 0.05, 0.005, 0.02], (4, 300, 6))
    names = free_columns("wheel")
    mixed = np.stack([equivalent_wheels(draws[chain], names)[chain] for chain in range(4)])
    found = convergence(Posterior("table", "wheel", names, mixed))
    assert set(found) == set(names)
    assert all(value.arrived for value in found.values())
