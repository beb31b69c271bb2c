"""Coordinates keep what they must: positions, volumes, densities, and one point for the descriptions of one wheel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from pbrl_model.fitting.calibration import TABLE, empty_windows, options_for
from pbrl_model.fitting.coordinates import Coordinates
from pbrl_model.fitting.fit import target_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.target import Target
from pbrl_model.geometry import mass_properties
from pbrl_model.prior_options import parse_prior_options
from pbrl_model.symmetry import canonical_wheel, equivalent_wheels

CLASSES = ("free", "wheel", "wheel+ground", "hinge")


def target_for(model_class: str, priors: dict | None = None) -> Target:
    options = options_for(model_class)
    if priors is not None:
        options = options.model_copy(update={"priors": parse_prior_options(priors)})
    windows = empty_windows(np.random.default_rng(0), model_class)
    return target_of(TABLE, WindowedLikelihood(mass_properties(TABLE.footprint), windows), options)


def representatives(target: Target, positions: np.ndarray) -> np.ndarray:
    out = positions.copy()
    out[:, : len(target.names)] = canonical_wheel(out[:, : len(target.names)], target.names)
    return out


@pytest.mark.parametrize("merged", [True, False])
@pytest.mark.parametrize("model_class", CLASSES)
def test_there_and_back(model_class: str, merged: bool) -> None:
    target = target_for(model_class)
    map_ = Coordinates(target, merged)
    positions = target.sample_prior(np.random.default_rng(1), 200)
    wanted = representatives(target, positions) if merged else positions
    np.testing.assert_allclose(map_.positions(map_.of(positions, 0.0)), wanted, atol=1e-9)


@pytest.mark.parametrize("model_class", CLASSES)
def test_volume_is_the_determinant_of_the_slope(model_class: str) -> None:
    target = target_for(model_class)
    map_ = Coordinates(target)
    points = map_.sample_prior(np.random.default_rng(2), 20)
    step = 1e-6 * np.eye(points.shape[1])
    slope = np.stack([(map_.positions(points + h) - map_.positions(points - h)) / 2e-6 for h in step], -1)
    np.testing.assert_allclose(np.linalg.slogdet(slope)[1], map_.log_volume(points), atol=1e-5)


@pytest.mark.parametrize("model_class", CLASSES)
def test_prior_over_coordinates_is_the_density_of_its_draws(model_class: str) -> None:
    # E[g / p] over draws of p is how much of g lies where p is not zero, for any g. A Gaussian serves.
    map_ = Coordinates(target_for(model_class))
    rng = np.random.default_rng(3)
    points = map_.sample_prior(rng, 60_000)
    mean, deviation = np.median(points, axis=0), 0.3 * (np.diff(np.quantile(points, [0.2, 0.8], axis=0), axis=0)[0])
    gaussian = -0.5 * np.sum(((points - mean) / deviation) ** 2 + np.log(2 * np.pi * deviation**2), axis=1)
    found = np.exp(logsumexp(gaussian - map_.log_prior(points)) - np.log(len(points)))
    within = np.isfinite(map_.log_prior(mean + deviation * rng.normal(size=(4000, len(mean))))).mean()
    assert found == pytest.approx(within, abs=0.15)


def test_descriptions_of_one_wheel_are_one_point() -> None:
    target = target_for("wheel")
    map_ = Coordinates(target)
    positions = target.sample_prior(np.random.default_rng(4), 30)
    images = equivalent_wheels(positions[:, :6], target.names)
    points = [map_.of(np.concatenate([image, positions[:, 6:]], -1)) for image in images]
    for other in points[1:]:
        np.testing.assert_allclose(other, points[0], atol=1e-9)


def test_density_is_the_sum_over_descriptions() -> None:
    # With a prior that likes one turn, the descriptions differ in prior and not in likelihood.
    target = target_for("wheel", {"wheel": {"theta_kappa": 2.0, "theta_mean": 0.5}})
    map_ = Coordinates(target)
    points = map_.sample_prior(np.random.default_rng(5), 8)
    positions = map_.positions(points)
    images = equivalent_wheels(positions[:, :6], target.names)
    full = [target.full_log_density(np.concatenate([image, positions[:, 6:]], -1)) for image in images]
    # A wheel's descriptions are simulated alike but for rounding, which a climb in steps magnifies.
    np.testing.assert_allclose(map_.log_density(points), logsumexp(full, axis=0) + map_.log_volume(points), rtol=1e-3)


def test_described_as_the_prior_has_it() -> None:
    target = target_for("wheel", {"wheel": {"theta_kappa": 4.0, "theta_mean": 0.5}})
    map_ = Coordinates(target)
    rng = np.random.default_rng(6)
    positions = target.sample_prior(rng, 4000)
    again = map_.describe(rng, map_.of(positions, 0.0))
    np.testing.assert_allclose(representatives(target, again), representatives(target, positions), atol=1e-8)
    theta = target.names.index("wheel_theta")
    before, after = (np.histogram(rows[:, theta], 8, (-np.pi, np.pi))[0] for rows in (positions, again))
    np.testing.assert_allclose(before, after, atol=5.0 * np.sqrt(before.max()))


def test_covariances_are_turned_along() -> None:
    target = target_for("wheel")
    map_ = Coordinates(target)
    position = target.sample_prior(np.random.default_rng(7), 1)
    position[0, :6] = [25.0, 0.1, 0.2, 0.4, 0.1, 0.4]
    spread = np.array([0.1, *np.full(8, 1e-3)])
    cloud = position + spread * np.random.default_rng(8).normal(size=(4000, 9))
    found = map_.covariance(position, np.diag(spread**2)[None])[0]
    np.testing.assert_allclose(np.diag(found), map_.of(cloud).var(axis=0), rtol=0.15)


def test_starts_on_a_bound_are_moved_off_it() -> None:
    target = target_for("wheel+ground")
    position = target.sample_prior(np.random.default_rng(9), 1)
    position[0, [4, 5, 6]] = [0.0, 1.0, 0.0]
    for merged in (True, False):
        map_ = Coordinates(target, merged)
        assert np.all(np.isfinite(map_.of(position)))
        assert np.isfinite(target.log_prior(map_.inside(position)))
        covariance = map_.covariance(position, np.diag(np.full(10, 1e-4))[None])
        assert np.all(np.linalg.eigvalsh(covariance) > 0.0)
