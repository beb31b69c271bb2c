"""Force-moment transforms: against homogeneous matrices, as a group, and through the power they transmit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrl_model.errors import ModelError
from pbrl_model.transforms import (
    cross_matrix,
    force_moment_transform,
    planar,
    plane_rotations,
    rotation_matrices,
    transform_wrench,
    wrench_at_centre,
    yaw_matrices,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def random_frame(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)


def homogeneous(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def test_cross_matrix_is_the_cross_product(rng: np.random.Generator) -> None:
    p, v = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose((cross_matrix(p) @ v[..., None])[..., 0], np.cross(p, v), atol=1e-14)


def test_rotations_in_the_plane_are_those_about_the_vertical(rng: np.random.Generator) -> None:
    angle = rng.uniform(-7.0, 7.0, (3, 4))
    np.testing.assert_array_equal(plane_rotations(angle), yaw_matrices(angle)[..., :2, :2])
    point = np.array([2.0, 0.0])
    np.testing.assert_allclose(plane_rotations(np.array(0.5 * np.pi)) @ point, [0.0, 2.0], atol=1e-15)


def test_transform_is_that_of_forces_at_points(rng: np.random.Generator) -> None:
    # Three forces at three points, seen from b and from a: the points move with the homogeneous matrix.
    rotation, translation = random_frame(rng)
    points, forces = rng.normal(size=(2, 3, 3))
    in_b = np.concatenate([forces.sum(0), np.cross(points, forces).sum(0)])
    moved = (homogeneous(rotation, translation) @ np.c_[points, np.ones(3)].T).T[:, :3]
    turned = forces @ rotation.T
    in_a = np.concatenate([turned.sum(0), np.cross(moved, turned).sum(0)])
    np.testing.assert_allclose(transform_wrench(rotation, translation, in_b), in_a, atol=1e-12)


def test_transforms_compose_as_homogeneous_matrices_do(rng: np.random.Generator) -> None:
    first, second = random_frame(rng), random_frame(rng)
    both = homogeneous(*first) @ homogeneous(*second)
    np.testing.assert_allclose(
        force_moment_transform(both[:3, :3], both[:3, 3]),
        force_moment_transform(*first) @ force_moment_transform(*second),
        atol=1e-12,
    )


def test_there_and_back_is_nothing(rng: np.random.Generator) -> None:
    rotation, translation = random_frame(rng)
    wrench = rng.normal(size=(4, 6))
    there = transform_wrench(rotation, translation, wrench)
    np.testing.assert_allclose(transform_wrench(rotation.T, -rotation.T @ translation, there), wrench, atol=1e-12)


def test_power_does_not_depend_on_the_frame(rng: np.random.Generator) -> None:
    rotation, translation = random_frame(rng)
    wrench, velocity, omega = rng.normal(size=6), rng.normal(size=3), rng.normal(size=3)
    in_a = transform_wrench(rotation, translation, wrench)
    omega_a = rotation @ omega
    velocity_a = rotation @ velocity + np.cross(translation, omega_a)  # of the body's point at the origin of a
    assert wrench @ np.r_[velocity, omega] == pytest.approx(in_a @ np.r_[velocity_a, omega_a])


def test_wrench_at_centre_is_lever_times_force() -> None:
    wrench = wrench_at_centre(
        np.eye(3), np.array([1.0, 2.0, 0.7]), np.array([0.0, 0.0, 0.0]), np.array([3.0, 5, 0, 0, 0, 0.5])
    )
    np.testing.assert_allclose(planar(wrench), [3.0, 5.0, 1.0 * 5 - 2.0 * 3 + 0.5])


def test_wrench_at_centre_is_the_thesis_chain(rng: np.random.Generator) -> None:
    # (35): to the object's frame first, then turned into the world's; the object's heading must drop out.
    rotation_w_g, position_g = random_frame(rng)
    rotation_w_o, centre = yaw_matrices(np.array(0.8)), rng.normal(size=3)
    wrench = rng.normal(size=6)
    rotation_o_g, position_o_g = rotation_w_o.T @ rotation_w_g, rotation_w_o.T @ (position_g - centre)
    in_object = transform_wrench(rotation_o_g, position_o_g, wrench)
    in_world = transform_wrench(rotation_w_o, np.zeros(3), in_object)
    np.testing.assert_allclose(wrench_at_centre(rotation_w_g, position_g, centre, wrench), in_world, atol=1e-12)


def test_rotation_matrices_agree_with_scipy(rng: np.random.Generator) -> None:
    quaternions = rng.normal(size=(6, 4))
    np.testing.assert_allclose(rotation_matrices(quaternions), Rotation.from_quat(quaternions).as_matrix(), atol=1e-12)


@pytest.mark.parametrize("broken", [np.zeros(4), np.array([0, 0, np.nan, 1.0])])
def test_a_quaternion_of_no_length_is_refused(broken: np.ndarray) -> None:
    with pytest.raises(ModelError, match="quaternions"):
        rotation_matrices(broken)
