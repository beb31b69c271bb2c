"""The planar body Jacobian against finite differences, and the laws of its pseudo-inverse."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.body_jacobian import base_block, body_jacobian, body_velocity, twist_block
from pbrl_control.planar import compose, inverse, wrap


def exponential(twist: np.ndarray) -> np.ndarray:
    """Return the pose reached from the origin after one second of a small twist, to second order."""
    x, y, w = twist
    return np.array([x - w * y / 2, y + w * x / 2, w])


def moved(pose: np.ndarray, contact: np.ndarray, base: np.ndarray, gripper: np.ndarray) -> np.ndarray:
    """Return the object's pose in the old base frame after base and gripper moved, the gripper stuck to it."""
    grip = compose(pose, np.array([*contact, 0.0]))  # gripper, with the object's heading, in base
    there = np.array([*(grip[:2] + gripper[:2]), grip[2] + gripper[2]])
    object_in_base = compose(there, inverse(np.array([*contact, 0.0])))
    return compose(exponential(base), object_in_base)


def test_blocks_are_derivatives_of_the_objects_pose(rng: np.random.Generator) -> None:
    h = 1e-6
    for _ in range(200):
        pose, contact = rng.uniform(-2, 2, 3), rng.uniform(-1, 1, 2)
        jacobian = body_jacobian(pose[None], contact[None])
        for column in range(5):
            rate = np.zeros(5)
            rate[column] = h
            ends = [moved(pose, contact, np.array([s * rate[0], 0, s * rate[1]]), s * rate[2:]) for s in (1, -1)]
            change = (ends[0] - ends[1]) / (2 * h)
            change[2] = wrap(ends[0][2] - ends[1][2]) / (2 * h)
            c, s = np.cos(pose[2]), np.sin(pose[2])
            in_object = [c * change[0] + s * change[1], c * change[1] - s * change[0], change[2]]
            np.testing.assert_allclose(jacobian[:, column], in_object, atol=1e-6)


def test_each_gripper_that_holds_has_its_own_rows() -> None:
    poses, contacts = np.array([[1.0, 0.1, 0.3]] * 2), np.array([[-0.3, 0.2], [-0.3, -0.2]])
    jacobian = body_jacobian(poses, contacts)
    assert jacobian.shape == (6, 8)
    np.testing.assert_allclose(jacobian[:3, :2], base_block(poses[0]))
    np.testing.assert_allclose(jacobian[3:, 5:], twist_block(0.3, contacts[1]))
    assert not jacobian[:3, 5:].any()


@pytest.mark.parametrize("gain", [0.0, 0.4, 1.0])
def test_the_object_moves_as_asked_whatever_the_wish(rng: np.random.Generator, gain: float) -> None:
    for _ in range(50):
        jacobian = body_jacobian(rng.uniform(-1, 1, (2, 3)), rng.uniform(-1, 1, (2, 2)))
        twist, wish = rng.normal(size=6), rng.normal(size=8)
        np.testing.assert_allclose(jacobian @ body_velocity(jacobian, twist, wish, gain), twist, atol=1e-9)


def test_a_wish_that_does_it_already_is_granted(rng: np.random.Generator) -> None:
    jacobian = body_jacobian(np.array([[0.9, 0.0, 0.2]]), np.array([[-0.4, 0.1]]))
    wish = np.array([0.2, 0.1, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(body_velocity(jacobian, jacobian @ wish, wish), wish, atol=1e-12)
