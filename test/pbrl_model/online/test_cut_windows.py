"""Windows of an episode that goes on: the same however often one looks, and together what a whole episode gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from pbrl_bag.types import Grasp, Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.geometry import mass_properties
from pbrl_model.online.windows import (
    Hold,
    Piece,
    cut,
    holds_of,
    joined_motion,
    joined_windows,
    known_until,
    next_stretch,
    trimmed,
)
from pbrl_model.sensing.motion import MARGIN
from pbrl_model.sensing.windows import shooting_windows

Maker = Callable[..., Recording]
HeardBy = Callable[[Recording, float], Recording]
LENGTH = 1.5
SECONDS = 8.3


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(3, seconds=SECONDS)


def look(recording: Recording, times: list[float], heard_by: HeardBy) -> list[Piece]:
    """Cut what is complete at each time, and what is left at the last."""
    since, pieces = -np.inf, []
    for time in times:
        heard = heard_by(recording, time)
        for hold in holds_of(heard, "table"):
            while stretch := next_stretch(
                heard, "table", hold, length=LENGTH, since=since, at_the_end=time == times[-1]
            ):
                pieces.append(cut(heard, "table", hold, np.zeros(2), stretch))
                since = stretch.last
    return pieces


def test_looking_often_or_seldom_gives_the_same_windows(recording: Recording, heard_by: HeardBy) -> None:
    often = look(recording, [*np.arange(2.5, 10.0, 0.2).tolist(), 11.0], heard_by)
    one_by_one = look(recording, [4.7, 6.2, 7.7, 9.2, 10.2, 11.0], heard_by)
    assert [len(piece.windows) for piece in often] == [1] * 6
    for first, second in zip(often, one_by_one, strict=True):
        for field in fields(first.windows):
            np.testing.assert_array_equal(getattr(first.windows, field.name), getattr(second.windows, field.name))
    starts = np.concatenate([piece.windows.start for piece in often])
    np.testing.assert_allclose(starts, 2.0 + LENGTH * np.arange(6), atol=0.021)
    left = often[-1].windows.steps[-1] * 0.01  # up to the last tag, which may lie a little before the end
    assert SECONDS - 5 * LENGTH - 0.2 < left < SECONDS - 5 * LENGTH + 0.02


def test_several_that_are_due_come_at_once(recording: Recording, heard_by: HeardBy) -> None:
    pieces = look(recording, [8.1, 11.0], heard_by)
    assert [len(piece.windows) for piece in pieces] == [3, 2, 1]


def test_a_window_waits_for_what_the_smoother_needs(recording: Recording, heard_by: HeardBy) -> None:
    border = 2.0 + LENGTH
    for time, due in ((border + MARGIN - 0.1, False), (border + MARGIN + 0.3, True)):
        heard = heard_by(recording, time)
        (hold,) = holds_of(heard, "table")
        assert (next_stretch(heard, "table", hold, length=LENGTH, since=-np.inf) is not None) == due


def test_a_stream_that_fell_silent_is_not_waited_for(recording: Recording, heard_by: HeardBy) -> None:
    tags = heard_by(recording, 4.0)
    silent = replace(heard_by(recording, 10.0), object_poses=tags.object_poses)
    assert known_until(silent, "table", ("left",)) == pytest.approx(8.0, abs=0.05)
    (hold,) = holds_of(silent, "table")
    stretch = next_stretch(silent, "table", hold, length=LENGTH, since=5.0)
    assert stretch is not None and stretch.last == pytest.approx(6.5)
    with pytest.raises(ModelError, match="was its tag hidden"):
        cut(silent, "table", hold, np.zeros(2), stretch)


def test_joined_windows_are_as_likely_as_their_parts(recording: Recording, heard_by: HeardBy) -> None:
    pieces = look(recording, [6.3, 8.1, 11.0], heard_by)
    body = mass_properties(recording.bodies["table"].footprint)
    rows = np.array([[33.0, -0.6, 0.3, 0.4, 0.2, 0.3, 0.0, 0.0, np.nan, 0.0, 0.0, 0.01]])
    sigma, drag, delay = np.array([1.2]), np.array([2.0]), np.zeros(1)

    def value(windows: object) -> float:
        likelihood = WindowedLikelihood(body, windows)  # type: ignore[arg-type]
        return float(likelihood.marginal(rows, sigma, drag, delay, likelihood.at_rest(1))[0])

    parts = [piece.windows for piece in pieces]
    assert {part.pose.shape[1] for part in parts} != {parts[0].pose.shape[1]}
    assert value(joined_windows(parts)) == pytest.approx(sum(map(value, parts)), rel=1e-9)
    with pytest.raises(ModelError, match="one dt to join"):
        joined_windows([parts[0], replace(parts[1], dt=0.02)])


def test_joined_motions_are_the_episode(recording: Recording, heard_by: HeardBy) -> None:
    pieces = look(recording, [6.3, 8.1, 11.0], heard_by)
    motion = pieces[0].motion
    for piece in pieces[1:]:
        motion = joined_motion(motion, piece.motion)
    (whole,) = motions_of(recording, "table")
    count = len(motion.wrench)
    assert 0 <= len(whole.wrench) - count <= 20
    np.testing.assert_allclose(motion.time[:count], whole.time[:count], atol=0.011)
    error = np.abs(motion.state[:-20] - whole.state[: count - 19])
    assert error[:, :2].max() < 0.004 and error[:, 2].max() < 0.02
    np.testing.assert_array_equal(motion.pose_time, whole.pose_time[: len(motion.pose_time)])
    assert len(whole.pose_time) - len(motion.pose_time) <= 3
    last = trimmed(motion, motion.time[-1] - 1.0)
    assert len(last.wrench) == 100 and len(last.state) == 101 and last.pose_time[0] >= last.time[0]


def test_a_second_gripper_begins_another_hold(recording: Recording) -> None:
    both = replace(
        recording,
        grasps=(
            Grasp("left", "table", 2.0, 9.0, np.zeros(2)),
            Grasp("right", "table", 4.0, 6.0, np.zeros(2)),
            Grasp("left", "chair", 3.0, 4.0, np.zeros(2)),
        ),
    )
    assert holds_of(both, "table") == (
        Hold(("left",), 2.0, 4.0, True),
        Hold(("left", "right"), 4.0, 6.0, True),
        Hold(("left",), 6.0, 9.0, True),
    )


def test_what_was_cut_at_a_pause_is_not_cut_again(recording: Recording, heard_by: HeardBy) -> None:
    heard = heard_by(recording, 6.0)
    (hold,) = holds_of(heard, "table")
    paused = next_stretch(heard, "table", hold, length=LENGTH, since=5.0, at_the_end=True)
    assert paused is not None and paused.last < 6.0
    later = heard_by(recording, 9.8)
    (hold,) = holds_of(later, "table")
    stretch = next_stretch(later, "table", hold, length=LENGTH, since=paused.last)
    assert stretch is not None and stretch.first == pytest.approx(6.5)


def test_a_sensor_that_broke_is_named(recording: Recording) -> None:
    stream = recording.wrenches["left"]
    keep = (stream.time < 5.0) | (stream.time > 6.0)
    broken = WrenchStream(stream.time[keep], stream.force[keep], stream.torque[keep])
    gap = replace(recording, wrenches={"left": broken})
    (hold,) = holds_of(gap, "table")
    stretch = next_stretch(gap, "table", hold, length=LENGTH, since=3.5)
    assert stretch is not None
    with pytest.raises(ModelError, match=r"readings at most 0.5 s apart .* after t = 4.99"):
        cut(gap, "table", hold, np.zeros(2), stretch)
    assert len(shooting_windows([cut(gap, "table", hold, np.zeros(2), replace(stretch, last=5.0)).motion], 0.5)) == 3
