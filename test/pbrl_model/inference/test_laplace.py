"""Tops are found, Gaussians are exact on Gaussians, and roughness does not pass for sharpness."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.inference.laplace import climb, differences, principal_axes

MEAN = np.array([0.3, -1.0, 0.2])
ROOT = np.array([[1.0, 0.0, 0.0], [0.5, 0.2, 0.0], [-0.3, 0.1, 0.4]])
COVARIANCE = 0.01 * ROOT @ ROOT.T


def gaussian(points: np.ndarray) -> np.ndarray:
    offset = points - MEAN
    return -0.5 * np.einsum("ni,ij,nj->n", offset, np.linalg.inv(COVARIANCE), offset)


def test_a_gaussian_is_found_exactly() -> None:
    tops = climb(gaussian, np.zeros((1, 3)), 2.0 * COVARIANCE[None], np.ones(3), iterations=30)
    np.testing.assert_allclose(tops.position[0], MEAN, atol=1e-6)
    np.testing.assert_allclose(tops.covariance[0], COVARIANCE, rtol=1e-6)


def test_starts_of_one_top_become_one_and_the_best_comes_first() -> None:
    def two(points: np.ndarray) -> np.ndarray:
        return np.logaddexp(gaussian(points), gaussian(points - 3.0) - 2.0)

    starts = np.stack([MEAN + 3.1, MEAN + 0.05, MEAN - 0.05])
    tops = climb(two, starts, np.repeat(COVARIANCE[None], 3, axis=0), np.ones(3))
    np.testing.assert_allclose(tops.position, [MEAN, MEAN + 3.0], atol=1e-3)
    assert tops.log_density[0] > tops.log_density[1]


def test_roughness_does_not_pass_for_sharpness() -> None:
    def rough(points: np.ndarray) -> np.ndarray:
        return gaussian(points) + 0.02 * np.sin(4000.0 * points).sum(axis=1)

    tops = climb(rough, np.zeros((1, 3)), COVARIANCE[None], np.ones(3))
    np.testing.assert_allclose(np.diag(tops.covariance[0]), np.diag(COVARIANCE), rtol=0.5)


def test_a_start_beside_a_cliff_stays_on_it() -> None:
    def cliff(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] > 0.0, -points.sum(axis=1), -np.inf)

    tops = climb(cliff, np.full((1, 2), 0.05), 0.01 * np.eye(2)[None], np.ones(2))
    assert np.isfinite(tops.log_density[0]) and tops.position[0, 0] > 0.0
    assert np.all(np.linalg.eigvalsh(tops.covariance[0]) > 0.0)


def test_differences_of_a_quadratic_are_its_derivatives() -> None:
    axes = principal_axes(COVARIANCE[None], np.ones(3))
    value, slope, bend = differences(gaussian, MEAN[None] + 0.01, axes)
    precision = np.linalg.inv(COVARIANCE)
    assert value[0] == pytest.approx(gaussian(MEAN[None] + 0.01)[0])
    np.testing.assert_allclose(slope[0], -axes[0].T @ precision @ np.full(3, 0.01), atol=1e-9)
    np.testing.assert_allclose(bend[0], -axes[0].T @ precision @ axes[0], atol=1e-9)


def test_axes_keep_within_their_shares_of_the_scale() -> None:
    axes = principal_axes(np.diag([1e-20, 1.0, 1e6])[None], np.ones(3))
    np.testing.assert_allclose(np.sort(np.linalg.norm(axes[0], axis=0)), [1e-4, 0.7, 0.7], rtol=1e-6)
