"""Importance sampling: evidences with closed forms, errors that are true, and weights that are not to be trusted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.arviz_import import az
from pbrl_model.errors import ModelError
from pbrl_model.inference.importance import Defence, effective, flattened, importance_sample, population
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.pareto import pareto_shape
from pbrl_model.inference.problem import Domain

Array = NDArray[np.float64]

PLANE = Domain.unbounded(2)


def start(mean: float = 0.0, width: float = 1.0, domain: Domain = PLANE) -> Mixture:
    return Mixture.around(np.full((1, 2), mean), width**2 * np.eye(2)[None], np.ones(1), domain)


def gaussian(points: Array) -> Array:
    return -0.5 * np.sum((points - 3.0) ** 2, axis=1) / 0.01


def test_the_mixture_creeps_up_to_a_density_it_did_not_know() -> None:
    found = importance_sample(np.random.default_rng(0), gaussian, start(), rounds=12)
    assert found.log_evidence == pytest.approx(math.log(2 * math.pi * 0.01), abs=5 * found.log_evidence_sd)
    assert found.ess > 0.5 * found.proposals
    assert found.pareto_k < 0.7


def test_the_claimed_error_is_the_error() -> None:
    truth = math.log(2 * math.pi * 0.01)
    one_guess = start(3.1, 0.15)
    found = [population(np.random.default_rng(seed), gaussian, one_guess, 500) for seed in range(200)]
    scores = np.array([(each.log_evidence - truth) / each.log_evidence_sd for each in found])
    assert abs(scores.mean()) < 0.35
    assert 0.8 < scores.std() < 1.25


def test_a_target_cut_by_bounds_costs_no_calls_outside() -> None:
    domain = Domain(np.array([[0.0, 0.0], [np.inf, np.inf]]), np.zeros(2, dtype=bool))
    seen: list[Array] = []

    def density(points: Array) -> Array:
        seen.append(points)
        return -0.5 * np.sum(points**2, axis=1)

    found = importance_sample(np.random.default_rng(0), density, start(domain=domain), rounds=2)
    assert np.concatenate(seen).min() >= 0.0
    assert found.calls == sum(map(len, seen)) < 6000
    assert found.log_evidence == pytest.approx(math.log(math.pi / 2), abs=5 * found.log_evidence_sd)


def test_a_prior_as_defence_bounds_the_weights() -> None:
    defence = Defence(lambda rng, n: rng.normal(0, 5, (n, 2)), lambda p: -np.sum(p**2, 1) / 50 - math.log(50 * math.pi))
    broad = defence.log_density  # data that say nothing: the posterior is the prior
    alone = population(np.random.default_rng(0), broad, start(0.0, 0.3), 4000)
    defended = population(np.random.default_rng(0), broad, start(0.0, 0.3), 4000, defence)
    assert np.exp(defended.log_weights.max()) <= 1.0 / defence.share * 1.0001
    assert defended.log_evidence == pytest.approx(0.0, abs=5 * defended.log_evidence_sd)
    assert alone.pareto_k > defended.pareto_k


def test_a_mixture_that_misses_the_target_is_told() -> None:
    heavy = population(np.random.default_rng(0), lambda p: -2.0 * np.sum(np.log1p(p**2), 1), start(0.0, 0.05), 4000)
    assert heavy.pareto_k > 0.7
    nothing = population(np.random.default_rng(0), lambda p: np.full(len(p), -np.inf), start(), 100)
    assert nothing.log_evidence == -math.inf
    assert nothing.log_evidence_sd == math.inf
    assert nothing.ess == 0.0
    assert nothing.pareto_k == math.inf


def test_resampled_draws_have_the_posteriors_moments() -> None:
    found = importance_sample(np.random.default_rng(0), gaussian, start(2.8, 0.3))
    draws = found.resampled(np.random.default_rng(1), 4000)
    assert draws.mean(0) == pytest.approx([3.0, 3.0], abs=0.02)
    assert draws.std(0) == pytest.approx([0.1, 0.1], rel=0.1)
    assert abs(np.corrcoef(draws[:-1, 0], draws[1:, 0])[0, 1]) < 0.06  # in random order


def test_nan_counts_as_zero_and_infinity_is_an_error() -> None:
    half = population(np.random.default_rng(0), lambda p: np.where(p[:, 0] > 0, 0.0, np.nan), start(), 400)
    assert np.all(half.samples[:, 0] > 0)
    with pytest.raises(ModelError, match="below infinity"):
        population(np.random.default_rng(0), lambda p: np.full(len(p), np.inf), start(), 100)


def test_flattening_keeps_as_many_as_are_wanted() -> None:
    weights = np.linspace(0, 1000, 500)
    assert effective(flattened(weights, 50)) == pytest.approx(50, rel=1e-3)
    assert flattened(weights, 1.0) is weights


@pytest.mark.parametrize("shape", [0.1, 0.5, 0.9, 1.5])
@pytest.mark.parametrize("n", [60, 1000, 5000])
def test_pareto_k_is_arvizs(shape: float, n: int) -> None:
    log_weights = shape * np.random.default_rng(n).exponential(size=n) - 700.0
    assert pareto_shape(log_weights) == pytest.approx(float(az().psislw(log_weights)[1]), abs=1e-9)


def test_pareto_k_may_answer_that_it_cannot_tell() -> None:
    assert pareto_shape(np.zeros(5)) == math.inf
    assert pareto_shape(np.zeros(500)) == -math.inf
    assert pareto_shape(np.r_[0.0, np.full(500, -2000.0)]) == math.inf
