"""Bags as others read them: `rosbags` and its rosbag2 reader; metadata of Jazzy; what a crash leaves."""

from __future__ import annotations

import filecmp
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import String

from pbrl_bag import BagError, BagWriter, Qos, describe
from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import read_metadata
from pbrl_bag.schema import dependencies, message_text

STRING = "std_msgs/msg/String"
LATCHED = {"/scene", "/grasps"}


def test_rosbags_decodes_every_message(kit: SimpleNamespace, push_bag: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in ("pbrl_msgs/msg/Scene", "pbrl_msgs/msg/Grasps"):
        for each in (name, *dependencies(name)):
            if each not in store.types:
                store.register(get_types_from_msg(message_text(each), each))
    written = {}
    for topic, _, _, _ in kit.pushing():
        written[topic] = written.get(topic, 0) + 1
    read: dict[str, int] = {}
    forces = []
    with Reader(push_bag) as reader:
        assert reader.ros_distro == "jazzy"
        for connection, _, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            read[connection.topic] = read.get(connection.topic, 0) + 1
            if connection.topic == "/wrist_ft/left":
                forces.append(message.wrench.force.x)
        for connection in reader.connections:
            (qos,) = connection.ext.offered_qos_profiles
            latched = qos.durability == QosDurability.TRANSIENT_LOCAL
            assert latched == (connection.topic in LATCHED)
    assert read == written
    assert forces == [10.0 + i / 50 for i in range(200)]


def test_metadata_is_of_version_9_as_jazzy_writes_it(push_bag: Path) -> None:
    information = yaml.safe_load((push_bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["ros_distro"] == "jazzy"
    assert information["relative_file_paths"] == ["push_0.mcap"]
    assert information["starting_time"] == {"nanoseconds_since_epoch": 0}
    assert information["duration"] == {"nanoseconds": 3_980_000_000}
    (file,) = information["files"]
    topics = information["topics_with_message_count"]
    total = sum(topic["message_count"] for topic in topics)
    assert information["message_count"] == file["message_count"] == total == describe(push_bag).message_count
    by_name = {topic["topic_metadata"]["name"]: topic["topic_metadata"] for topic in topics}
    assert by_name["/scene"]["offered_qos_profiles"] == [
        {
            "history": "keep_last",
            "depth": 1,
            "reliability": "reliable",
            "durability": "transient_local",
            "deadline": {"sec": 9223372036, "nsec": 854775807},
            "lifespan": {"sec": 9223372036, "nsec": 854775807},
            "liveliness": "automatic",
            "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
            "avoid_ros_namespace_conventions": False,
        }
    ]
    for topic in by_name.values():
        assert topic["serialization_format"] == "cdr"
        assert topic["type_description_hash"].startswith("RIHS01_")


def test_the_file_alone_says_the_same_as_the_folder(push_bag: Path) -> None:
    written = yaml.safe_load((push_bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    with (push_bag / "push_0.mcap").open("rb") as file:
        reader = make_reader(file)
        (record,) = reader.iter_metadata()
        summary = reader.get_summary()
    assert record.name == "rosbag2"
    assert yaml.safe_load(record.metadata["serialized_metadata"]) == written
    assert summary is not None
    assert summary.statistics.message_count == written["message_count"]
    for channel in summary.channels.values():
        assert set(channel.metadata) == {"offered_qos_profiles", "topic_type_hash"}
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}


def test_the_same_messages_make_the_same_bytes(kit: SimpleNamespace, tmp_path: Path) -> None:
    for part in ("one", "two"):
        kit.write(tmp_path / part / "bag", kit.pushing())
    for name in ("bag_0.mcap", "metadata.yaml"):
        assert filecmp.cmp(tmp_path / "one/bag" / name, tmp_path / "two/bag" / name, shallow=False)


def test_a_folder_that_exists_is_not_touched(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="expected a new folder") as caught:
        BagWriter(tmp_path)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="cannot make this folder"):
        BagWriter(tmp_path / "file" / "bag")


def test_what_was_flushed_can_be_read_before_the_end(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", live=False)
    for i in range(5):
        writer.write("/say", STRING, String(data=str(i)), i)
    assert describe(writer.path).message_count == 0
    writer.flush()
    file = McapFile(writer.path)
    assert len(list(file.messages())) == 5
    assert not file.finished
    assert yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())  # there from the start
    writer.close()
    assert describe(tmp_path / "bag").finished


def test_closing_twice_is_fine_and_writing_afterwards_is_not(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.write("/say", STRING, String(data="x"), 1)
        writer.close()
    with pytest.raises(BagError, match="expected an open bag"):
        writer.write("/say", STRING, String(data="x"), 2)
    assert writer.message_count == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("/say", "std_msgs/msg/Strong", String(), 1), "std_msgs/msg/Strong"),
        (("/say", STRING, 3.0, 1), "/say: expected a std_msgs/msg/String"),
    ],
)
def test_a_message_that_cannot_be_written_is_refused(tmp_path: Path, arguments: tuple, words: str) -> None:
    with BagWriter(tmp_path / "bag") as writer, pytest.raises(BagError, match=words):
        writer.write(*arguments)


def test_one_topic_has_one_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.write("/say", STRING, String(data="x"), 1)
        with pytest.raises(BagError, match=r"/say: expected one type, got std_msgs/msg/String before"):
            writer.write("/say", "std_msgs/msg/Empty", b"\x00\x01\x00\x00\x00", 2)


def test_qos_given_for_a_topic_is_kept(tmp_path: Path) -> None:
    offered = [Qos(depth=3, reliability="best_effort"), Qos(history="unknown", depth=0, lifespan=10_000_000_000)]
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/say", STRING, offered)
        writer.write("/say", STRING, String(data="x"), 1)
    (topic,) = describe(tmp_path / "bag").topics
    assert list(topic.qos) == offered


@pytest.mark.parametrize("flushed", [True, False])
def test_a_bag_on_a_full_disk_keeps_what_it_has_and_says_the_same_ever_after(
    tmp_path: Path, little_room: Callable[[int], AbstractContextManager[None]], flushed: bool
) -> None:
    noise = np.random.default_rng(0)
    bag = BagWriter(tmp_path / "bag", live=False)
    with little_room(200_000), pytest.raises(BagError, match="cannot write: File too large; the") as caught:
        for k in range(1000):
            bag.write("/noise", "std_msgs/msg/String", SimpleNamespace(data=noise.bytes(2000).hex()), k)
            if flushed:
                bag.flush()
    messages = list(McapFile(bag.path).messages())
    assert f"the {len(messages)} messages" in str(caught.value)
    assert [message.log_time for message in messages] == list(range(len(messages)))
    assert len(messages) >= 50 if flushed else not messages
    # There is room again: nothing is written behind what is missing.
    again = partial(bag.write, "/noise", "std_msgs/msg/String", SimpleNamespace(data="x"), 0)
    for what in (bag.flush, again, bag.close):
        with pytest.raises(BagError, match=re.escape(str(caught.value))):
            what()
    assert read_metadata(bag.folder)["message_count"] == len(messages), "what was in work is not promised"
    assert list(McapFile(bag.path).messages()) == messages
    assert not list(bag.folder.glob(".*")), "no half of a metadata.yaml is left"
