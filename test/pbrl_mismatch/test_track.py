"""Episodes laid end to end: what of a grasp counts, and the axes in which its wrench is told."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import MismatchError, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.track import CLOSING, ROLLING, after_closing, lay_track
from pbrl_model.fitting.episodes import body_of, motions_of
from pbrl_model.sensing.motion import Motion


@pytest.fixture(scope="module")
def recording(concealed_recording: Callable[..., Recording]) -> Recording:
    return concealed_recording("clean", 1)


@pytest.fixture(scope="module")
def motion(recording: Recording) -> Motion:
    return motions_of(recording, "table")[0]


def at_speed(motion: Motion, speed: float) -> Motion:
    state = motion.state.copy()
    state[0, 3:5] = [speed, 0.0]
    return replace(motion, state=state)


def test_plates_that_close_on_a_body_at_rest_are_no_knock(motion: Motion) -> None:
    assert after_closing(at_speed(motion, 0.5 * ROLLING)).time[0] == motion.time[0]


def test_of_a_body_that_rolls_the_first_moments_are_left_out(motion: Motion) -> None:
    rolling = at_speed(motion, 2.0 * ROLLING)
    cut = after_closing(rolling)
    first = round(CLOSING / motion.dt)
    assert cut.time[0] == pytest.approx(motion.time[0] + CLOSING)
    assert len(cut.time) == len(cut.state) == len(cut.covariance) == len(cut.wrench) + 1
    np.testing.assert_array_equal(cut.wrench, motion.wrench[first:])
    assert cut.pose_time[0] >= cut.time[0] and len(cut.pose_time) == len(cut.pose)
    short = replace(rolling, time=rolling.time[: 2 * first + 1], wrench=rolling.wrench[: 2 * first])
    assert after_closing(short) is short


@pytest.mark.parametrize("speed", [0.0, 0.01, 0.03])
def test_the_start_of_a_grasp_is_not_taken_for_rest(recording: Recording, motion: Motion, speed: float) -> None:
    # Taken for rest, a centimetre a second that is left of the last push looks like a blow, in every clean recording.
    geometry = recording.bodies["table"]
    track = lay_track(recording, [at_speed(motion, speed)], geometry, body_of(geometry, motion.oriented))
    for length in (1.0, 2.0):
        cuts = cut_windows(track, length)
        (first,) = np.flatnonzero(cuts.span[:, 0] == cuts.span[:, 2])
        np.testing.assert_array_equal(cuts.told[first], track.motions[0].state[0])
        spread = np.sqrt(np.diag(cuts.root[first] @ cuts.root[first].T))
        assert (spread >= np.sqrt(np.diag(motion.covariance[0]))).all()


def test_the_sensor_s_wrench_turned_back_is_what_acts_at_the_centre_of_mass(recording: Recording) -> None:
    track = track_of(recording, "table")
    c, s, x, y, _ = track.mount.T
    np.testing.assert_allclose(c**2 + s**2, 1.0)
    force = np.stack([c * track.felt[:, 0] - s * track.felt[:, 1], s * track.felt[:, 0] + c * track.felt[:, 1]], -1)
    torque = track.felt[:, 2] + x * force[:, 1] - y * force[:, 0]
    wrench = np.concatenate([motion.wrench for motion in track.motions])
    np.testing.assert_allclose(np.column_stack([force, torque]), wrench, atol=1e-9)


def test_the_axes_are_the_body_s_when_it_was_first_held_and_the_same_in_each_grasp(recording: Recording) -> None:
    motion = motions_of(recording, "table")[0]
    geometry = recording.bodies["table"]
    half = len(motion.wrench) // 2
    parts = [_part(motion, 0, half), _part(motion, half, len(motion.wrench))]
    whole, cut = (
        lay_track(recording, each, geometry, body_of(geometry, motion.oriented)) for each in ([motion], parts)
    )
    turn = np.arctan2(whole.mount[0, 1], whole.mount[0, 0])
    assert np.angle(np.exp(1j * (turn - motion.state[0, 2]))) == pytest.approx(0.0, abs=0.02)
    # The gripper is smoothed in each grasp alone: its turn differs by that, and by no more.
    np.testing.assert_allclose(cut.mount[half:, :2], whole.mount[half:, :2], atol=0.02)
    assert list(cut.begin) == [0, half] and list(cut.last) == [half - 1, len(motion.wrench) - 1]
    # The sensor was read before the grasp, of which both are parts.
    np.testing.assert_allclose(cut.mount[:, 4], whole.mount[:, 4])


def test_the_sensor_s_axes_are_those_that_it_had_in_the_body_s_when_it_first_held(recording: Recording) -> None:
    motion, geometry = motions_of(recording, "table")[0], recording.bodies["table"]
    hand, s, c = recording.gripper_poses["left"], math.sin(0.35), math.cos(0.35)
    x, y, z, w = hand.quaternion.T
    about = np.stack([c * x + s * y, c * y - s * x, c * z + s * w, c * w - s * z], -1)
    by_a_turn = replace(recording, gripper_poses={"left": replace(hand, quaternion=about)})
    found = []
    for each in (recording, by_a_turn):
        gripper, turn = lay_track(each, [motion], geometry, body_of(geometry, motion.oriented)).sensor or pytest.fail()
        assert gripper == "left"
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        found.append(math.atan2(turn[1, 0], turn[0, 0]))
    assert found[1] - found[0] == pytest.approx(0.7, abs=1e-6)
    unseen = replace(recording, gripper_poses={})
    assert lay_track(unseen, [motion], geometry, body_of(geometry, motion.oriented)).sensor is None
    other = replace(recording.grasps[0], gripper="right")
    both = replace(
        recording,
        grasps=(*recording.grasps, other),
        wrenches=dict.fromkeys(("left", "right"), recording.wrenches["left"]),
        gripper_poses=dict.fromkeys(("left", "right"), hand),
    )
    held = replace(motion, grippers=("left", "right"))
    assert lay_track(both, [held], geometry, body_of(geometry, motion.oriented)).sensor is None


def test_a_drift_counts_from_when_the_sensor_was_read_at_rest(recording: Recording) -> None:
    rate, (whole,) = 0.3, recording.grasps
    # Let go for a moment, and taken again while it still rolls: the first moments of that are left out.
    recording = replace(recording, grasps=(replace(whole, end=10.0), replace(whole, start=12.0)))
    drifting = {
        side: replace(stream, torque=stream.torque + rate * stream.time[:, None] * np.array([0.0, 0.0, 1.0]))
        for side, stream in recording.wrenches.items()
    }
    geometry = recording.bodies["table"]
    true, told = (
        lay_track(each, motions, geometry, body_of(geometry, motions[0].oriented))
        for each in (recording, replace(recording, wrenches=drifting))
        for motions in [[after_closing(motion) for motion in motions_of(each, "table")]]
    )
    off = told.felt - true.felt
    assert len(true.begin) == 2 and true.clock[true.begin[1]] == pytest.approx(12.0 + CLOSING)
    np.testing.assert_allclose(off[:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(off[:, 2]), rate * true.mount[:, 4], atol=rate * true.dt)


def _part(motion: Motion, first: int, last: int) -> Motion:
    seen = (motion.pose_time >= motion.time[first]) & (motion.pose_time <= motion.time[last])
    return replace(
        motion,
        time=motion.time[first : last + 1],
        wrench=motion.wrench[first:last],
        pose_time=motion.pose_time[seen],
        pose=motion.pose[seen],
        state=motion.state[first : last + 1],
        covariance=motion.covariance[first : last + 1],
    )


def test_what_cannot_be_laid_is_refused(recording: Recording, motion: Motion) -> None:
    geometry = recording.bodies["table"]
    properties = body_of(geometry, motion.oriented)
    with pytest.raises(MismatchError, match="at least one episode"):
        lay_track(recording, [], geometry, properties)
    with pytest.raises(MismatchError, match="one grid step"):
        lay_track(recording, [motion, replace(motion, dt=0.02)], geometry, properties)
