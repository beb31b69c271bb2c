"""Episodes: constant sets of grippers, nothing lost at their edges, nothing invented."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pbrl_bag import BagError, Grasp, PoseStream, Recording, WrenchStream, cut_episodes
from pbrl_bag.streams import read_only

TIME = np.arange(0.0, 10.0, 0.05)


def poses(time: np.ndarray = TIME) -> PoseStream:
    n = len(time)
    return PoseStream(read_only(time), read_only(np.zeros((n, 3))), read_only(np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))))


def wrenches(time: np.ndarray = TIME) -> WrenchStream:
    return WrenchStream(read_only(time), read_only(np.ones((len(time), 3))), read_only(np.ones((len(time), 3))))


def recording(*grasps: tuple, **parts: object) -> Recording:
    made = tuple(Grasp(side, name, start, end, np.zeros(2)) for side, name, start, end in grasps)
    streams = {
        "object_poses": {"table": poses(), "chair": poses()},
        "gripper_poses": {"left": poses(), "right": poses()},
        "wrenches": {"left": wrenches(), "right": wrenches()},
        **parts,
    }
    return Recording(path=Path("push"), bodies={}, grasps=made, **streams)


def spans(episodes: tuple) -> list[tuple]:
    return [(episode.object, episode.start, episode.end, "+".join(episode.grippers)) for episode in episodes]


def test_no_grasp_no_episode() -> None:
    assert cut_episodes(recording()) == ()


def test_the_set_of_grippers_is_constant_in_an_episode() -> None:
    episodes = cut_episodes(recording(("left", "table", 1.0, 5.0), ("right", "table", 2.0, 4.0)))
    assert spans(episodes) == [
        ("table", 1.0, 2.0, "left"),
        ("table", 2.0, 4.0, "left+right"),
        ("table", 4.0, 5.0, "left"),
    ]


def test_two_objects_at_once_are_two_episodes() -> None:
    episodes = cut_episodes(recording(("left", "table", 1.0, 5.0), ("right", "chair", 2.0, 4.0)))
    assert spans(episodes) == [("chair", 2.0, 4.0, "right"), ("table", 1.0, 5.0, "left")]


def test_a_new_grip_begins_a_new_episode() -> None:
    episodes = cut_episodes(recording(("left", "table", 1.0, 2.0), ("left", "table", 2.0, 3.0)))
    assert spans(episodes) == [("table", 1.0, 2.0, "left"), ("table", 2.0, 3.0, "left")]


def test_poses_lie_inside_and_wrenches_reach_just_beyond() -> None:
    (episode,) = cut_episodes(recording(("left", "table", 1.02, 3.01)))
    assert episode.poses.time[0] >= episode.start
    assert episode.poses.time[-1] <= episode.end
    for stream in (episode.wrenches["left"], episode.gripper_poses["left"]):
        assert stream.time[0] < episode.start < stream.time[1]
        assert stream.time[-2] < episode.end < stream.time[-1]
    assert set(episode.wrenches) == set(episode.contacts) == {"left"}
    assert episode.duration == pytest.approx(1.99)


def test_the_moment_between_two_grippers_is_left_out() -> None:
    episodes = cut_episodes(recording(("left", "table", 1.0, 5.0), ("right", "table", 1.01, 5.0)))
    assert spans(episodes) == [("table", 1.01, 5.0, "left+right")]


def test_an_episode_of_zero_length_is_refused() -> None:
    with pytest.raises(BagError, match=r"push: t = 2\.000000 s: grasps: left on 'table'.*zero length") as caught:
        cut_episodes(recording(("left", "table", 2.0, 2.0), ("left", "table", 3.0, 5.0)))
    assert "\n" not in str(caught.value)


def test_a_hold_during_which_nothing_was_seen_is_refused() -> None:
    hidden = {"table": poses(TIME[(TIME < 2.0) | (TIME > 4.0)])}
    with pytest.raises(BagError, match=r"t = 2\.200000 to 3\.800000 s: object_poses\.table: .*got 0"):
        cut_episodes(recording(("left", "table", 2.2, 3.8), object_poses=hidden))


def test_a_hold_during_which_nothing_was_felt_is_refused() -> None:
    numb = {"left": wrenches(TIME[(TIME < 2.0) | (TIME > 4.0)])}
    with pytest.raises(BagError, match=r"wrenches\.left: expected at least 2 samples"):
        cut_episodes(recording(("left", "table", 2.2, 3.8), wrenches=numb))


def test_a_grasp_that_the_end_cut_off_is_left_out_unless_it_is_all_there_is() -> None:
    end = float(TIME[-1])
    episodes = cut_episodes(recording(("left", "table", 1.0, 2.0), ("left", "table", end, end)))
    assert spans(episodes) == [("table", 1.0, 2.0, "left")]
    with pytest.raises(BagError, match="zero length"):
        cut_episodes(recording(("left", "table", end, end)))


def test_shifting_the_clock_shifts_the_episodes(kit: SimpleNamespace) -> None:
    shift = 1000.0
    plain = cut_episodes(recording(("left", "table", 1.0, 5.0), ("right", "table", 2.0, 4.0)))
    moved = cut_episodes(
        recording(
            ("left", "table", 1.0 + shift, 5.0 + shift),
            ("right", "table", 2.0 + shift, 4.0 + shift),
            object_poses={"table": poses(TIME + shift)},
            gripper_poses={"left": poses(TIME + shift), "right": poses(TIME + shift)},
            wrenches={"left": wrenches(TIME + shift), "right": wrenches(TIME + shift)},
        )
    )
    assert [len(episode.poses.time) for episode in moved] == [len(episode.poses.time) for episode in plain]
    assert [episode.start - shift for episode in moved] == [episode.start for episode in plain]
