"""Bags of other storages, through the library `rosbags`: SQLite, as ROS 2 recorded until Iron, and ROS 1."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import apsw
import zstandard
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as Ros1ReaderError
from rosbags.rosbag2 import ReaderError as Ros2ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from pbrl_bag.errors import BagError
from pbrl_bag.mcap_file import RawMessage
from pbrl_bag.schema import dependencies, message_text

ROS1, SQLITE = ".bag", ".db3"
"""Endings of the files of the other storages."""
OURS = ("pbrl_msgs/msg/Scene", "pbrl_msgs/msg/Grasps")
"""Types that older bags do not describe, and no store of common types knows."""
_UNREADABLE = (
    AnyReaderError,
    Ros1ReaderError,
    Ros2ReaderError,
    SerdeError,
    TypesysError,
    apsw.Error,
    OSError,
    ValueError,
    LookupError,
    EOFError,
    RuntimeError,
    struct.error,
    zstandard.ZstdError,
    AssertionError,
    TypeError,
    AttributeError,
    ArithmeticError,
    MemoryError,
)
"""What a stranger's file can end a reader with."""


@dataclass
class ForeignBag:
    """A ROS 1 bag, an SQLite file, or a bag folder with SQLite in it.

    Attributes:
        path: file or folder.
        finished: whether it was closed; one that was not is refused by the library.
        notes: sentences on what was lost: none.
    """

    path: Path
    finished: bool = True
    notes: list[str] = field(default_factory=list)
    _reader: AnyReader | None = None

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message in order of log time; `channel` counts connections.

        Raises:
            BagError: not such a bag, or a damaged one.
        """
        try:
            with AnyReader([self.path], default_typestore=known_types()) as reader:
                self._reader = reader
                for connection, stamp, data in reader.messages():
                    yield RawMessage(connection.topic, connection.msgtype, stamp, stamp, data, connection.id)
        except _UNREADABLE as error:
            raise BagError(
                f"{self.path}: expected a ROS 1 bag or an SQLite bag of ROS 2, got: {_line(error)}; "
                "was it closed? `rosbag reindex` or `ros2 bag reindex` repairs one that was not"
            ) from error

    def decode(self, message: RawMessage) -> Any:
        """Decode one message while `messages` is under way.

        Raises:
            BagError: its type is not known or its bytes do not fit; names topic and time.
        """
        assert self._reader is not None, "messages come first"
        try:
            return self._reader.deserialize(message.data, message.type)
        except _UNREADABLE as error:
            raise BagError(
                f"{self.path}: {message.topic}: t = {message.log_time / 1e9:.6f} s: expected a {message.type}, "
                f"got {len(message.data)} bytes that do not decode: {_line(error)}"
            ) from error


def is_foreign(path: Path) -> bool:
    """Tell by its ending whether a file is of another storage."""
    return path.suffix.lower() in (ROS1, SQLITE)


def known_types() -> Typestore:
    """Return the types of Jazzy's common packages and, where they are installed, ours."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in OURS:
        try:
            for each in (*dependencies(name), name):
                if each not in store.fielddefs:
                    store.register(get_types_from_msg(message_text(each), each))
        except BagError:  # no ROS here: a bag with such messages then has to describe them itself
            continue
    return store


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
