"""Windows: every pose in one of them, starts known only where a body rests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_model.errors import ModelError
from pbrl_model.sensing.motion import Motion, observe
from pbrl_model.sensing.windows import integrated_windows, one_step_windows, shooting_windows, whole_windows


@pytest.fixture(scope="module")
def motion(make_recording: Callable[..., Recording]) -> Motion:
    return observe(make_recording(0, seconds=6.0), "table", ("left",), 2.0, 7.9, np.zeros(2))


@pytest.mark.parametrize("length", [0.5, 1.0, 1.7, 60.0])
def test_every_pose_is_in_one_window(motion: Motion, length: float) -> None:
    windows = shooting_windows([motion], length, rate=1e3, least_poses=1)
    assert windows.observations == motion.pose.size
    assert windows.steps.sum() == len(motion.time) - 1
    times = windows.times[windows.seen[..., 0]]
    np.testing.assert_allclose(np.sort(times), motion.pose_time, atol=1e-9)
    np.testing.assert_allclose(windows.pose[windows.seen].reshape(-1, 3), motion.pose)


def test_wrenches_follow_one_another(motion: Motion) -> None:
    windows = shooting_windows([motion], 1.0)
    joined = np.concatenate([wrench[:steps] for wrench, steps in zip(windows.wrench, windows.steps, strict=True)])
    np.testing.assert_array_equal(joined, motion.wrench)


def test_only_a_body_at_rest_knows_its_velocity(motion: Motion) -> None:
    windows = shooting_windows([motion], 1.0)
    deviation = np.sqrt(np.diagonal(windows.covariance, axis1=1, axis2=2))
    assert np.all(windows.initial[0, 3:] == 0.0) and deviation[0, 3] <= 1.1e-3
    assert np.all(deviation[1:, 3] > 5e-3)


def test_poses_can_be_thinned(motion: Motion) -> None:
    thin = shooting_windows([motion], 1.0, rate=5.0)
    assert 3 * 5 <= thin.observations / 5.9 <= 3 * 8


def test_one_step_windows_hold_one_pose_each(motion: Motion) -> None:
    windows = one_step_windows([motion])
    assert windows.seen.shape[1] == 1 and np.all(windows.covariance == 0.0)
    assert len(windows) == len(motion.pose_time) - 1


def test_integrated_windows_hold_the_last_pose_alone(motion: Motion) -> None:
    windows = integrated_windows([motion, motion])
    assert len(windows) == 2 and windows.observations == 6
    np.testing.assert_array_equal(windows.pose[:, 0], np.tile(motion.pose[-1], (2, 1)))
    np.testing.assert_allclose(windows.times[:, 0], motion.pose_time[-1])


def test_whole_windows_are_the_episodes(motion: Motion) -> None:
    windows = whole_windows([motion])
    assert len(windows) == 1 and windows.steps[0] == len(motion.time) - 1


def test_a_selection_keeps_what_belongs_together(motion: Motion) -> None:
    windows = shooting_windows([motion], 1.0)
    part = windows.take(np.array([2, 0]))
    assert len(part) == 2
    np.testing.assert_array_equal(part.pose[1], windows.pose[0])
    np.testing.assert_array_equal(part.start, windows.start[[2, 0]])


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan")])
def test_a_length_that_is_none_is_refused(motion: Motion, length: float) -> None:
    with pytest.raises(ModelError, match="length above zero"):
        shooting_windows([motion], length)


def test_no_poses_no_windows(motion: Motion) -> None:
    with pytest.raises(ModelError, match="at least one window"):
        shooting_windows([motion], 0.05, least_poses=4)
