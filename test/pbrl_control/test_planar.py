"""Planar poses are a group; twists change point and axes consistently."""

import numpy as np
import pytest

from pbrl_control.planar import compose, inverse, rotate_vector, rotation, shift, turn, wrap, yaw_of


def test_group_laws(rng: np.random.Generator) -> None:
    for _ in range(50):
        a, b, c = rng.uniform(-3, 3, (3, 3))
        np.testing.assert_allclose(compose(compose(a, b), c)[:2], compose(a, compose(b, c))[:2], atol=1e-12)
        np.testing.assert_allclose(compose(a, inverse(a)), 0.0, atol=1e-12)


def test_shift_there_and_back(rng: np.random.Generator) -> None:
    twist, lever = rng.normal(size=3), rng.normal(size=2)
    np.testing.assert_allclose(shift(shift(twist, lever), -lever), twist)
    np.testing.assert_allclose(turn(turn(twist, 0.7), -0.7), twist)


def test_spinning_about_a_point_leaves_it_at_rest() -> None:
    lever = np.array([0.3, -0.8])
    at_lever = shift(np.array([0.0, 0.0, 2.0]), lever)
    np.testing.assert_allclose(shift(at_lever, -lever), [0.0, 0.0, 2.0], atol=1e-15)
    assert at_lever[:2] @ lever == pytest.approx(0.0)


@pytest.mark.parametrize("angle", [0.0, 3.0, -3.0, 7.0, -50.0, np.pi])
def test_wrap(angle: float) -> None:
    assert -np.pi < wrap(angle) <= np.pi
    assert np.cos(wrap(angle) - angle) == pytest.approx(1.0)


def test_quaternion_about_the_vertical() -> None:
    quaternion = np.array([0.0, 0.0, np.sin(0.35), np.cos(0.35)])
    assert yaw_of(quaternion) == pytest.approx(0.7)
    np.testing.assert_allclose(rotate_vector(quaternion, np.array([1.0, 2.0, 3.0]))[:2], rotation(0.7) @ [1.0, 2.0])
