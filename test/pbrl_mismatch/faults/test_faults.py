"""Recordings with a fault of their own are refused in a line, or told as what they are; never taken for physics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from pbrl_bag import BagError, read_recording, write_recording
from pbrl_bag.types import BodyGeometry, PoseStream, Recording, WrenchStream
from pbrl_mismatch import DiagnoseOptions, MismatchError, diagnose
from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.grip import lay_grips
from pbrl_mismatch.data.missing import Missing, seconds_missing
from pbrl_mismatch.data.residual import residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.faults.repeats import stopped_poses, stopped_wrenches
from pbrl_mismatch.faults.saturation import saturated
from pbrl_mismatch.faults.sound import missing_notes
from pbrl_mismatch.kernels.columns import neutral_row
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Spoil = Callable[[Recording], Recording]

HELD, END = 1.5, 13.5
"""When the table is taken, and when the recording ends [s]."""
FROM, TO = 6.0, 8.0


@pytest.fixture(scope="module")
def sound(concealed_recording: Callable[..., Recording]) -> Recording:
    """A table that is pushed for twelve seconds, and a chair that stands beside."""
    pushed = concealed_recording("clean", 2, seconds=END - HELD)
    rng = np.random.default_rng(5)
    time = pushed.object_poses["table"].time
    place = np.array([4.0, 3.0, 0.7]) + 0.002 * rng.standard_normal((len(time), 3))
    turn = 0.4 + 0.004 * rng.standard_normal(len(time))
    nothing = np.zeros_like(turn)
    stands = PoseStream(time, place, np.stack([nothing, nothing, np.sin(turn / 2), np.cos(turn / 2)], -1))
    seat = np.array([[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]])
    chair = BodyGeometry("chair", seat, 0.5, 6.0, True, np.array([4.0, 3.0, 0.4]))
    return replace(
        pushed,
        path=Path("a_bag"),
        bodies={**pushed.bodies, "chair": chair},
        object_poses={**pushed.object_poses, "chair": stands},
    )


def with_table(recording: Recording, stream: PoseStream) -> Recording:
    return replace(recording, object_poses={**recording.object_poses, "table": stream})


def with_gripper(recording: Recording, stream: PoseStream) -> Recording:
    return replace(recording, gripper_poses={"left": stream})


def with_wrench(recording: Recording, **columns: Array) -> Recording:
    return replace(recording, wrenches={"left": replace(recording.wrenches["left"], **columns)})


def rows(stream: PoseStream, kept: NDArray[np.bool_] | NDArray[np.int64]) -> PoseStream:
    return PoseStream(stream.time[kept], stream.position[kept], stream.quaternion[kept])


def without_poses(stream: PoseStream, start: float = FROM, end: float = TO) -> PoseStream:
    return rows(stream, (stream.time < start) | (stream.time > end))


def without_wrench(recording: Recording, start: float = FROM, end: float = TO) -> Recording:
    felt = recording.wrenches["left"]
    kept = (felt.time < start) | (felt.time > end)
    return with_wrench(recording, time=felt.time[kept], force=felt.force[kept], torque=felt.torque[kept])


def held_at(time: Array, start: float, end: float) -> NDArray[np.int64]:
    """Return rows in which that at `start` is repeated until `end`."""
    inside = (time >= start) & (time < end)
    return np.where(inside, int(np.argmax(inside)), np.arange(len(time)))


def stopped_sensor(recording: Recording, start: float, end: float) -> Recording:
    felt = recording.wrenches["left"]
    kept = held_at(felt.time, start, end)
    return with_wrench(recording, force=felt.force[kept], torque=felt.torque[kept])


def stopped_tracker(recording: Recording, start: float, end: float) -> Recording:
    stream = recording.object_poses["table"]
    kept = held_at(stream.time, start, end)
    return with_table(recording, PoseStream(stream.time, stream.position[kept], stream.quaternion[kept]))


def clipped(recording: Recording, share: float = 0.6) -> Recording:
    """Clip the torque about the vertical as a sensor with less range would."""
    felt = recording.wrenches["left"]
    most = share * float(np.abs(felt.torque[:, 2]).max())
    torque = felt.torque.copy()
    torque[:, 2] = np.clip(torque[:, 2], -most, most)
    return with_wrench(recording, torque=torque)


def swapped(recording: Recording, since: float = -1.0) -> Recording:
    one, other = recording.object_poses["table"], recording.object_poses["chair"]

    def mixed(before: PoseStream, after: PoseStream) -> PoseStream:
        late = after.time > since
        parts = rows(before, before.time <= since), rows(after, late)
        return PoseStream(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "position", "quaternion")))

    return replace(recording, object_poses={"table": mixed(one, other), "chair": mixed(other, one)})


def nothing_felt(recording: Recording) -> Recording:
    felt = recording.wrenches["left"]
    noise = np.random.default_rng(0).standard_normal((len(felt.time), 6))
    return with_wrench(recording, force=[0.0, 0.0, -15.0] + 0.15 * noise[:, :3], torque=0.01 * noise[:, 3:])


def unmoved(recording: Recording) -> Recording:
    noise = np.random.default_rng(0)

    def still(stream: PoseStream) -> PoseStream:
        place = stream.position[:1] + 0.003 * noise.standard_normal(stream.position.shape)
        return PoseStream(stream.time, place, np.repeat(stream.quaternion[:1], len(stream.time), 0))

    there = with_table(recording, still(recording.object_poses["table"]))
    return with_gripper(there, still(recording.gripper_poses["left"]))


def spoiled_number(recording: Recording, what: str) -> Recording:
    if what == "pose":
        place = recording.object_poses["table"].position.copy()
        place[100] = np.nan
        return with_table(recording, replace(recording.object_poses["table"], position=place))
    force = recording.wrenches["left"].force.copy()
    force[600, 1] = np.nan
    return with_wrench(recording, force=force)


def back_in_time(recording: Recording) -> Recording:
    time = recording.wrenches["left"].time
    return with_wrench(recording, time=np.where(time > FROM, time - 0.503, time))


REFUSED: dict[str, tuple[Spoil, str]] = {
    "no motion": (unmoved, r"stays within \d+\.\d mm under up to \d+ N"),
    "no motion of the tracker": (lambda r: stopped_tracker(r, -1.0, 1e3), "poses that change.*had its tracker stopped"),
    "another tag": (lambda r: with_table(r, unmoved(r).object_poses["table"]), "table: expected it to go along"),
    "no wrench stream": (lambda r: replace(r, wrenches={}), "expected the wrench of the left gripper.*none"),
    "zero wrench": (
        lambda r: with_wrench(r, force=0.0 * r.wrenches["left"].force, torque=0.0 * r.wrenches["left"].torque),
        "zero throughout; was the sensor on",
    ),
    "one wrench throughout": (lambda r: stopped_sensor(r, -1.0, 1e3), "one reading throughout"),
    "nothing but noise": (nothing_felt, "no more than the sensor's noise"),
    "swapped": (swapped, "while chair goes along: are their poses swapped"),
    "swapped from the middle on": (lambda r: swapped(r, FROM), r"from t = 6\.\d+ s on, while chair goes along"),
    "swapped in a gap": (
        lambda r: swapped(
            replace(r, object_poses={name: without_poses(each) for name, each in r.object_poses.items()}), FROM
        ),
        r"from t = [68]\.\d+ s on, while chair goes along",
    ),
    "grasp of the wrong object": (
        lambda r: replace(r, grasps=tuple(replace(grasp, object="chair") for grasp in r.grasps)),
        "chair: expected it to go along.*while table goes along",
    ),
    "no poses": (lambda r: replace(r, object_poses={}), "expected poses of table, which is held, got those of none"),
    "not a number in a pose": (lambda r: spoiled_number(r, "pose"), "finite position"),
    "not a number in a wrench": (lambda r: spoiled_number(r, "wrench"), "finite"),
    "a clock that goes back": (back_in_time, "times in order"),
    "almost all is lost": (lambda r: stopped_sensor(r, HELD + 0.5, 1e3), "are lost: wrench of left gripper"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_in_one_line(sound: Recording, name: str) -> None:
    spoil, words = REFUSED[name]
    with pytest.raises((MismatchError, ModelError, BagError), match=words) as error:
        diagnose(spoil(sound))
    assert "\n" not in str(error.value)


LEFT_OUT: dict[str, tuple[Spoil, str, float]] = {
    "end of the range": (clipped, "torque z was at the end of its range", 0.0),
    "stopped sensor": (lambda r: stopped_sensor(r, FROM, TO), "the sensor had stopped", 2.0),
    "sensor that died": (lambda r: dead(r, 8.0), "the sensor had stopped", END - 8.0),
    "gap in wrenches": (without_wrench, "wrench of left gripper: none came", 2.0),
    "short gap in wrenches": (lambda r: without_wrench(r, 6.0, 6.4), "wrench of left gripper: none came", 0.4),
    "gap in poses": (
        lambda r: with_table(r, without_poses(r.object_poses["table"])), "pose of table: none came", 2.0
    ),
    "gap in the gripper's poses": (
        lambda r: with_gripper(r, without_poses(r.gripper_poses["left"])), "pose of left gripper: none came", 2.0
    ),
    "gap in all": (
        lambda r: without_wrench(with_table(r, without_poses(r.object_poses["table"]))), "none came", 2.0
    ),
    "stopped tracker": (lambda r: stopped_tracker(r, FROM, TO), "the tracker had stopped", 2.0),
}  # fmt: skip


def dead(recording: Recording, since: float) -> Recording:
    felt = recording.wrenches["left"]
    on = (felt.time < since)[:, None]
    return with_wrench(recording, force=felt.force * on, torque=felt.torque * on)


def spans(cuts: Cuts) -> Iterator[tuple[float, float]]:
    for start, steps in zip(cuts.start, cuts.span[:, 1], strict=True):
        yield float(start), float(start + steps * cuts.track.dt)


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_is_missing_is_named_and_no_window_holds_it(sound: Recording, name: str) -> None:
    spoil, words, seconds = LEFT_OUT[name]
    track = track_of(spoil(sound), "table")
    notes = missing_notes(track)
    assert notes and words in notes[0]
    lost = seconds_missing(track.motions, track.missing)
    assert lost >= 0.9 * seconds and (not seconds or lost < seconds + 0.5)
    for length in (0.5, 1.0, 2.0):
        cuts = cut_windows(track, length)
        assert cuts.seconds > 0.7 * (track.seconds - lost)
        for start, end in spans(cuts):
            assert not any(start < each.end - 1e-6 and end > each.start + 1e-6 for each in track.missing)


def test_readings_at_the_end_of_the_range_are_all_found(sound: Recording) -> None:
    true, track = sound.wrenches["left"], track_of(clipped(sound), "table")
    beyond = np.abs(true.torque[:, 2]) > 0.6 * np.abs(true.torque[:, 2]).max()
    assert beyond.sum() > 50
    for time in true.time[beyond & (true.time > HELD + 0.1)]:
        assert any(each.start <= time <= each.end for each in track.missing)


def test_a_force_that_turns_round_within_the_range_is_believed() -> None:
    time = np.arange(0.0, 20.0, 0.01)
    held = time > 2.0
    rng = np.random.default_rng(3)
    for noise, step, rate in ((0.0, 0.0, 1.0), (0.06, 0.125, 0.3), (0.06, 0.125, 2.0), (0.1, 0.001, 1.0)):
        columns = 20.0 * np.sin(rate * time[:, None] + np.arange(6)) * held[:, None]
        columns = columns + noise * rng.standard_normal(columns.shape)
        columns = np.round(columns / step) * step if step else columns
        assert not saturated(WrenchStream(time, columns[:, :3], columns[:, 3:]), held)
        columns[:, 1] = np.clip(columns[:, 1], -15.0, 15.0)
        assert set(saturated(WrenchStream(time, columns[:, :3], columns[:, 3:]), held)) == {"force y"}


def test_a_sound_recording_has_nothing_missing_and_the_same_windows(sound: Recording) -> None:
    track = track_of(sound, "table")
    assert track.missing == () and missing_notes(track) == ()
    cuts = cut_windows(track, 1.0)
    far = cut_windows(replace(track, missing=(Missing(100.0, 101.0, "later"),)), 1.0)
    for name in ("span", "told", "root", "pose", "weight", "place"):
        np.testing.assert_array_equal(getattr(cuts, name), getattr(far, name))


def test_windows_on_both_sides_are_those_of_the_episode_they_are_in(sound: Recording) -> None:
    track = replace(track_of(sound, "table"), missing=(Missing(6.0, 7.0, "a gap"),))
    cuts = cut_windows(track, 1.0)
    assert np.all(cuts.span[:, 2] == 0) and np.all(cuts.span[:, 3] == track.last[0])
    np.testing.assert_allclose(cuts.start, track.clock[cuts.span[:, 0]], atol=1e-9)
    edges = sorted(spans(cuts))
    assert all(b[0] - a[1] > -1e-9 for a, b in pairwise(edges))
    after = int(np.argmin(np.where(cuts.start > 6.5, cuts.start, np.inf)))
    np.testing.assert_allclose(cuts.told[after], track.seen[cuts.span[after, 0]])  # in mid-motion, not at rest


def test_nothing_is_said_of_a_residual_where_the_wrench_is_missing(sound: Recording) -> None:
    track = track_of(without_wrench(sound), "table")
    found = residual_wrench(track, neutral_row(), size=1.0)
    inside = (found.time > FROM) & (found.time < TO)
    assert np.all(found.world[inside] == 0.0) and np.all(found.significance[inside] == 0.0)
    assert np.all(found.covariance[inside, 0, 0] > 1e5) and np.all(found.covariance[~inside][:300, 0, 0] < 1e5)
    grips = lay_grips(without_wrench(sound), track)
    assert grips is not None and not np.any((grips.time > FROM) & (grips.time < TO))


def test_what_stands_still_without_noise_has_not_stopped() -> None:
    time = np.arange(0.0, 10.0, 0.05)
    way = CubicSpline([0.0, 4.0, 7.0, 10.0], [0.0, 0.0, 0.3, 0.9], bc_type="clamped")(np.maximum(time, 4.0))
    place = np.stack([way - way[0], np.zeros_like(way), np.zeros_like(way)], -1)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    assert stopped_poses(PoseStream(time, place, turn)) == []
    noisy = place + 0.002 * np.random.default_rng(0).standard_normal(place.shape)
    noisy[100:120] = noisy[100]
    assert stopped_poses(PoseStream(time, noisy, turn)) == [(100, 119)]
    coarse = np.round(place, 2)  # repeats itself all the time: nothing can be said
    assert stopped_poses(PoseStream(time, coarse, turn)) == []
    still = np.repeat([[1.0, 2.0, 3.0]], len(time), 0)
    assert stopped_wrenches(WrenchStream(time, still, still)) == []  # a perfect sensor that feels the same always


QUICK = {"draws": 40, "baseline": ("wheel",), "workers": 1}


def test_a_clean_recording_with_its_sensor_at_its_end_is_still_clean(sound: Recording, tmp_path: Path) -> None:
    """Through a real bag: a torque that is clipped is no friction, and the report says what was left out."""
    bag = write_recording(clipped(sound), tmp_path / "bag")
    few = tuple(name for name in DiagnoseOptions().effects if name not in ("viscous_drag", "wrench_bias"))
    found = diagnose(read_recording(bag), DiagnoseOptions(without=few, **QUICK)).objects["table"]
    assert not found.mismatch and not found.effects
    assert any("at the end of its range" in note for note in found.notes)


def test_a_whole_track_is_as_before(sound: Recording) -> None:
    track = track_of(sound, "table")
    assert isinstance(track, Track) and track.seconds == pytest.approx(END - HELD, abs=0.1)
