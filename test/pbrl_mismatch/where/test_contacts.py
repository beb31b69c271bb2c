"""What that is known was within touch of an object: bodies that stand or are seen, and walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wandering import table_row

from pbrl_bag.types import BodyGeometry, PoseStream, Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.track import origin_of
from pbrl_mismatch.where.contacts import WALL, contact_notes, contacts_of
from pbrl_mismatch.where.localise import localise

SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])


@pytest.fixture(scope="module")
def recording(concealed_recording: Callable[..., Recording]) -> Recording:
    return concealed_recording("clean", 1)


@pytest.fixture(scope="module")
def track(recording: Recording) -> Any:
    return track_of(recording, "table")


def with_box(recording: Recording, pose: np.ndarray, stream: PoseStream | None = None) -> Recording:
    """Return a recording in which a box was told of, and seen where there is a stream."""
    box = BodyGeometry("box", SQUARE, 0.5, 5.0, True, pose)
    poses = {} if stream is None else {"box": stream}
    return replace(recording, bodies={**recording.bodies, "box": box}, object_poses={**recording.object_poses, **poses})


def beside(track: Any, step: int, gap: float) -> np.ndarray:
    """Return the pose of a box whose side is a gap [m] from the middle of the table's front at a step."""
    pose = origin_of(track.seen[step, :3], track.body[1:3])
    way = np.array([np.cos(pose[2]), np.sin(pose[2])])
    front = float(track.outline[:, 0].max())
    return np.array([*(pose[:2] + (front + 0.1 + gap) * way), pose[2]])


def test_a_body_that_stands_there_is_in_touch_when_the_table_comes_to_it(recording: Recording, track: Any) -> None:
    middle = len(track.clock) // 2
    there = np.zeros(len(track.clock), dtype=bool)
    there[middle - 20 : middle + 20] = True
    (touching,) = contacts_of(with_box(recording, beside(track, middle, 0.005)), track, there)
    assert touching.body == "box" and touching.share_there > 0.3
    assert contacts_of(with_box(recording, beside(track, middle, 9.0)), track, there) == ()


def test_a_body_is_where_it_was_seen_last_and_not_where_it_was_told_to_be(recording: Recording, track: Any) -> None:
    middle, away = len(track.clock) // 2, np.array([9.0, 9.0, 0.0])
    there = np.ones(len(track.clock), dtype=bool)
    near = beside(track, middle, 0.005)
    position = np.array([[*away[:2], 0.0], [*near[:2], 0.0], [*away[:2], 0.0]])
    turn = np.array([[0.0, 0.0, np.sin(0.5 * near[2]), np.cos(0.5 * near[2])]] * 3)
    moments = track.clock[[0, middle - 40, middle + 40]]
    seen = with_box(recording, away, PoseStream(moments, position, turn))
    (touching,) = contacts_of(seen, track, there)
    assert touching.body == "box" and touching.share_there < 80 / len(track.clock) + 0.02
    blind = with_box(recording, near, PoseStream(moments, position, np.full((3, 4), np.nan)))
    assert contacts_of(blind, track, there)[0].body == "box"


def test_a_wall_that_the_table_stands_at_is_told(recording: Recording, track: Any) -> None:
    there = np.ones(len(track.clock), dtype=bool)
    wide = np.array([[-30.0, -30.0], [30.0, -30.0], [30.0, 30.0], [-30.0, 30.0]])
    assert contacts_of(replace(recording, room=wide), track, there) == ()
    left = float((track.seen[:, 0] - np.hypot(*track.outline.T).max()).max())
    narrow = np.array([[left, -30.0], [30.0, -30.0], [30.0, 30.0], [left, 30.0]])
    (wall,) = contacts_of(replace(recording, room=narrow), track, there)
    assert wall.body == WALL


def test_what_is_known_is_said_where_it_was_there_for_most_of_the_time(recording: Recording, track: Any) -> None:
    row_free = np.ones(len(track.clock), dtype=bool)
    (touching,) = contacts_of(with_box(recording, beside(track, 0, -0.05)), track, row_free)
    most = replace(touching, share_there=0.8)
    assert "box, which is known" in contact_notes("table", (most,))[0]
    assert contact_notes("table", (replace(touching, share_there=0.2),)) == []


def test_a_localisation_has_them(recording: Recording, track: Any) -> None:
    found = localise(track, table_row(steady_x=-6.0), with_box(recording, beside(track, len(track.clock) // 2, -0.05)))
    assert [each["body"] for each in found.to_report()["contacts"]] == ["box"]
