"""Bags that other tools wrote: SQLite and ROS 1 give the same recording; what is broken is said in a line."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pbrl_bag import BagError, Recording, describe, read_recording
from pbrl_bag.foreign_bag import OURS, known_types
from pbrl_bag.playback import load_bag
from pbrl_bag.schema import dependencies, message_text


def sqlite(folder: Path, messages: list) -> Path:
    """Write what Humble would have: SQLite."""
    store, connections = known_types(), {}
    with Writer2(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for topic, kind, message, stamp in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp, serialize_message(message))
    return folder


def ros1(path: Path, messages: list) -> Path:
    """Write what Noetic would have."""
    store, connections = get_typestore(Stores.ROS1_NOETIC), {}
    for name in OURS:
        for each in (*dependencies(name), name):
            if each not in store.fielddefs:
                store.register(get_types_from_msg(message_text(each), each))
    ours = known_types()
    with Writer1(path) as writer:
        for topic, kind, message, stamp in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            data = ours.cdr_to_ros1(serialize_message(message), kind)
            writer.write(connections[topic], stamp, data)
    return path


@pytest.fixture(params=["sqlite", "db3", "ros1"])
def foreign(request: pytest.FixtureRequest, kit: SimpleNamespace, tmp_path: Path) -> Path:
    if request.param == "ros1":
        return ros1(tmp_path / "old.bag", kit.pushing())
    folder = sqlite(tmp_path / "humble", kit.pushing())
    return folder if request.param == "sqlite" else next(folder.glob("*.db3"))


def same(one: Recording, other: Recording) -> None:
    for part in ("object_poses", "gripper_poses", "wrenches"):
        assert set(getattr(one, part)) == set(getattr(other, part))
        for name, stream in getattr(one, part).items():
            for field in vars(stream):
                np.testing.assert_array_equal(getattr(getattr(other, part)[name], field), getattr(stream, field))
    assert repr(one.grasps) == repr(other.grasps)
    assert repr(one.bodies) == repr(other.bodies)


def test_other_storages_give_the_same_recording(foreign: Path, push_bag: Path) -> None:
    same(read_recording(push_bag), read_recording(foreign))


def test_other_storages_are_described(foreign: Path, push_bag: Path) -> None:
    one, other = describe(push_bag), describe(foreign)
    assert other.message_count == one.message_count
    assert other.duration == one.duration
    assert [(each.name, each.type, each.count) for each in other.topics] == [
        (each.name, each.type, each.count) for each in one.topics
    ]
    assert other.finished


def test_only_mcap_is_played(foreign: Path) -> None:
    with pytest.raises(BagError, match="play it with `ros2 bag play`"):
        load_bag(foreign)


@pytest.mark.parametrize("name", ["stranger.bag", "stranger.db3"])
@pytest.mark.parametrize("content", [b"", b"#ROSBAG V2.0\n", b"SQLite format 3\x00" + 84 * b"\x01", 999 * b"\xff"])
def test_what_is_no_bag_is_said_in_a_line(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BagError) as told:
        read_recording(tmp_path / name)
    assert "\n" not in str(told.value)
    assert name in str(told.value)


def test_a_bag_that_was_cut_short_is_said_in_a_line(foreign: Path, tmp_path: Path) -> None:
    whole = foreign if foreign.is_file() else next(foreign.glob("*.db3"))
    content = whole.read_bytes()
    for share in (0.1, 0.5, 0.9):
        cut = tmp_path / f"cut{whole.suffix}"
        cut.write_bytes(content[: int(share * len(content))])
        with pytest.raises(BagError) as told:
            read_recording(cut)
        assert "\n" not in str(told.value)


def test_a_compressed_sqlite_bag_is_refused_with_what_to_do(kit: SimpleNamespace, tmp_path: Path) -> None:
    folder = sqlite(tmp_path / "humble", kit.pushing())
    metadata = folder / "metadata.yaml"
    metadata.write_text(
        metadata.read_text()
        .replace("compression_mode: ''", "compression_mode: FILE")
        .replace('compression_mode: ""', "compression_mode: FILE")
    )
    with pytest.raises(BagError, match="ros2 bag convert"):
        read_recording(folder)


def test_a_folder_without_metadata_is_read_by_its_files(kit: SimpleNamespace, tmp_path: Path) -> None:
    folder = sqlite(tmp_path / "humble", kit.pushing())
    (folder / "metadata.yaml").unlink()
    assert read_recording(folder).grasps
    shutil.rmtree(folder)
    with pytest.raises(BagError, match="nothing of that name"):
        read_recording(folder)
