"""Climbing, the mode finder, probes and walkers, each on its own."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from closed_forms import Residuals, linear

from pbrl_model.errors import ModelError
from pbrl_model.inference.facets import ProbeOptions, probed
from pbrl_model.inference.metered import Metered
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.modes import SearchOptions, find_modes
from pbrl_model.inference.optimise import begin, climb, slopes
from pbrl_model.inference.population import WalkOptions, learned, moved, populate
from pbrl_model.inference.problem import Domain

QUICK = SearchOptions(screen=64, starts=16, shares=(1.0,), iterations=20)


def meter(problem: Residuals) -> Metered:
    return Metered.of(np.random.default_rng(0), problem)


def test_a_linear_problem_is_climbed_at_once_and_its_curvature_exact() -> None:
    problem, _, mean, covariance = linear()
    metered = meter(problem)
    ends = climb(metered, begin(metered, problem.sample_prior(np.random.default_rng(1), 5), 1.0), 1.0, 6)
    assert ends.theta == pytest.approx(np.tile(mean, (5, 1)), abs=1e-4)
    curvature, slope = slopes(metered, ends, 1.0, both_sides=True)
    assert np.linalg.inv(curvature[0]) == pytest.approx(covariance, rel=0.02, abs=1e-6)
    assert slope == pytest.approx(np.zeros_like(slope), abs=0.3)


def test_a_climb_stops_at_the_bound_and_goes_on_along_it() -> None:
    problem = Residuals(
        lambda t: np.stack([t[:, 0] + 1, t[:, 1] - 0.5 * t[:, 0] - 0.3], -1) / 0.1, (0.0,) * 2, (1.0,) * 2
    )
    metered = meter(problem)
    ends = climb(metered, begin(metered, np.array([[0.9, 0.9]]), 1.0), 1.0, 20)
    assert ends.theta[0] == pytest.approx([0.0, 0.3], abs=1e-3)


def test_the_noise_scale_is_the_root_mean_square() -> None:
    y = np.random.default_rng(0).normal(2.0, 5.0, 40)
    problem = Residuals(lambda t: t[:, :1] - y, (-10.0, math.log(0.1)), (10.0, math.log(100.0)), noise=1)
    metered = meter(problem)
    ends = climb(metered, begin(metered, np.array([[-3.0, 0.0]]), 1.0), 1.0, 10)
    assert ends.theta[0] == pytest.approx([y.mean(), math.log(y.std())], abs=1e-3)


def test_modes_are_distinct_and_counted() -> None:
    problem = Residuals(
        lambda t: np.stack([(t[:, 0] ** 2 - 1) / 0.05, (t[:, 1] ** 2 - 4) / 0.05], -1), (-3.0,) * 2, (3.0,) * 2
    )
    modes = find_modes(np.random.default_rng(0), meter(problem), QUICK)
    assert sorted(map(tuple, np.round(modes.theta))) == [(-1, -2), (-1, 2), (1, -2), (1, 2)]
    assert modes.hits.sum() <= modes.starts


def test_a_guess_is_climbed_from() -> None:
    needle = Residuals(lambda t: np.tanh((t - 0.123) / 1e-3) * 50.0, (-1.0,) * 3, (1.0,) * 3)
    few = SearchOptions(screen=8, starts=8, shares=(1.0,), iterations=20, waves=1)
    without = find_modes(np.random.default_rng(0), meter(needle), few)
    helped = find_modes(np.random.default_rng(0), meter(needle), few, np.full((1, 3), 0.1235))
    assert helped.theta[0] == pytest.approx(np.full(3, 0.123), abs=1e-4)
    assert without.value[0] < helped.value[0] - 100.0


def test_no_finite_start_is_an_error() -> None:
    problem = Residuals(lambda t: np.full((len(t), 2), np.nan), (0.0,), (1.0,))
    with pytest.raises(ModelError, match="expected a start of finite density"):
        find_modes(np.random.default_rng(0), meter(problem), QUICK)


def test_probes_find_both_sides_of_a_kink() -> None:
    """The slope of |x| turns at zero: two thin facets that meet at their edge."""
    problem = Residuals(
        lambda t: np.stack([(t[:, 1] - 3 * np.abs(t[:, 0])) / 0.01, t[:, 0] - 0.2], -1), (-5.0,) * 2, (5.0,) * 2
    )
    metered = meter(problem)
    ends = climb(metered, begin(metered, np.array([[0.3, 0.9]]), 1.0), 1.0, 20)
    curvature, _ = slopes(metered, ends, 1.0)
    shape = probed(np.random.default_rng(0), metered, ends.theta, np.linalg.inv(curvature), ProbeOptions())
    tilt = shape.scale[:, 0, 1] / shape.scale[:, 0, 0]
    assert np.any(np.abs(tilt - 3) < 0.1)
    assert np.any(np.abs(tilt + 3) < 0.1)


def test_moves_keep_a_gaussian() -> None:
    rng = np.random.default_rng(0)
    covariance = np.array([[1.0, 0.9], [0.9, 1.0]])
    factor = np.linalg.cholesky(covariance)

    def density(points: np.ndarray) -> np.ndarray:
        return -0.5 * np.einsum("ni,ij,nj->n", points, np.linalg.inv(covariance), points)

    points = rng.standard_normal((2000, 2)) @ factor.T
    after, values = moved(rng, density, Domain.unbounded(2), points, density(points), 30)
    assert values == pytest.approx(density(after))
    assert np.cov(after.T) == pytest.approx(covariance, abs=0.12)
    assert np.mean(np.any(after != points, axis=1)) > 0.95


def test_walkers_cool_into_a_needle_and_their_shape_is_learned() -> None:
    centre, width = np.array([0.4, -0.2]), np.array([1e-3, 1e-2])

    def density(points: np.ndarray) -> np.ndarray:
        return -0.5 * np.sum(((points - centre) / width) ** 2, axis=1)

    first = Mixture.around(np.zeros((1, 2)), np.eye(2)[None], np.ones(1), Domain.unbounded(2))
    walked = populate(np.random.default_rng(0), density, first, WalkOptions(walkers=100, moves=6, remember=40))
    assert walked is not None
    assert walked.cold
    shape = learned(np.random.default_rng(0), walked.points, first.domain, 1)
    assert shape.mean[0] == pytest.approx(centre, abs=2e-3)
    assert np.sqrt(np.diag(shape.scale[0])) == pytest.approx(width, rel=0.4)


def test_walkers_that_find_nothing_say_so() -> None:
    first = Mixture.around(np.zeros((1, 2)), np.eye(2)[None], np.ones(1), Domain.unbounded(2))
    assert populate(np.random.default_rng(0), lambda p: np.full(len(p), -np.inf), first, WalkOptions()) is None
