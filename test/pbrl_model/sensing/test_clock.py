"""One clock: averages over steps, unwrapped headings, smoothed sensor frames."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrl_bag.types import PoseStream
from pbrl_model.errors import ModelError
from pbrl_model.sensing.clock import planar_yaw, smooth_gripper, step_means


@pytest.mark.parametrize("rate", [30.0, 100.0, 1000.0])
def test_step_means_keep_the_impulse(rate: float) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 2.0, 1 / rate) + 0.003
    value = rng.normal(size=(len(time), 2))
    grid = time[0] + 0.01 * np.arange(150)
    means = step_means(time, value, grid)
    fine = np.linspace(grid[0], grid[-1], 400_001)
    exact = [np.trapezoid(np.interp(fine, time, column), fine) for column in value.T]
    np.testing.assert_allclose(means.sum(0) * 0.01, exact, atol=1e-6)


def test_step_means_hold_the_ends() -> None:
    means = step_means(np.array([1.0, 2.0]), np.array([[3.0], [5.0]]), np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0]))
    np.testing.assert_allclose(means[:, 0], [3.0, 3.0, 3.5, 4.5, 5.0])


def test_headings_are_unwrapped_and_unseen_ones_stay_nan() -> None:
    truth = np.linspace(0, 9, 40)
    quaternions = Rotation.from_euler("z", truth[:, None]).as_quat()
    quaternions[[5, 17]] = np.nan
    yaw = planar_yaw(quaternions)
    assert np.isnan(yaw[[5, 17]]).all()
    seen = np.isfinite(yaw)
    np.testing.assert_allclose(yaw[seen], truth[seen], atol=1e-9)


def test_a_sensor_frame_is_smoothed_however_far_it_turns() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0, 8, 1 / 15)
    base = Rotation.from_quat([0.03, 0.02, -0.74, 0.67])
    truth = (
        Rotation.from_euler("z", 0.9 * time[:, None])
        * Rotation.from_rotvec(0.02 * np.c_[np.sin(time), np.cos(time), 0 * time])
        * base
    )
    noisy = Rotation.from_euler("z", np.deg2rad(0.5) * rng.normal(size=(len(time), 1))) * truth
    position = np.c_[0.1 * time, np.sin(time), np.full(len(time), 0.7)]
    stream = PoseStream(time, position + 0.003 * rng.normal(size=position.shape), noisy.as_quat())
    rotation, place = smooth_gripper(stream, time)
    error = (Rotation.from_matrix(rotation) * truth.inv()).magnitude()
    assert np.sqrt(np.mean(error**2)) < np.deg2rad(0.35)
    assert np.sqrt(np.mean((place - position) ** 2)) < 0.002
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, 1, 2), np.broadcast_to(np.eye(3), rotation.shape), atol=1e-9
    )


def test_a_sensor_frame_without_orientation_is_refused() -> None:
    time = np.arange(10.0)
    quaternions = np.tile([0.0, 0, 0, 1], (10, 1))
    quaternions[4] = np.nan
    with pytest.raises(ModelError, match="quaternions"):
        smooth_gripper(PoseStream(time, np.zeros((10, 3)), quaternions), time)
