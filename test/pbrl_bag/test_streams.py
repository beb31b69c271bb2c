"""What makes a stream unfit, and that what is fit comes through unchanged."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bag import BagError
from pbrl_bag.streams import Limits, pose_stream, wrench_stream

N = 20
TIME = np.arange(N) / 15.0
POSITION = np.column_stack([0.1 * TIME, np.zeros(N), np.full(N, 0.7)])
DEFAULT = Limits()
QUATERNION = np.tile([0.0, 0.0, 0.0, 1.0], (N, 1))


def poses(time=TIME, position=POSITION, quaternion=QUATERNION, limits=DEFAULT, notes=None):
    return pose_stream("/tag", time, position, quaternion, limits, [] if notes is None else notes)


def put(values: np.ndarray, index: object, value: object) -> np.ndarray:
    changed = values.copy()
    changed[index] = value
    return changed


def test_a_sound_stream_comes_through_unchanged() -> None:
    stream = poses()
    np.testing.assert_array_equal(stream.time, TIME)
    np.testing.assert_array_equal(stream.position, POSITION)
    np.testing.assert_array_equal(stream.quaternion, QUATERNION)


def test_quaternions_leave_with_length_one_and_unseen_ones_as_nan() -> None:
    stream = poses(quaternion=put(QUATERNION * 1.005, 3, np.nan))
    seen = np.delete(np.arange(N), 3)
    np.testing.assert_allclose(np.linalg.norm(stream.quaternion[seen], axis=1), 1.0)
    assert np.isnan(stream.quaternion[3]).all()


def test_a_quaternion_and_its_negative_are_one_orientation() -> None:
    poses(quaternion=put(QUATERNION, slice(10, None), [0.0, 0.0, 0.0, -1.0]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": put(POSITION, (4, 1), np.nan)}, ["t = 0.266667 s", "position.y", "nan"]),
        ({"position": put(POSITION, (4, 2), np.inf)}, ["position.z", "inf"]),
        ({"time": put(TIME, 4, np.nan)}, ["sample 4", "time"]),
        ({"quaternion": put(QUATERNION, 4, 0.0)}, ["t = 0.266667 s", "orientation", "unit quaternion"]),
        ({"quaternion": put(QUATERNION, (4, 0), np.nan)}, ["orientation"]),
        ({"time": put(TIME, 4, 0.1)}, ["t = 0.100000 s", "backwards by 0.1"]),
        ({"time": put(TIME, 4, TIME[3])}, ["t = 0.200000 s", "two different samples"]),
        ({"position": put(POSITION, (4, 0), 1.0)}, ["t = 0.266667 s", "position", "jumps", "at most 5 m/s"]),
        ({"quaternion": put(QUATERNION, 4, [0.0, 0.0, 1.0, 0.0])}, ["t = 0.266667 s", "orientation", "12 rad/s"]),
    ],
)
def test_an_unfit_stream_is_refused_by_topic_time_and_field(change: dict, words: list[str]) -> None:
    with pytest.raises(BagError) as caught:
        poses(**change)
    assert "\n" not in str(caught.value)
    for word in ["/tag", *words]:
        assert word in str(caught.value)


def test_limits_can_be_raised() -> None:
    jumping = put(POSITION, (4, 0), 1.0)
    assert len(poses(position=jumping, limits=Limits(speed=50.0)).time) == N


def test_noise_within_a_short_step_is_no_jump() -> None:
    time = np.array([0.0, 1e-4, 0.1])
    position = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 0.0]])
    poses(time=time, position=position, quaternion=QUATERNION[:3])


def test_a_gap_allows_as_much_motion_as_its_length() -> None:
    far = np.array([[0.0, 0.0, 0.7], [4.0, 0.0, 0.7]])
    poses(time=np.array([0.0, 1.0]), position=far, quaternion=QUATERNION[:2])


def test_repeated_samples_are_left_out_and_said() -> None:
    twice = np.repeat(np.arange(N), 2)
    notes: list[str] = []
    stream = poses(TIME[twice], POSITION[twice], QUATERNION[twice], notes=notes)
    np.testing.assert_array_equal(stream.time, TIME)
    assert notes == [f"/tag: {N} repeated samples left out"]


@pytest.mark.parametrize("field", ["force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"])
def test_nan_in_a_wrench_is_named(field: str) -> None:
    values = np.ones((N, 6))
    values[7, ["force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"].index(field)] = np.nan
    with pytest.raises(BagError, match=rf"/ft: t = 0\.466667 s: {field}: expected a finite number, got nan"):
        wrench_stream("/ft", TIME, values[:, :3], values[:, 3:], "gripper", "sensor", [])


def test_a_sensor_without_torque_is_no_error() -> None:
    stream = wrench_stream("/ft", TIME, np.ones((N, 3)), np.full((N, 3), np.nan), "object", "world", [])
    assert np.isnan(stream.torque).all()
