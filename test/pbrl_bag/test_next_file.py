"""A live recording of several files: nothing is lost between them, whatever ends it, and no index grows with it."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from pbrl_bag import BagError, BagWriter, Qos, describe
from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import files_of_bag, read_metadata
from pbrl_bag.playback import load_bag

STRING = "std_msgs/msg/String"
QOS = Qos(depth=3, reliability="best_effort")
PATIENCE = 60.0  # [s]

DIES = """
import os, sys
from types import SimpleNamespace
from pbrl_bag import BagWriter, bag_file, writer
folder, step = sys.argv[1:]
target, name = {
    "making it": (bag_file.Writer, "start"), "naming it": (writer, "write_metadata"),
    "announcing": (bag_file.BagFile, "announce"), "finishing": (bag_file.BagFile, "finish"),
}[step]
done = getattr(target, name)
bag = BagWriter(folder, file_chunks=1)
def say(k):
    bag.write("/say", "std_msgs/msg/String", SimpleNamespace(data=str(k)), k)
def die(*arguments, **options):
    if bag.message_count and len(os.listdir(folder)) > 2:
        os._exit(9)
    return done(*arguments, **options)
say(0)
setattr(target, name, die)
for k in range(1, 50):
    say(k)
bag.flush()
while True:
    pass
"""


def _until_files(bag: BagWriter, many: int, number: Iterator[int]) -> None:
    """Write until the bag's file of that number has a message."""
    deadline = time.monotonic() + PATIENCE
    while not bag.path.name.endswith(f"_{many}.mcap"):
        assert time.monotonic() < deadline, f"{bag.path} is still the last file"
        _say(bag, number)
        time.sleep(0.01)
    _say(bag, number)


def _say(bag: BagWriter, number: Iterator[int]) -> None:
    k = next(number)
    bag.write("/say" if k % 3 else "/other", STRING, SimpleNamespace(data=f"{k}"), k, k + 1)


def _times(folder: Path) -> list[int]:
    return [message.log_time for name in files_of_bag(folder) for message in McapFile(name).messages()]


def test_several_files_are_one_recording(tmp_path: Path) -> None:
    folder, number = tmp_path / "bag", iter(range(10**6))
    with BagWriter(folder, file_chunks=1) as bag:
        bag.add_topic("/say", STRING, [QOS])
        bag.add_topic("/silent", STRING)
        _until_files(bag, 2, number)
        before_the_last = [McapFile(name) for name in files_of_bag(folder)[:-1]]
        assert all(list(file.messages()) for file in before_the_last)
        assert any(file.finished for file in before_the_last), "finished while it is recorded"
    written = next(number)
    assert [name.name for name in files_of_bag(folder)] == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert _times(folder) == list(range(written))
    assert [m.log_time for m in load_bag(folder).messages] == list(range(written))
    info = describe(folder)
    assert info.finished and not info.notes and info.message_count == written
    assert next(topic for topic in info.topics if topic.name == "/say").qos == (QOS,)
    with Reader(folder) as reader:
        assert [stamp for _, stamp, _ in reader.messages()] == list(range(written))


def test_metadata_says_what_each_file_holds_and_each_file_says_it_of_itself(tmp_path: Path) -> None:
    folder, number = tmp_path / "bag", iter(range(10**6))
    with BagWriter(folder, file_chunks=2) as bag:
        _until_files(bag, 1, number)
    whole = read_metadata(folder)
    assert whole["message_count"] == next(number) == sum(file["message_count"] for file in whole["files"])
    assert whole["duration"] == {"nanoseconds": whole["message_count"] - 1}
    for name, entry in zip(files_of_bag(folder), whole["files"], strict=True):
        times = [message.log_time for message in McapFile(name).messages()]
        span = {"duration": {"nanoseconds": times[-1] - times[0]}}
        span["starting_time"] = {"nanoseconds_since_epoch": times[0]}
        assert entry == {"path": name.name, **span, "message_count": len(times)}
        with name.open("rb") as file:
            reader = make_reader(file)
            (record,) = reader.iter_metadata()
            summary = reader.get_summary()
        own = yaml.safe_load(record.metadata["serialized_metadata"])
        assert own["files"] == [entry] and own["relative_file_paths"] == [name.name]
        assert sum(topic["message_count"] for topic in own["topics_with_message_count"]) == len(times)
        # Two chunks fill a file. A slow machine finishes one more as the next file is made, and one as it takes over.
        assert summary is not None and len(summary.chunk_indexes) <= 4, "the index is what a recorder's memory holds"
        assert {channel.topic for channel in summary.channels.values()} == {"/say", "/other"}


def test_a_recording_that_is_not_live_is_one_file(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", live=False, file_chunks=1) as bag:
        for number in range(5):
            _say(bag, iter([number]))
            bag.flush()
    assert [name.name for name in files_of_bag(tmp_path / "bag")] == ["bag_0.mcap"]


@pytest.mark.parametrize("step", ["making it", "naming it", "announcing", "finishing"])
def test_who_dies_between_two_files_loses_nothing_of_finished_chunks(tmp_path: Path, step: str) -> None:
    folder = tmp_path / "bag"
    died = subprocess.run([sys.executable, "-c", DIES, str(folder), step], timeout=PATIENCE, check=False)
    assert died.returncode == 9, "it died where it was to"
    assert _times(folder) == list(range(50))
    assert int(read_metadata(folder)["message_count"]) <= 50
    assert describe(folder).message_count == 50


def test_a_disk_that_is_full_at_the_next_file_keeps_the_one_before(
    tmp_path: Path, little_room: Callable[[int], AbstractContextManager[None]]
) -> None:
    bag, number = BagWriter(tmp_path / "bag", file_chunks=1), iter(range(10**6))
    _say(bag, number)
    bag.flush()
    deadline = time.monotonic() + PATIENCE
    with little_room(1), pytest.raises(BagError, match="File too large; the") as caught:
        while time.monotonic() < deadline:
            _say(bag, number)
    kept = _times(bag.folder)
    assert kept == list(range(len(kept))) and f"the {len(kept)} messages" in str(caught.value)
    assert len(kept) >= 1
    with pytest.raises(BagError, match="File too large"):
        bag.close()


def test_a_footer_that_finds_no_room_leaves_the_chunks(
    tmp_path: Path, little_room: Callable[[int], AbstractContextManager[None]]
) -> None:
    for part in ("whole", "full"):
        bag = BagWriter(tmp_path / part, live=False)
        for number in range(20):
            _say(bag, iter([number]))
            bag.flush()
        if part == "whole":
            bag.close()
            room = bag.path.stat().st_size - 10
        else:
            with little_room(room), pytest.raises(BagError, match=r"File too large; the 20 messages"):
                bag.close()
    assert _times(tmp_path / "full") == list(range(20))
    assert not describe(tmp_path / "full").finished


def test_a_disk_that_is_full_from_the_start_is_said(
    tmp_path: Path, little_room: Callable[[int], AbstractContextManager[None]]
) -> None:
    with little_room(1), pytest.raises(BagError, match="cannot write: File too large; nothing is recorded"):
        BagWriter(tmp_path / "bag")
    assert not list(tmp_path.glob("bag/*"))
