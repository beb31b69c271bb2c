"""Gravity compensation: exact where it says it is."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrl_model.sensing.gravity import GravityMethod, ReferenceReading, compensation

WEIGHT = np.array([0.0, 0.0, -17.35])
CENTRE = np.array([0.0, 0.091, 0.0])


def reading(rotation: np.ndarray, centre: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """What a free sensor reads: weight at `centre` of the sensor's frame, and bias."""
    force = np.swapaxes(rotation, -1, -2) @ WEIGHT
    return np.concatenate([force, np.cross(centre, force)], -1) + bias


@pytest.fixture
def first() -> np.ndarray:
    return Rotation.from_quat([0.03, 0.02, -0.74, 0.67]).as_matrix()


@pytest.fixture
def bias() -> np.ndarray:
    return np.array([1.0, -0.7, 1.2, 0.05, -0.02, 0.03])


@pytest.mark.parametrize("method", get_args(GravityMethod))
def test_nothing_is_left_while_the_gripper_stays(first: np.ndarray, bias: np.ndarray, method: GravityMethod) -> None:
    seen = reading(first, CENTRE, bias)
    np.testing.assert_allclose(compensation(ReferenceReading(seen, first), first, method), seen, atol=1e-12)


def test_reference_is_exact_for_a_weight_at_the_sensor(first: np.ndarray) -> None:
    now = Rotation.random(20, random_state=3).as_matrix()
    reference = ReferenceReading(reading(first, np.zeros(3), np.zeros(6)), first)
    expected = reading(now, np.zeros(3), np.zeros(6))
    np.testing.assert_allclose(compensation(reference, now, "reference"), expected, atol=1e-12)


def test_weight_is_exact_with_bias_while_the_gripper_turns_about_the_vertical(
    first: np.ndarray, bias: np.ndarray
) -> None:
    turned = Rotation.from_euler("z", np.linspace(-3, 3, 20)[:, None]).as_matrix() @ first
    reference = ReferenceReading(reading(first, CENTRE, bias), first)
    np.testing.assert_allclose(compensation(reference, turned, "weight"), reading(turned, CENTRE, bias), atol=1e-12)
    # The thesis's turns the bias with the world, which is wrong by twice its size at half a turn.
    assert np.abs(compensation(reference, turned, "reference") - reading(turned, CENTRE, bias)).max() > 1.0


def test_weight_is_exact_for_a_tilting_gripper_without_bias() -> None:
    # The lever arm is known only across the weight, and this one is across it in both postures.
    tilted = Rotation.from_euler("y", np.linspace(-1, 1, 11)[:, None]).as_matrix()
    reference = ReferenceReading(reading(np.eye(3), CENTRE, np.zeros(6)), np.eye(3))
    expected = reading(tilted, CENTRE, np.zeros(6))
    np.testing.assert_allclose(compensation(reference, tilted, "weight"), expected, atol=1e-12)


def test_a_weightless_gripper_is_all_bias(bias: np.ndarray) -> None:
    reference = ReferenceReading(np.where(np.arange(6) == 2, 0.0, bias), np.eye(3))
    tilted = Rotation.from_euler("x", 0.7).as_matrix()
    np.testing.assert_allclose(compensation(reference, tilted, "weight"), reference.wrench)
