"""Importance sampling and chains tell the same; the evidence is the integral; what did not converge says so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from pbrl_model.fitting import sampling
from pbrl_model.fitting.calibration import TABLE, empty_windows, options_for, with_poses
from pbrl_model.fitting.fit import target_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.polish import Modes
from pbrl_model.fitting.sampling import chains, sampled, weighted
from pbrl_model.fitting.starts import SearchPlan, find_modes
from pbrl_model.fitting.target import Target
from pbrl_model.geometry import mass_properties
from pbrl_model.symmetry import canonical_wheel


def drawn(model_class: str, truth: list[float], seed: int = 0) -> tuple[Target, Modes]:
    rng = np.random.default_rng(seed)
    body = mass_properties(TABLE.footprint)
    windows = empty_windows(rng, model_class)
    target = target_of(TABLE, WindowedLikelihood(body, windows), options_for(model_class))
    position = np.array([*truth, 0.01, 0.0, 0.1])
    target = target.over(WindowedLikelihood(body, with_poses(rng, target, position)))
    modes = find_modes(rng, target, (), SearchPlan(draws=200, keep=(4,), lengths=(), iterations=(10,)))
    return target, modes


FREE = drawn("free", [25.0])
WHEEL = drawn("wheel", [25.0, 0.2, -0.1, 0.4, 0.05, 0.3])


def test_evidence_is_the_integral_over_positions() -> None:
    # Another proposal, in other coordinates: a multivariate t over positions themselves.
    target, modes = FREE
    found = weighted(np.random.default_rng(1), target, modes, draws=1000)
    draws = found.position[0]
    proposal = multivariate_t(draws.mean(axis=0), 2.0 * np.cov(draws.T), df=5)
    points = proposal.rvs(3000, random_state=np.random.default_rng(2))
    log_weights = target.full_log_density(points) - proposal.logpdf(points)
    wanted = logsumexp(log_weights) - np.log(len(points))
    assert found.log_evidence == pytest.approx(wanted, abs=5.0 * found.log_evidence_sd)


def test_evidence_does_not_depend_on_the_seed() -> None:
    target, modes = WHEEL
    found = [weighted(np.random.default_rng(seed), target, modes, draws=600) for seed in (1, 2)]
    error = np.hypot(*(each.log_evidence_sd for each in found))
    assert found[0].log_evidence == pytest.approx(found[1].log_evidence, abs=4.0 * error)
    assert all(each.ess > 100 and each.pareto_k < 0.7 for each in found)


def test_chains_and_weights_tell_the_same() -> None:
    target, modes = WHEEL
    rng = np.random.default_rng(3)
    some = weighted(rng, target, modes, draws=1000).position[0]
    run = chains(rng, target, modes, count=8, burn_in=400, draws=150, thin=4).position
    both = [canonical_wheel(rows[:, :6], target.names) for rows in (some, run.reshape(-1, target.dimension))]
    for column in range(6):
        if target.names[column] == "wheel_theta":
            continue
        one, other = (rows[:, column] for rows in both)
        # Chains of 1200 draws hold some 60 independent ones.
        assert one.mean() == pytest.approx(other.mean(), abs=4.0 * one.std() / np.sqrt(60.0))
        assert one.std() == pytest.approx(other.std(), rel=0.4)


def test_every_description_of_a_wheel_is_drawn() -> None:
    target, modes = WHEEL
    draws = weighted(np.random.default_rng(4), target, modes, draws=600).position[0]
    swapped = np.mean(draws[:, 4] > draws[:, 5])
    turned = np.mean(np.cos(draws[:, 3] - 0.4) > 0.0)
    assert 0.4 < swapped < 0.6 and 0.4 < turned < 0.6


def test_same_seed_same_bytes() -> None:
    target, modes = WHEEL
    first, second = (weighted(np.random.default_rng(5), target, modes, draws=500) for _ in range(2))
    assert first.position.tobytes() == second.position.tobytes() and first.log_evidence == second.log_evidence


def test_an_evidence_that_does_not_converge_is_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "ENOUGH", 1e9)
    monkeypatch.setattr(sampling, "ATTEMPTS", 1)
    found = weighted(np.random.default_rng(6), *FREE, draws=500)
    assert np.isnan(found.log_evidence) and np.isnan(found.log_evidence_sd)
    (note,) = found.notes
    assert "did not converge" in note and "chains" not in note
    stand_in = sampled(np.random.default_rng(6), *FREE, draws=10, count=4, burn_in=20, thin=1)
    assert stand_in.position.shape[:2] == (4, 3) and stand_in.notes[0].endswith("those of Metropolis chains")
