"""Bags to recordings: whole, cut short anywhere, damaged, and not bags at all."""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from pbrl_bag import BagError, RecordingBuilder, describe, read_recording


def mcap_of(bag: Path) -> Path:
    return bag / f"{bag.name}_0.mcap"


def test_a_bag_reads_as_what_was_heard_live(kit: SimpleNamespace, push_bag: Path) -> None:
    live = RecordingBuilder()
    for topic, _, message, _ in kit.pushing():
        live.add(topic, message)
    heard, read = live.build(push_bag), read_recording(push_bag)
    for part in ("object_poses", "gripper_poses", "wrenches"):
        for name, stream in getattr(heard, part).items():
            other = getattr(read, part)[name]
            for field in vars(stream):
                np.testing.assert_array_equal(getattr(other, field), getattr(stream, field))
    assert repr(read.grasps) == repr(heard.grasps)
    assert repr(read.bodies) == repr(heard.bodies)


def test_folder_and_file_read_alike(push_bag: Path) -> None:
    folder, file = read_recording(push_bag), read_recording(mcap_of(push_bag))
    np.testing.assert_array_equal(folder.wrenches["left"].force, file.wrenches["left"].force)


def test_a_folder_without_metadata_is_read_by_its_files(push_bag: Path) -> None:
    (push_bag / "metadata.yaml").unlink()
    assert read_recording(push_bag).grasps


def test_every_cut_reads_up_to_there_or_says_why_not(kit: SimpleNamespace, tmp_path: Path) -> None:
    """Cut at every 1000th byte, and at each of the first 60: a recording or one line, never a traceback."""
    whole = mcap_of(kit.write(tmp_path / "whole", kit.pushing(12.0), chunk=40)).read_bytes()
    cut = tmp_path / "cut.mcap"
    counts = []
    for length in [*range(60), *range(1000, len(whole), 1000), len(whole)]:
        cut.write_bytes(whole[:length])
        try:
            counts.append(describe(cut).message_count)
            recording = read_recording(cut)
        except BagError as error:
            assert "\n" not in str(error)
            assert "cut.mcap" in str(error)
        else:
            assert length == len(whole) or any("not finished" in note for note in recording.notes)
    assert counts == sorted(counts)
    assert counts[-1] > 0


def test_what_a_cut_lost_is_said(kit: SimpleNamespace, tmp_path: Path) -> None:
    bag = kit.write(tmp_path / "bag", kit.pushing(), chunk=100)
    path = mcap_of(bag)
    whole = path.read_bytes()
    starts = [chunk.chunk_start_offset for chunk in make_reader(io.BytesIO(whole)).get_summary().chunk_indexes]
    path.write_bytes(whole[: starts[2] + 30])
    info = describe(bag)
    assert not info.finished
    assert info.message_count == 200
    (note,) = info.notes
    assert "2 chunks" in note
    assert "the last 30 bytes, an unfinished record of messages from" in note
    path.write_bytes(whole[: starts[2]])
    assert "no half chunk follows" in describe(bag).notes[0]


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_never_gives_a_traceback(push_bag: Path, where: float, bit: int) -> None:
    path = mcap_of(push_bag)
    whole = path.read_bytes()
    damaged = bytearray(whole)
    damaged[int(where * len(whole))] ^= 1 << bit
    copy = path.with_name("damaged.mcap")
    copy.write_bytes(bytes(damaged))
    try:
        read_recording(copy)
    except BagError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty one"),
        (b"\x89MC", "cut short"),
        (b"hello, world\n" * 10, "expected an MCAP file"),
        (b"\x89MCAP0\r\n", "expected messages, got none"),
        (b"#ROSBAG V2.0\n", "expected an MCAP file"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(BagError, match=words) as caught:
        read_recording(path)
    assert "odd.mcap" in str(caught.value)


def test_what_is_not_there_is_refused(tmp_path: Path, push_bag: Path) -> None:
    with pytest.raises(BagError, match="got nothing of that name"):
        read_recording(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="is it a bag"):
        read_recording(tmp_path / "empty")
    mcap_of(push_bag).unlink()
    with pytest.raises(BagError, match=r"push_0\.mcap, which metadata\.yaml names"):
        read_recording(push_bag)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("storage_identifier: mcap", "storage_identifier: paper", "ros2 bag convert"),
        ("rosbag2_bagfile_information", "something", "rosbag2_bagfile_information"),
        ("version: 9", "version: [9", "expected YAML"),
    ],
)
def test_metadata_of_another_kind_is_refused(push_bag: Path, old: str, new: str, words: str) -> None:
    path = push_bag / "metadata.yaml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(BagError, match=words):
        read_recording(push_bag)


def test_a_bag_without_messages_is_refused(kit: SimpleNamespace, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="expected messages, got none"):
        read_recording(kit.write(tmp_path / "silent", []))


def test_a_message_that_does_not_decode_is_named_by_topic_and_time(kit: SimpleNamespace, tmp_path: Path) -> None:
    messages = [*kit.pushing(), ("/wrist_ft/left", "geometry_msgs/msg/WrenchStamped", b"\x00\x01\x00\x00\x01", 10**9)]
    with pytest.raises(BagError, match=r"/wrist_ft/left: t = 1\.000000 s: expected a geometry_msgs/msg/WrenchStamped"):
        read_recording(kit.write(tmp_path / "bad", messages))


@pytest.mark.parametrize(
    ("topic", "change", "words"),
    [
        ("/wrist_ft/left", {"fx": float("nan")}, ["t = 2.000000 s", "force.x", "nan"]),
        ("/ar_tags/table/pose", {"x": 5.0}, ["t = 2.040000 s", "position", "jumps"]),
        ("/ar_tags/table/pose", {"yaw": 3.5}, ["t = 2.040000 s", "orientation", "jumps"]),
    ],
)
def test_a_bad_sample_in_a_bag_is_named(
    kit: SimpleNamespace, tmp_path: Path, topic: str, change: dict, words: list[str]
) -> None:
    messages = []
    for name, kind, message, at in kit.pushing():
        if name == topic and at >= 2_000_000_000 and change:
            seconds = at / 1e9
            message = kit.wrench(seconds, **change) if "fx" in change else kit.pose(seconds, **change)
            change = {}
        messages.append((name, kind, message, at))
    with pytest.raises(BagError) as caught:
        read_recording(kit.write(tmp_path / "bad", messages))
    assert "\n" not in str(caught.value)
    for word in [topic, *words]:
        assert word in str(caught.value)


def test_a_clock_that_was_reset_is_named(kit: SimpleNamespace, tmp_path: Path) -> None:
    messages = [(name, kind, message, at) for name, kind, message, at in kit.pushing()]
    again = [(name, kind, message, at + 10**10) for name, kind, message, at in messages]
    with pytest.raises(BagError, match=r"stamp: time goes backwards"):
        read_recording(kit.write(tmp_path / "reset", messages + again))


def test_a_bag_copied_under_another_name_still_reads(push_bag: Path, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere"
    shutil.copytree(push_bag, copy)
    assert read_recording(copy).grasps
