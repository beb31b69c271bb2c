"""Messages that are decoded together are what they are one by one; whatever lies otherwise is left alone."""

from __future__ import annotations

import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pbrl_bag import BagError, BagWriter, RecordingBuilder, read_recording
from pbrl_bag.batches import batch_of
from pbrl_bag.encoding import Encoder
from pbrl_bag.reader import Decoder

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"


def header(time: float, frame: str) -> SimpleNamespace:
    seconds, rest = divmod(round(time * 1e9), 10**9)
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=rest), frame_id=frame)


def xyz(values: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(x=float(values[0]), y=float(values[1]), z=float(values[2]))


def pose(time: float, frame: str, values: np.ndarray) -> SimpleNamespace:
    turn = SimpleNamespace(x=float(values[3]), y=float(values[4]), z=float(values[5]), w=float(values[6]))
    return SimpleNamespace(header=header(time, frame), pose=SimpleNamespace(position=xyz(values[:3]), orientation=turn))


def wrench(time: float, frame: str, values: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(
        header=header(time, frame), wrench=SimpleNamespace(force=xyz(values[:3]), torque=xyz(values[3:]))
    )


@pytest.mark.parametrize("frame", ["", "w", "world", "/world", "left_ft", "a frame of some length", "стол"])
@pytest.mark.parametrize(("kind", "make", "count"), [(POSE, pose, 7), (WRENCH, wrench, 6)])
def test_together_is_one_by_one(frame: str, kind: str, make: object, count: int) -> None:
    rng = np.random.default_rng(3)
    values, times = rng.normal(size=(20, count)), np.cumsum(rng.uniform(0.001, 3.0, 20)) + 1.7e9
    values[3, 0], values[4, 1] = np.nan, np.inf
    data = [Encoder().encode(kind, make(t, frame, row)) for t, row in zip(times, values, strict=True)]  # type: ignore[operator]
    found = batch_of(kind, data)
    assert found is not None and found.frame == frame.lstrip("/")
    assert np.array_equal(found.values, values, equal_nan=True)
    assert np.array_equal(found.time, [float(round(t * 1e9) // 10**9) + (round(t * 1e9) % 10**9) / 1e9 for t in times])


def test_what_lies_otherwise_is_left_to_the_schema() -> None:
    encode = Encoder().encode
    one, other = (encode(POSE, pose(1.0, frame, np.ones(7))) for frame in ("world", "floor"))
    assert batch_of(POSE, [one, other]) is None, "two frames of one length"
    assert batch_of(POSE, [one, encode(POSE, pose(1.0, "map", np.ones(7)))]) is None
    assert batch_of(POSE, [b"\x00\x00" + one[2:]]) is None, "big endian"
    assert batch_of(POSE, [one[:-1]]) is None and batch_of(POSE, [one + b"\x00"]) is None
    assert batch_of(POSE, [one[:12] + struct.pack("<I", 2**31) + one[16:]]) is None, "a frame of two gigabytes"
    assert batch_of(POSE, [one[:12] + struct.pack("<I", 0) + one[16:]]) is None
    assert (
        batch_of(POSE, [b""]) is None and batch_of(POSE, []) is None and batch_of("std_msgs/msg/String", [one]) is None
    )


def test_a_bag_is_read_the_same_together_and_one_by_one(
    make_recorded_bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = read_recording(make_recorded_bag)
    monkeypatch.setattr("pbrl_bag.reader.batch_of", lambda *_: None)
    single = read_recording(make_recorded_bag)
    assert together.notes == single.notes and together.grasps[0].start == single.grasps[0].start
    for name, stream in single.object_poses.items():
        other = together.object_poses[name]
        for column in ("time", "position", "quaternion"):
            assert np.array_equal(getattr(stream, column), getattr(other, column))
    assert np.array_equal(together.wrenches["left"].force, single.wrenches["left"].force)


def test_a_stranger_s_type_of_that_name_is_not_taken_for_ours(
    make_recorded_bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    decode = Decoder.decode

    def swapped(self: Decoder, message: object) -> object:
        found = decode(self, message)  # type: ignore[arg-type]
        if hasattr(found, "wrench"):
            found = SimpleNamespace(
                header=found.header, wrench=SimpleNamespace(force=found.wrench.torque, torque=found.wrench.force)
            )
        return found

    monkeypatch.setattr(Decoder, "decode", swapped)
    read = read_recording(make_recorded_bag)
    assert np.allclose(read.wrenches["left"].torque[:, 0], 5.0), "by the schema, not by the place of the bytes"


@pytest.fixture
def make_recorded_bag(tmp_path: Path) -> Path:
    """A body that stands, held by a gripper that feels five newtons."""
    still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    corners = [xyz(np.array([x, y, 0.0])) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    body = SimpleNamespace(
        name="box", footprint=corners, height=1.0, nominal_mass=5.0, movable=True,
        pose=SimpleNamespace(x=0.0, y=0.0, theta=0.0), casters=[],
    )  # fmt: skip
    held = SimpleNamespace(gripper="left", object="box", contact_point=xyz(np.zeros(3)))
    with BagWriter(tmp_path / "bag", live=False) as bag:
        bag.write(
            "/scene", "pbrl_msgs/msg/Scene", SimpleNamespace(header=header(0, "world"), bodies=[body], room=[]), 0
        )
        bag.write("/grasps", "pbrl_msgs/msg/Grasps", SimpleNamespace(header=header(0, ""), grasps=[held]), 0)
        for k in range(40):
            time = 0.05 * k
            at = round(time * 1e9)
            bag.write("/ar_tags/box/pose", POSE, pose(time, "world", np.array([0.001 * k, *still[1:]])), at)
            bag.write("/ar_tags/left_gripper/pose", POSE, pose(time, "world", still), at)
            bag.write("/wrist_ft/left", WRENCH, wrench(time, "left_ft", np.array([5.0, 0, 0, 0, 0, 0.1])), at)
    return tmp_path / "bag"


def test_what_is_missing_is_told_where_that_is_asked_for() -> None:
    builder = RecordingBuilder()
    for k in range(3):
        builder.add("/wrist_ft/left", wrench(0.1 * k, "left_ft", np.ones(6)))
    with pytest.raises(BagError, match="scene"):
        builder.build("x")
    found = builder.build("x", complete=False)
    assert not found.bodies and not found.object_poses and len(found.wrenches["left"].time) == 3
    assert [note for note in found.notes if "pose of an object" in note] and len(found.notes) == 3


def test_nothing_at_all_is_an_error_even_so() -> None:
    with pytest.raises(BagError, match="expected topic"):
        RecordingBuilder().build("x", complete=False)


def test_other_topics_are_told_of_in_order(make_recorded_bag: Path) -> None:
    heard: list[float] = []
    read_recording(make_recorded_bag, also={"/ar_tags/box/pose": lambda m: heard.append(m.pose.position.x)})
    assert np.allclose(heard, 0.001 * np.arange(40))
