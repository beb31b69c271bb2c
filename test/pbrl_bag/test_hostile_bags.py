"""Bags that somebody made to break what reads them: small files that claim to be huge, names that lead elsewhere."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.writer import CompressionType, Writer

from pbrl_bag import BagError, read_recording
from pbrl_bag.foreign_bag import ForeignBag
from pbrl_bag.mcap_file import LARGEST_CHUNK, MAGIC, McapFile
from pbrl_bag.ros.conversions import message_class


def chunk(compression: str, data: bytes, says: int) -> bytes:
    """Return an MCAP of one chunk that says how large it is."""
    name = compression.encode()
    body = bytes(16) + says.to_bytes(8, "little") + bytes(4) + len(name).to_bytes(4, "little") + name
    body += len(data).to_bytes(8, "little") + data
    return MAGIC + b"\x06" + len(body).to_bytes(8, "little") + body


@pytest.mark.parametrize("says", [100, 2**32, 2**63])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_unpacks_to_gigabytes_is_refused(compression: str, says: int, tmp_path: Path) -> None:
    if compression == "zstd":
        packer = zstandard.ZstdCompressor().compressobj(size=LARGEST_CHUNK + (1 << 20))
        zeros = bytes(1 << 20)
        packed = b"".join(packer.compress(zeros) for _ in range((LARGEST_CHUNK >> 20) + 1)) + packer.flush()
    else:
        packed = lz4.frame.compress(bytes(1 << 22))
    (tmp_path / "x.mcap").write_bytes(chunk(compression, packed, says))
    with pytest.raises(BagError, match="a record is damaged"):
        list(McapFile(tmp_path / "x.mcap").messages())


def test_many_chunks_that_unpack_to_a_hundred_times_the_file_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pbrl_bag.mcap_file.FREE", 1 << 20)
    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=1 << 18)
    writer.start()
    channel = writer.register_channel("/x", "cdr", writer.register_schema("x", "ros2msg", b""))
    for stamp in range(400):
        writer.add_message(channel, stamp, bytes(1 << 16), stamp)
    writer.finish()
    (tmp_path / "x.mcap").write_bytes(file.getvalue())
    with pytest.raises(BagError, match="times its size"):
        list(McapFile(tmp_path / "x.mcap").messages())


@pytest.mark.parametrize("name", ["../other/x.mcap", "/etc/hostname", "a/../../x.mcap", "x\0.mcap"])
def test_a_bag_s_metadata_names_files_of_the_bag_only(name: str, push_bag: Path) -> None:
    path = push_bag / "metadata.yaml"
    said = yaml.safe_load(path.read_text())
    said["rosbag2_bagfile_information"]["relative_file_paths"] = [name]
    path.write_text(yaml.safe_dump(said))
    with pytest.raises(BagError, match="files in the bag's folder"):
        read_recording(push_bag)


@pytest.mark.parametrize(
    "kind", ["antigravity/msg/Pose", "os/msg/path", "../x/msg/Y", "\0/msg/X", "std_msgs/msg/Nothing"]
)
def test_a_type_s_name_loads_no_module_but_messages(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`antigravity` is a module of Python's own that opens a browser."""
    loaded: list[str] = []
    monkeypatch.setattr("pbrl_bag.ros.conversions.importlib.import_module", lambda name: loaded.append(name))
    with pytest.raises(BagError, match="expected it in package"):
        message_class(kind)
    assert loaded in ([], ["std_msgs.msg"])


def test_a_damaged_ros_1_bag_is_refused(tmp_path: Path) -> None:
    """The reader's own error is no `AnyReaderError`."""
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n" + b"\x45\0\0\0" + b"\xff" * 100)
    with pytest.raises(BagError, match="expected a ROS 1 bag"):
        list(ForeignBag(tmp_path / "x.bag").messages())


def test_a_schema_whose_header_has_no_stamp_is_refused(kit: SimpleNamespace, tmp_path: Path) -> None:
    """A stranger's type of a known name can have other fields."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start()
    text = "std_msgs/Header header\ngeometry_msgs/Pose pose\n===\nMSG: std_msgs/Header\nuint8 x\n"
    text = "\n".join((text + "===\nMSG: geometry_msgs/Pose\nuint8 y\n").split("\n")).replace("===", "=" * 80)
    channel = writer.register_channel(
        "/ar_tags/table/pose", "cdr", writer.register_schema("geometry_msgs/msg/PoseStamped", "ros2msg", text.encode())
    )
    writer.add_message(channel, 0, b"\0\1\0\0\1\2", 0)
    writer.finish()
    (tmp_path / "x.mcap").write_bytes(file.getvalue())
    with pytest.raises(BagError, match="/ar_tags/table/pose"):
        read_recording(tmp_path / "x.mcap")
