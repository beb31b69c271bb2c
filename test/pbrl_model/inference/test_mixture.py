"""Densities integrate to what is inside the domain, draws follow them, and learning finds the moments."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_t

from pbrl_model.errors import ModelError
from pbrl_model.inference.mixture import Mixture, inside_draws, inverse, positive, stratified
from pbrl_model.inference.problem import Domain

Array = NDArray[np.float64]

BOX = Domain(np.array([[0.0, -math.pi / 2], [np.inf, math.pi / 2]]), np.array([False, True]))


def mixture(domain: Domain = BOX) -> Mixture:
    mean = np.array([[0.5, 1.4], [2.0, -0.3]])
    covariance = np.array([[[0.4, 0.1], [0.1, 0.2]], [[0.3, -0.1], [-0.1, 0.1]]])
    return Mixture.around(mean, covariance, np.array([3.0, 1.0]), domain)


def test_density_of_one_component_is_scipys() -> None:
    one = Mixture.around(np.zeros((1, 3)), np.eye(3)[None] * 2.0, np.ones(1), Domain.unbounded(3), dof=7.0)
    points = np.random.default_rng(0).standard_normal((20, 3))
    known = multivariate_t(np.zeros(3), np.eye(3) * 2.0 * 5.0 / 7.0, df=7.0)
    assert one.log_density(points) == pytest.approx(known.logpdf(points))


def test_density_over_the_domain_is_the_share_of_draws_inside() -> None:
    made = mixture()
    _, inside = made.sample(np.random.default_rng(0), 400_000)
    x, y = np.linspace(0, 60, 6001), np.linspace(-math.pi / 2, math.pi / 2, 401)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    mass = np.exp(made.log_density(grid)).reshape(len(x), len(y))
    integral = np.trapezoid(np.trapezoid(mass, y, axis=1), x)
    assert integral == pytest.approx(inside.mean(), abs=4e-3)
    assert 0.5 < inside.mean() < 0.95


def test_draws_inside_are_inside_and_angles_folded() -> None:
    points, inside = mixture().sample(np.random.default_rng(0), 5000)
    assert np.all(points[inside][:, 0] >= 0.0)
    assert np.all(np.abs(points[:, 1]) <= math.pi / 2)
    wrapped = points[inside][:, 1]
    assert np.any(wrapped < -1.2)  # the component at 1.4 goes on beyond the cut


def test_importance_weights_integrate_a_function_over_the_domain() -> None:
    made = mixture()
    points, inside = made.sample(np.random.default_rng(1), 200_000)
    points = points[inside]
    target = np.exp(-points[:, 0]) * np.cos(points[:, 1]) ** 2
    estimate = np.sum(target / np.exp(made.log_density(points))) / 200_000
    assert estimate == pytest.approx(math.pi / 2, rel=0.03)


def test_learning_finds_the_moments_of_weighted_points() -> None:
    rng = np.random.default_rng(2)
    covariance = np.array([[1.0, 0.8], [0.8, 1.0]])
    points = rng.standard_normal((20_000, 2)) * 3.0
    inverse = np.linalg.inv(covariance)
    log_weights = -0.5 * np.einsum("ni,ij,nj->n", points - 1, inverse, points - 1) + np.sum(points**2, 1) / 18
    start = Mixture.around(np.zeros((1, 2)), 4 * np.eye(2)[None], np.ones(1), Domain.unbounded(2), dof=50.0)
    for _ in range(20):
        start = start.adapted(points, log_weights)
    assert start.mean[0] == pytest.approx([1.0, 1.0], abs=0.1)
    assert start.scale[0] == pytest.approx(covariance, abs=0.12)


def test_learning_works_across_the_cut_of_a_circle() -> None:
    rng = np.random.default_rng(3)
    domain = Domain(np.array([[-1.0], [1.0]]), np.array([True]))
    points = domain.fold(0.95 + 0.1 * rng.standard_normal((5000, 1)))
    start = Mixture.around(np.array([[0.8]]), np.full((1, 1, 1), 0.1), np.ones(1), domain)
    for _ in range(20):
        start = start.adapted(points, np.zeros(5000))
    assert domain.offset(start.mean[0], np.array([0.95]))[0] == pytest.approx(0.0, abs=0.01)


def test_no_component_dies() -> None:
    start = Mixture.around(np.array([[0.0], [100.0]]), np.ones((2, 1, 1)), np.ones(2), Domain.unbounded(1))
    after = start.adapted(np.random.default_rng(0).standard_normal((500, 1)), np.zeros(500))
    assert after.weight.min() > 0.05
    assert after.weight.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("n", [1, 7, 1000])
def test_stratified_counts_are_within_one_of_their_share(n: int) -> None:
    weight = np.array([0.2, 0.5, 0.3])
    counts = np.bincount(stratified(np.random.default_rng(n), weight, n), minlength=3)
    assert counts.sum() == n
    assert np.all(np.abs(counts - n * weight) < 1.0)


def test_draws_within_the_domain_are_found_where_most_fall_out() -> None:
    domain = Domain(np.array([[0.0], [1.0]]), np.array([False]))
    wide = Mixture.around(np.array([[0.0]]), np.full((1, 1, 1), 9.0), np.ones(1), domain)
    assert len(inside_draws(np.random.default_rng(0), wide, 50)) == 50


def test_positive_leaves_what_is_positive_and_mends_what_is_not() -> None:
    sound = np.array([[4.0, 1.0], [1.0, 2.0]])
    assert positive(sound) == pytest.approx(sound)
    mended = positive(np.array([[1.0, 1.0], [1.0, 1.0]]))
    assert np.linalg.eigvalsh(mended).min() > 0.0


def test_inverse_is_the_inverse_and_stays_positive_however_columns_are_scaled() -> None:
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(200, 7, 4))  # of rank four: rounding alone decides the sign of the rest
    steep = factor @ np.swapaxes(factor, -1, -2) * 10.0 ** rng.uniform(-7, 7, (200, 1, 1)) + 1e-3 * np.eye(7)
    np.linalg.cholesky(inverse(steep))
    plain = np.array([[4.0, 1.0], [1.0, 3.0]])
    np.testing.assert_allclose(inverse(plain) @ plain, np.eye(2), atol=1e-12)
    scale = np.array([1e-6, 1e5])
    np.testing.assert_allclose(inverse(plain * np.outer(scale, scale)) * np.outer(scale, scale), inverse(plain))


@pytest.mark.parametrize(
    ("bounds", "periodic", "said"),
    [
        ([[0.0], [0.0]], [False], "below the upper"),
        ([[0.0], [np.inf]], [True], "finite bounds"),
        ([[0.0], [1.0]], [True, False], "expected bounds"),
    ],
)
def test_domains_that_cannot_be(bounds: list[list[float]], periodic: list[bool], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        Domain(np.array(bounds), np.array(periodic))


def test_mixtures_that_cannot_be() -> None:
    with pytest.raises(ModelError, match="expected mean"):
        Mixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1), BOX)
    with pytest.raises(ModelError, match="degrees of freedom"):
        replace(mixture(), dof=1.0)
