"""A body that is pushed over is seen to be off its feet, whoever looks at it; one that stands is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrl_bag.types import Grasp, PoseStream, Recording
from pbrl_mismatch.data.missing import seconds_missing
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.faults.sound import missing_notes
from pbrl_mismatch.faults.tipped import tips

Array = NDArray[np.float64]

RATE, SECONDS, LEVER = 15.0, 50.0, 0.35
"""Poses a second, how long, and how far the middle is from the edge about which the body tips [m]."""
HEIGHT_NOISE, LEAN_NOISE = 0.006, 0.017
"""Of a tag that a camera sees from above [m], [rad]."""
WHEN, LONG = 20.0, 1.2
HELD = [Grasp("left", "table", 1.0, 24.0, np.zeros(3)), Grasp("left", "table", 26.0, 49.0, np.zeros(3))]


def looked_at(
    lean: float,
    rng: np.random.Generator,
    *,
    rate: float = RATE,
    camera: tuple[float, float] = (0.0, 0.0),
    tag: tuple[float, float] = (0.0, 0.0),
    lasting: float = 0.0,
) -> PoseStream:
    """Return poses of a body that goes about, and once tips by so much [rad] and comes down again.

    Args:
        lean: at its most [rad].
        rng: of the noise.
        rate: poses a second.
        camera: lean of the frame in which poses are told, about two axes [rad].
        tag: the same of the tag on the body.
        lasting: how much of its noise a pose has from the last one.
    """
    time = np.arange(0.0, SECONDS, 1.0 / rate)
    tipped = lean * np.clip(np.sin(np.pi * (time - WHEN) / LONG), 0.0, None) * ((time > WHEN) & (time < WHEN + LONG))
    yaw = 0.3 + 1.2 * np.sin(0.11 * time)
    place = np.stack([0.8 * np.sin(0.07 * time), 0.5 * np.cos(0.09 * time), 0.77 + LEVER * np.sin(tipped)], -1)
    noise = rng.standard_normal((len(time), 4))
    for k in range(1, len(time)):
        noise[k] = lasting * noise[k - 1] + np.sqrt(1.0 - lasting**2) * noise[k]
    tilt = LEAN_NOISE * noise[:, 1:3]
    turn = (
        Rotation.from_euler("xy", camera)
        * Rotation.from_rotvec(np.column_stack([tilt, 0.2 * LEAN_NOISE * noise[:, 3]]))
        * Rotation.from_euler("z", yaw[:, None])
        * Rotation.from_euler("x", tipped[:, None])
        * Rotation.from_euler("xy", tag)
    )
    seen = Rotation.from_euler("xy", camera).apply(place)
    seen[:, 2] += HEIGHT_NOISE * noise[:, 0]
    return PoseStream(time, seen, turn.as_quat())


@pytest.mark.parametrize("camera", [(0.0, 0.0), (0.06, -0.04)])
@pytest.mark.parametrize("tag", [(0.0, 0.0), (-0.05, 0.03)])
@pytest.mark.parametrize("rate", [7.0, 15.0, 60.0])
def test_a_body_that_tips_by_four_degrees_is_seen_to_and_when(
    camera: tuple[float, float], tag: tuple[float, float], rate: float
) -> None:
    stream = looked_at(np.deg2rad(5.0), np.random.default_rng(3), rate=rate, camera=camera, tag=tag)
    (found,) = tips(stream, HELD)
    assert found.start == pytest.approx(WHEN, abs=0.45) and found.end == pytest.approx(WHEN + LONG, abs=0.45)
    # Averaged over half a second.
    assert np.deg2rad(3.0) < found.lean < np.deg2rad(6.0) and 0.015 < found.rise < 0.035


@pytest.mark.parametrize("lasting", [0.0, 0.9])
def test_a_body_that_stands_hardly_ever_is(lasting: float) -> None:
    rng = np.random.default_rng(4)
    leans = rng.uniform(-0.05, 0.05, (60, 4))
    found = [tips(looked_at(0.0, rng, camera=tuple(a[:2]), tag=tuple(a[2:]), lasting=lasting), HELD) for a in leans]
    assert sum(map(bool, found)) <= 1


def test_what_a_body_on_rubber_feet_gives_is_none_however_well_it_is_seen() -> None:
    exact = looked_at(np.deg2rad(0.4), np.random.default_rng(0))
    time, still = exact.time, looked_at(0.0, np.random.default_rng(0))
    # Without the noise of both, the lean alone is left.
    given = Rotation.from_quat(still.quaternion).inv() * Rotation.from_quat(exact.quaternion)
    place = np.column_stack([still.position[:, :2], 0.77 + exact.position[:, 2] - still.position[:, 2]])
    assert tips(PoseStream(time, place, given.as_quat()), HELD) == []


def test_nothing_is_said_of_few_poses_of_none_with_a_heading_or_of_a_broken_clock() -> None:
    stream = looked_at(np.deg2rad(5.0), np.random.default_rng(3))
    assert tips(stream, HELD)
    assert tips(PoseStream(stream.time[:30], stream.position[:30], stream.quaternion[:30]), HELD) == []
    assert tips(PoseStream(stream.time, stream.position, np.full_like(stream.quaternion, np.nan)), HELD) == []
    assert tips(PoseStream(stream.time[::-1].copy(), stream.position, stream.quaternion), HELD) == []
    brief = [Grasp("left", "table", float(start), start + 0.4, np.zeros(3)) for start in range(1, 40)]
    assert tips(stream, brief) == [], "no average is of one grasp"
    stamps = stream.time.copy()
    stamps[1::5] = stamps[::5]
    assert len(tips(PoseStream(stamps, stream.position, stream.quaternion), HELD)) == 1
    holes = np.random.default_rng(1).random(len(stream.time)) < 0.2
    position = stream.position.copy()
    position[holes] = np.nan
    assert len(tips(PoseStream(stream.time, position, stream.quaternion), HELD)) == 1


def test_what_a_body_does_off_its_feet_is_left_out_and_told(concealed_recording: Callable[..., Recording]) -> None:
    recording = concealed_recording("clean", 2, seconds=12.0)
    stream = recording.object_poses["table"]
    during = (stream.time > 6.0) & (stream.time < 7.5)
    lean = np.where(during, np.deg2rad(5.0), 0.0)
    rng = np.random.default_rng(0)
    tilt = np.column_stack([lean, 0.0 * lean, 0.0 * lean]) + [0.01, 0.01, 0.0] * rng.standard_normal((len(lean), 3))
    turned = Rotation.from_rotvec(tilt) * Rotation.from_quat(stream.quaternion)
    raised = stream.position + np.outer(LEVER * np.sin(lean) + 0.005 * rng.standard_normal(len(lean)), [0.0, 0.0, 1.0])
    poses = {**recording.object_poses, "table": PoseStream(stream.time, raised, turned.as_quat())}
    track = track_of(replace(recording, object_poses=poses), "table")
    (missing,) = track.missing
    # To within an average and the margin.
    assert missing.start == pytest.approx(6.0, abs=0.6) and missing.end == pytest.approx(7.5, abs=0.6)
    (note,) = missing_notes(track)
    assert note.startswith("table was off some of its feet: it rose by up to 3")
    assert "leaned by up to 5 deg" in note
    assert seconds_missing(track.motions, track.missing) == pytest.approx(missing.end - missing.start, abs=0.05)
    assert track_of(recording, "table").missing == ()
