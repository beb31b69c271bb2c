"""Streams to one clock: the wrench that acted, wherever the world's origin is; what is missing is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.sensing.motion import Motion, observe

Maker = Callable[..., Recording]
START, END = 2.0, 7.9


def look(recording: Recording, **options: object) -> Motion:
    return observe(recording, "table", ("left",), START, END, np.zeros(2), **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(0, seconds=6.0)


def moved(recording: Recording, angle: float, shift: np.ndarray) -> Recording:
    """The same recording with another choice of the world's origin."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    half = np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])

    def poses(stream: PoseStream) -> PoseStream:
        b = stream.quaternion
        vector = half[3] * b[:, :3] + b[:, 3:] * half[:3] + np.cross(half[:3], b[:, :3])
        scalar = half[3] * b[:, 3:] - b[:, :3] @ half[:3, None]
        return PoseStream(stream.time, stream.position @ turn.T + shift, np.concatenate([vector, scalar], -1))

    return replace(
        recording,
        object_poses={name: poses(stream) for name, stream in recording.object_poses.items()},
        gripper_poses={name: poses(stream) for name, stream in recording.gripper_poses.items()},
    )


def test_wrench_is_the_one_that_acted(make_recording: Maker) -> None:
    # In the generator the pushed table's wheel holds: forces and moments of tens must come back within tenths.
    quiet = make_recording(0, seconds=6.0, tag_noise=1e-5, yaw_noise=1e-5, force_noise=0.0, bias=1.5, dropout=0.0)
    noisy = make_recording(0, seconds=6.0)
    exact, found = look(quiet).wrench, look(noisy).wrench
    assert np.abs(exact[:, :2]).max() > 15.0
    assert np.sqrt(np.mean((found - exact) ** 2, axis=0)).max() < 0.8
    assert np.abs(np.mean(found - exact, axis=0)).max() < 0.2


def test_nothing_pushes_before_the_push(recording: Recording) -> None:
    assert np.abs(look(recording).wrench[:5]).max() < 1.5


def test_state_is_smooth_and_in_its_own_bounds(recording: Recording) -> None:
    motion = look(recording)
    assert motion.time[1] - motion.time[0] == pytest.approx(0.01)
    assert motion.state.shape == (len(motion.time), 6) and motion.wrench.shape == (len(motion.time) - 1, 3)
    assert 0.002 < motion.noise[0] < 0.004 and np.deg2rad(0.3) < motion.noise[2] < np.deg2rad(0.7)
    assert np.all(np.linalg.eigvalsh(motion.covariance) > -1e-12)
    np.testing.assert_allclose(
        motion.pose[:, :2],
        np.c_[
            np.interp(motion.pose_time, motion.time, motion.state[:, 0]),
            np.interp(motion.pose_time, motion.time, motion.state[:, 1]),
        ],
        atol=0.015,
    )


def test_the_world_may_be_laid_out_otherwise(recording: Recording) -> None:
    angle, shift = 2.1, np.array([3.0, -1.0, 0.0])
    one, other = look(recording), look(moved(recording, angle, shift))
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    # Noise and smoothness are estimated along the axes, so that agreement is to the smoother's accuracy.
    np.testing.assert_allclose(other.wrench[:, :2], one.wrench[:, :2] @ turn.T, atol=0.3)
    np.testing.assert_allclose(other.wrench[:, 2], one.wrench[:, 2], atol=0.3)
    np.testing.assert_allclose(other.state[:, :2], one.state[:, :2] @ turn.T + shift[:2], atol=2e-3)


def test_centre_of_mass_off_the_origin_moves_with_the_heading(recording: Recording) -> None:
    com = np.array([0.2, -0.1])
    at_origin = look(recording)
    at_com = observe(recording, "table", ("left",), START, END, com)
    c, s = np.cos(at_origin.state[:, 2]), np.sin(at_origin.state[:, 2])
    arm = np.stack([c * com[0] - s * com[1], s * com[0] + c * com[1]], -1)
    np.testing.assert_allclose(at_com.state[:, :2], at_origin.state[:, :2] + arm, atol=1e-12)
    moment = at_origin.wrench[:, 2] - 0.5 * (arm[1:] + arm[:-1])[:, 0] * at_origin.wrench[:, 1]
    moment += 0.5 * (arm[1:] + arm[:-1])[:, 1] * at_origin.wrench[:, 0]
    np.testing.assert_allclose(at_com.wrench[:, 2], moment, atol=1e-3)


def test_two_grippers_add(recording: Recording) -> None:
    both = replace(
        recording,
        wrenches={**recording.wrenches, "right": recording.wrenches["left"]},
        gripper_poses={**recording.gripper_poses, "right": recording.gripper_poses["left"]},
        grasps=(*recording.grasps, replace(recording.grasps[0], gripper="right")),
    )
    twice = observe(both, "table", ("left", "right"), START, END, np.zeros(2))
    np.testing.assert_allclose(twice.wrench, 2 * look(recording).wrench, atol=1e-12)


def test_a_wrench_in_world_axes_acts_at_the_contact(recording: Recording) -> None:
    time = np.arange(0.0, 9.0, 0.01)
    force = np.tile([2.0, -1.0, 0.0], (len(time), 1))
    stream = WrenchStream(time, force, np.full_like(force, np.nan), exerted_on="object", frame="world")
    motion = look(replace(recording, wrenches={"left": stream}, gripper_poses={}))
    np.testing.assert_allclose(motion.wrench[:, :2], force[: len(motion.wrench), :2], atol=1e-12)
    heading = 0.5 * (motion.state[1:, 2] + motion.state[:-1, 2])
    arm_x = np.cos(heading) * -0.75 + np.sin(heading) * 0.1
    arm_y = np.sin(heading) * -0.75 - np.cos(heading) * 0.1
    np.testing.assert_allclose(motion.wrench[:, 2], arm_x * -1.0 - arm_y * 2.0, atol=1e-9)


def test_an_orientation_that_is_not_observed(recording: Recording) -> None:
    stream = recording.object_poses["table"]
    blind = replace(stream, quaternion=np.full_like(stream.quaternion, np.nan))
    motion = look(replace(recording, object_poses={"table": blind}))
    assert not motion.oriented and np.isnan(motion.pose[:, 2]).all() and np.isnan(motion.noise[2])
    assert np.all(motion.state[:, [2, 5]] == 0.0) and np.isfinite(motion.wrench).all()


def without_readings(recording: Recording, start: float, end: float) -> Recording:
    stream = recording.wrenches["left"]
    keep = (stream.time < start) | (stream.time > end)
    cut = replace(stream, time=stream.time[keep], force=stream.force[keep], torque=stream.torque[keep])
    return replace(recording, wrenches={"left": cut})


def with_force(recording: Recording, time: float, value: float) -> Recording:
    stream = recording.wrenches["left"]
    force = stream.force.copy()
    force[np.searchsorted(stream.time, time)] = value
    return replace(recording, wrenches={"left": replace(stream, force=force)})


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda r: with_force(r, 4.0, np.nan), r"wrench of left gripper: expected finite readings.* t = 4\.0"),
        (lambda r: with_force(r, 4.0, np.inf), "finite"),
        (lambda r: without_readings(r, 3.0, 4.0), r"none for 1\.0. s after t = 2\.99"),
        (lambda r: without_readings(r, -1.0, 1.97), "before the grasp .* start recording earlier"),
        (lambda r: without_readings(r, -1.0, 99.0), "got none"),
        (lambda r: replace(r, wrenches={}), "expected a stream"),
        (lambda r: replace(r, gripper_poses={}), "pose of left gripper"),
        (lambda r: replace(r, object_poses={}), "object poses: expected a stream for table"),
        (lambda r: replace(r, grasps=(Grasp("left", "chair", 2.0, 9.0, np.zeros(2)),)), "hold table"),
    ],
)
def test_what_is_missing_is_named(
    recording: Recording, break_it: Callable[[Recording], Recording], message: str
) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        look(break_it(recording))
    assert "\n" not in str(caught.value)


def test_an_episode_of_no_length_is_refused(recording: Recording) -> None:
    with pytest.raises(ModelError, match="longer than"):
        observe(recording, "table", ("left",), START, START, np.zeros(2))
