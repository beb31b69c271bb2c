"""Fits, evidence and the predictive test, on data drawn from the very model that is fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows, held_out_blocks, inside, touching
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import scene_of
from pbrl_mismatch.search.heldout import held_out_score, noise_floor
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import NUISANCES, Objective, reduce
from pbrl_mismatch.search.predictive import predictive_test

FLOOR = 0.15


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


@pytest.fixture(scope="module")
def free(track: Any) -> Any:
    return baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


def drawn(rng: np.random.Generator, cuts: Any, row: np.ndarray) -> Any:
    """Return the windows with poses drawn from a row, starts and sensor errors from their priors."""
    z = rng.standard_normal((1, len(cuts), NUISANCES))
    told = cuts.told + np.einsum("wkl,pwl->pwk", cuts.root, z[..., :6])
    extra = z[..., None, 6:] * FLOOR * np.array([1.0, 1.0, cuts.track.gyration])
    noise = rng.standard_normal(cuts.pose.shape) / np.where(cuts.weight > 0.0, cuts.weight, 1.0)
    return replace(cuts, pose=poses(row[None], cuts, told, extra)[0] + noise)


def test_the_test_s_p_values_are_uniform_where_the_model_is_right(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(2), cut_windows(track, 2.0).take(np.arange(0, 12, 3))
    values = []
    for _ in range(40):
        u = free.sample_prior(rng, 1)
        objective = Objective(free, drawn(rng, cuts, free.rows(u)[0]), FLOOR)
        values.append(predictive_test(climb(objective, free.mean[None], iterations=4), 0).p_value)
    assert kstest(values, "uniform").pvalue > 0.01, np.sort(values)


def test_the_test_sees_what_is_left_out_whatever_the_noise_is_thought_to_be(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(3), cut_windows(track, 2.0)
    slope = free.with_effect(EFFECTS["floor_slope"], scene_of(track, free.rows(free.mean[None])[0]), 0)
    data = drawn(rng, cuts, slope.rows(np.array([[*free.mean, 0.01, 0.0]]))[0])
    for belief in (0.7, 1.0, 1.4):
        objective = Objective(free, replace(data, weight=data.weight * belief), FLOOR)
        assert predictive_test(climb(objective, free.mean[None], iterations=6), 0).p_value < 1e-6


def test_a_fit_finds_the_truth_within_its_covariance_and_weighs_it_above_the_baseline(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(4), cut_windows(track, 2.0)
    drag = free.with_effect(EFFECTS["viscous_drag"], scene_of(track, free.rows(free.mean[None])[0]), 1)
    truth = np.array([[*free.mean, np.log(12.0)]])
    data = drawn(rng, cuts, drag.rows(truth)[0])
    fit = climb(Objective(drag, data, FLOOR), drag.mean[None], iterations=12)
    off = (fit.coordinates[0] - truth[0]) / np.sqrt(np.diag(fit.covariance(0)))
    assert np.abs(off).max() < 3.5 and bool(fit.settled[0])
    nothing = climb(Objective(free, data, FLOOR), free.mean[None], iterations=12)
    assert fit.evidence[0] > nothing.evidence[0] + 20.0
    clean = drawn(rng, cuts, free.rows(free.mean[None])[0])
    spare = climb(Objective(drag, clean, FLOOR), drag.mean[None], iterations=15)
    assert climb(Objective(free, clean, FLOOR), free.mean[None]).evidence[0] > spare.evidence[0]


def test_evidence_of_a_linear_model_is_its_closed_form(track: Any, free: Any) -> None:
    # A free body is all but linear in a slope: the evidence is that of a Gaussian.
    rng, cuts = np.random.default_rng(5), cut_windows(track, 0.5).take(np.arange(6))
    slope = free.with_effect(EFFECTS["floor_slope"], scene_of(track, free.rows(free.mean[None])[0]), 0)
    slope = replace(slope, parameters=slope.parameters[-2:], base=free.rows(free.mean[None])[0])
    data = drawn(rng, cuts, slope.base)
    # Noise is thought to be larger than it is, so that no window asks for a scale.
    objective = Objective(slope, replace(data, weight=0.5 * data.weight), FLOOR)
    fit = climb(objective, np.zeros((1, 2)), iterations=6)
    linear = objective.linearise(np.zeros((1, 2)), objective.at_rest(1))
    value = 0.0
    joint = np.zeros((linear.residual[0].size, linear.residual[0].size))
    size = linear.residual.shape[2]
    s = linear.slope[0].reshape(-1, 2) * slope.spread
    for w in range(len(cuts)):
        rows = slice(w * size, (w + 1) * size)
        joint[rows, rows] += linear.spread[0, w] @ linear.spread[0, w].T
    joint += np.eye(len(joint)) + s @ s.T
    residual = linear.residual[0].reshape(-1)
    value = -0.5 * residual @ np.linalg.solve(joint, residual) - 0.5 * np.linalg.slogdet(joint)[1]
    np.testing.assert_array_equal(fit.weight, 1.0)
    assert fit.evidence[0] == pytest.approx(value, abs=0.3)


def test_a_window_s_scale_is_its_likeliest_that_is_at_least_one(track: Any, free: Any) -> None:
    objective = Objective(free, cut_windows(track, 1.0).take(np.arange(4)), FLOOR)
    counts = objective.counts
    misfit = counts * np.array([0.3, 1.0, 4.0, 30.0])
    scales = np.exp(np.linspace(0.0, 3.0, 3001))[:, None]
    likelihood = -0.5 * misfit / scales**2 - counts * np.log(scales)
    assert objective.likelihood(misfit[None])[0] == pytest.approx(likelihood.max(axis=0).sum(), rel=1e-6)
    np.testing.assert_allclose(objective.weights(misfit[None])[0] ** -0.5, [1.0, 1.0, 2.0, 30.0**0.5])
    even = replace(objective, even=True)
    common = -0.5 * misfit.sum() / scales**2 - counts.sum() * np.log(scales)
    assert even.likelihood(misfit[None])[0] == pytest.approx(common.max(), rel=1e-6)
    assert np.ptp(even.weights(misfit[None])) == 0.0


def test_a_window_that_nothing_explains_is_as_good_as_left_out(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(7), cut_windows(track, 1.0).take(np.arange(10))
    data = drawn(rng, cuts, free.rows(free.mean[None])[0])
    knocked = data.pose.copy()
    knocked[4, :, 0] += 0.2 * np.linspace(0.0, 1.0, knocked.shape[1]) ** 2
    knock = replace(data, pose=knocked)
    fit, common = (climb(Objective(free, knock, FLOOR, even), free.mean[None]) for even in (False, True))
    without = climb(Objective(free, data.take(np.arange(10) != 4), FLOOR), free.mean[None])
    spread = np.sqrt(np.diag(without.covariance(0)))
    off, dragged = (np.abs((each.coordinates - without.coordinates) / spread).max() for each in (fit, common))
    assert off < 0.5 and dragged > 5.0 * off
    assert fit.weight[0, 4] < 0.1 and np.delete(fit.weight[0], 4).min() > 0.4


def test_elimination_is_the_joint_solution(track: Any, free: Any) -> None:
    cuts = cut_windows(track, 1.0).take(np.arange(3))
    objective = Objective(free, cuts, FLOOR)
    z = objective.at_rest(1)
    linear = objective.linearise(free.mean[None], z)
    reduced = reduce(linear, z)
    matrix, vector = reduced.weighed(np.ones((1, len(cuts))))
    step = np.linalg.solve(matrix[0] + np.eye(3), vector[0])
    size, k = linear.residual.shape[2], 3
    slope = np.zeros((3 * size, k + 3 * NUISANCES))
    for w in range(3):
        slope[w * size : (w + 1) * size, :k] = linear.slope[0, w]
        slope[w * size : (w + 1) * size, k + w * NUISANCES : k + (w + 1) * NUISANCES] = linear.spread[0, w]
    joint = np.linalg.solve(slope.T @ slope + np.eye(slope.shape[1]), slope.T @ linear.residual[0].reshape(-1))
    np.testing.assert_allclose(step, joint[:k], rtol=1e-6)


def test_held_out_windows_are_not_fitted_and_are_predicted_at_the_noise_floor(track: Any, free: Any) -> None:
    blocks = held_out_blocks(track, 4.0, 3)
    longest = cut_windows(track, 4.0)
    out = longest.take(inside(longest, blocks))
    for length in (0.5, 1.0, 2.0):
        cuts = cut_windows(track, length)
        kept = cuts.take(~touching(cuts, blocks))
        for start in out.start:
            assert not np.any((kept.start > start - 0.4 * length) & (kept.start < start + 4.0 - 0.6 * length))
    fit = climb(Objective(free, kept, FLOOR), free.mean[None])
    score = held_out_score(fit, 0, out)
    assert score.rmse_retold < 1.25 * noise_floor(out)[0]
    wrong = climb(Objective(free, kept, FLOOR), free.mean[None] + [[0.6, 0.0, 0.0]], iterations=0)
    worse = held_out_score(wrong, 0, out)
    assert worse.log_score < score.log_score - 10.0
    # A forecast has nothing to hide behind; a start that is fitted to what is predicted hides a wrong mass.
    assert worse.rmse_position / score.rmse_position > max(2.0, worse.rmse_retold / score.rmse_retold)


def test_a_delay_that_nobody_would_believe_is_a_mismatch(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(6), cut_windows(track, 2.0)
    truth = free.mean[None] + [[0.0, 0.0, 0.1]]
    fit = climb(Objective(free, drawn(rng, cuts, free.rows(truth)[0]), FLOOR), free.mean[None], iterations=12)
    assert predictive_test(fit, 0).p_value < 1e-6


def test_what_is_told_roughly_is_a_mismatch_only_to_who_was_told_otherwise(track: Any, free: Any) -> None:
    rng, cuts = np.random.default_rng(7), cut_windows(track, 2.0)
    told = BaselineOptions(20.0, 0.1, 0.1, 0.005, grasp_spread=0.1, outline_spread=0.02)
    rough = baselines(told, ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    assert rough.columns == (*free.columns, "sensor_turn", "com_x", "com_y")
    truth = rough.mean[None] + [[0.0, 0.0, 0.0, 0.12, -0.015, 0.01]]
    data = drawn(rng, cuts, rough.rows(truth)[0])
    known = climb(Objective(rough, data, FLOOR), rough.mean[None], iterations=12)
    off = (known.coordinates[0] - truth[0]) / np.sqrt(np.diag(known.covariance(0)))
    assert np.abs(off).max() < 3.5
    assert predictive_test(known, 0).p_value > 1e-3
    surprised = climb(Objective(free, data, FLOOR), free.mean[None], iterations=12)
    assert predictive_test(surprised, 0).p_value < 1e-6
