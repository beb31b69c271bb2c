"""Posteriors and evidences whose closed forms are known, and problems of which it must be said that they are not."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import norm

sys.path.insert(0, str(Path(__file__).parent))

from closed_forms import Residuals, linear

from pbrl_model.errors import ModelError
from pbrl_model.inference.infer import Inference, InferenceOptions, infer
from pbrl_model.inference.modes import SearchOptions

Array = NDArray[np.float64]
SMOOTH = replace(InferenceOptions(), search=SearchOptions(screen=128, starts=16, shares=(1.0,), iterations=15))
EFFORTS = {"default": InferenceOptions(), "smooth": SMOOTH, "modest": InferenceOptions.modest()}


def run(problem: Residuals, options: InferenceOptions = SMOOTH, seed: int = 0) -> Inference:
    return infer(np.random.default_rng(seed), problem, options)


def assert_evidence(found: Inference, truth: float, slack: float = 0.0) -> None:
    assert found.converged, found.notes
    assert abs(found.log_evidence - truth) < 5.0 * found.log_evidence_sd + 0.01 + slack
    assert found.log_evidence_sd < 0.15


def quadrature(problem: Residuals, nodes: int = 2001) -> float:
    """Return the log evidence of a problem in one or two bounded dimensions, the second with fewer nodes."""
    counts = (nodes, 401)
    axes = [np.linspace(low, high, count) for (low, high), count in zip(problem.bounds.T, counts, strict=False)]
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], -1)
    values = problem.log_prior(grid) + problem.log_likelihood(grid)
    cell = math.prod(float(axis[1] - axis[0]) for axis in axes)
    top = values.max()
    return float(top + np.log(np.sum(np.exp(values - top))) + np.log(cell))


@pytest.mark.parametrize("effort", EFFORTS)
@pytest.mark.parametrize("seed", [0, 1])
def test_linear_gaussian(effort: str, seed: int) -> None:
    problem, evidence, mean, covariance = linear(seed=seed)
    found = run(problem, EFFORTS[effort], seed)
    assert_evidence(found, evidence)
    assert found.shares == pytest.approx([1.0])
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(found.draws.mean(0) - mean) < 5 * sd / math.sqrt(min(found.ess, len(found.draws))))
    assert found.draws.std(0) == pytest.approx(sd, rel=0.25)


def test_two_modes_of_known_shares() -> None:
    problem = Residuals(
        lambda t: np.stack([(t[:, 0] ** 2 - 1.0) / 0.02, (t[:, 1] - 0.5 * t[:, 0]) / 0.05, (t[:, 0] - 3.0) / 5.0], -1),
        (-2.0, -2.0),
        (2.0, 2.0),
    )
    found = run(problem)
    assert_evidence(found, quadrature(problem))
    left, right = -0.5 * 16 / 25, -0.5 * 4 / 25  # the modes differ by the third residual alone
    share = 1 / (1 + math.exp(left - right))
    assert len(found.modes) == 2
    assert found.shares[np.argmax(found.modes[:, 0])] == pytest.approx(share, abs=0.03)


def test_an_image_is_a_mode_of_its_own_even_where_only_one_was_climbed() -> None:
    def whitened(t: Array) -> Array:
        return np.stack([(t[:, 0] * t[:, 1] - 2.0) / 0.01, (t[:, 0] ** 2 - 4.0) / 0.01], -1)

    problem = Residuals(whitened, (-9.0, -9.0), (9.0, 9.0), mirrored=True)
    found = run(problem, replace(SMOOTH, search=replace(SMOOTH.search, screen=4, starts=4, hits=1)))
    assert np.sort(found.modes[:, 0]) == pytest.approx([-2.0, 2.0], abs=0.01)
    assert found.shares == pytest.approx([0.5, 0.5], abs=0.03)


@pytest.mark.parametrize("effort", EFFORTS)
def test_half_a_normal_at_a_bound(effort: str) -> None:
    problem = Residuals(lambda t: (t + 0.05) / np.array([0.1, 0.2]), (0.0, 0.0), (1.0, 1.0))
    mass = [ndtr((1.05) / s) - ndtr(0.05 / s) for s in (0.1, 0.2)]
    evidence = sum(math.log(s * math.sqrt(2 * math.pi) * m) for s, m in zip((0.1, 0.2), mass, strict=True))
    found = run(problem, EFFORTS[effort])
    assert_evidence(found, evidence)
    assert found.draws.min() >= 0.0
    a = 0.5
    expected = -0.05 + 0.1 * norm.pdf(a) / norm.sf(a)
    assert found.draws[:, 0].mean() == pytest.approx(expected, rel=0.12)


@pytest.mark.parametrize("dimension", [1, 3, 6])
def test_data_that_say_nothing_leave_the_prior(dimension: int) -> None:
    problem = Residuals(lambda t: 1e-3 * t[:, :1], (-1.0,) * dimension, (1.0,) * dimension)
    found = run(problem)
    assert_evidence(found, 0.0)
    assert found.ess > 0.3 * len(found.samples)
    assert np.all(np.abs(found.draws.mean(0)) < 0.12)
    assert found.draws.std(0) == pytest.approx(np.full(dimension, 1 / math.sqrt(3)), rel=0.1)


def test_one_direction_known_the_others_left_to_the_prior() -> None:
    problem = Residuals(lambda t: (t.sum(1, keepdims=True) - 0.3) / 0.01, (-1.0,) * 4, (1.0,) * 4)
    found = run(problem)
    draws = np.random.default_rng(1).uniform(-1, 1, (400_000, 3)).sum(1)
    density = np.mean(np.abs(0.3 - draws) < 1.0) / 2.0  # of the sum of four at 0.3
    assert_evidence(found, math.log(0.01 * math.sqrt(2 * math.pi) * density), slack=0.02)


def test_banana() -> None:
    problem = Residuals(lambda t: np.stack([t[:, 0], (t[:, 1] - t[:, 0] ** 2) / 0.3], -1), (-6.0, -5.0), (6.0, 45.0))
    assert_evidence(run(problem), math.log(2 * math.pi * 0.3 / 12.0 / 50.0))


def test_unknown_scale_of_the_noise() -> None:
    y = np.random.default_rng(3).normal(0.4, 3.0, 12)
    problem = Residuals(lambda t: t[:, :1] - y, (-10.0, math.log(0.1)), (10.0, math.log(100.0)), noise=1)
    found = run(problem)
    assert_evidence(found, quadrature(problem))
    assert np.exp(found.draws[:, 1].mean()) == pytest.approx(y.std(), rel=0.3)


def test_an_angle_at_the_cut_of_its_circle() -> None:
    def whitened(t: Array) -> Array:
        return np.stack([(np.cos(2 * t[:, 0]) + 1.0) / 0.2, np.sin(2 * t[:, 0]) / 0.2], -1)

    problem = Residuals(whitened, (-math.pi / 2,), (math.pi / 2,), circles=(0,))
    found = run(problem)
    assert_evidence(found, quadrature(problem, 20001))
    assert len(found.modes) == 1
    assert np.abs(found.draws[:, 0]).min() > 0.9


def test_same_seed_same_bytes() -> None:
    problem, *_ = linear()
    first, again, other = (run(problem, SMOOTH, seed) for seed in (5, 5, 6))
    assert first.draws.tobytes() == again.draws.tobytes()
    assert first.log_weights.tobytes() == again.log_weights.tobytes()
    assert first.draws.tobytes() != other.draws.tobytes()


def test_calls_are_counted_and_bounded() -> None:
    problem, *_ = linear()
    found = run(problem, InferenceOptions.modest())
    assert found.calls == sum(problem.calls)
    assert found.calls < 10_000


def test_tails_too_heavy_for_the_mixture_are_not_passed_off_as_converged() -> None:
    problem = Residuals(lambda t: np.sqrt(2 * np.log1p(t**2)), (-1e4,) * 6, (1e4,) * 6)
    found = run(problem, replace(SMOOTH, attempts=1))
    assert not found.converged
    assert any("Pareto k" in note for note in found.notes)
    assert any("effective samples" in note for note in found.notes)


def test_a_rugged_density_whose_best_mode_one_start_found_is_not_passed_off_as_converged() -> None:
    problem = Residuals(
        lambda t: np.concatenate([t / 30.0, 40.0 * np.sin(7.3 * t + t**2)], 1), (-30.0,) * 3, (30.0,) * 3
    )
    few = replace(SMOOTH, search=replace(SMOOTH.search, screen=8, starts=8, waves=1), attempts=1)
    found = run(problem, few)
    assert not found.converged
    assert any("starts" in note for note in found.notes)


def shifted(theta: Array) -> Array:
    return np.full((len(theta), 1), np.nan)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"whitened": shifted}, "expected a start of finite density"),
        ({"low": (2.0, 0.0)}, "every lower bound below the upper"),
        ({"low": (math.nan, 0.0), "circles": (0,)}, "finite bounds of periodic columns"),
    ],
)
def test_problems_that_cannot_be(change: dict[str, object], said: str) -> None:
    sound: dict[str, object] = {"whitened": lambda t: t, "low": (0.0, 0.0), "high": (1.0, 1.0)}
    with pytest.raises(ModelError, match=said):
        run(Residuals(**(sound | change)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: InferenceOptions(draws=0), "at least 1"),
        (lambda: InferenceOptions(prior_share=1.0), r"in \[0, 1\)"),
        (lambda: InferenceOptions(rounds=-1), "at least 0"),
        (lambda: SearchOptions(shares=(0.5, 0.2, 1.0)), "grow to 1"),
        (lambda: SearchOptions(keep=0.0), "keep in"),
    ],
)
def test_options_that_cannot_be(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        make()
