"""One MCAP file of a bag that is being written: whole chunks, and a disk that fails leaves nothing behind them."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer

from pbrl_bag.metadata import FileContents, TopicMetadata, qos_text
from pbrl_bag.schema import message_definition

CHUNK_BYTES = 1 << 20


class BagFile:
    """An MCAP file with profile `ros2`, begun and not finished.

    Attributes:
        path: where it lies.
        contents: what was written into it, in the chunk in work as well.
        chunks: finished ones; the index of each is kept in memory until the file is finished.

    Raises:
        OSError: it cannot be made, and is not there then; so do all methods where the disk fails.

    Not safe to call from several threads, but for `sync`.
    """

    def __init__(self, path: Path):
        self.path = path
        self.contents = FileContents(path.name)
        self.chunks = 0
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._good = self._behind = 0
        self._file = path.open("xb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        try:
            self._writer.start(profile=Profile.ROS2, library="pbrl_bag")
            self._file.flush()  # a recorder killed at once leaves an empty recording, not an empty file
        except OSError:
            self.cut_back()
            self.close()
            path.unlink()
            raise
        self._good = self._behind = self._file.tell()

    def announce(self, topic: TopicMetadata) -> None:
        """Make a topic known to whoever reads the file.

        Raises:
            BagError: the type is not installed.
        """
        self._channels[topic.name] = self._writer.register_channel(
            topic.name,
            MessageEncoding.CDR,
            self._schema(topic.type),
            {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": topic.type_hash},
        )

    def add(self, topic: str, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        """Add a message (CDR) of a topic that was announced; times in nanoseconds."""
        self._writer.add_message(self._channels[topic], log_time, data, publish_time, sequence)
        self.contents.count(topic, log_time)
        self._take_note()

    def finish_chunk(self) -> None:
        """Hand what was added to the system: it survives the process, though not yet the machine."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._file.flush()
        self._take_note()
        self._good = self._file.tell()

    def sync(self) -> None:
        """Wait for the disk to have what was handed to the system."""
        os.fsync(self._file.fileno())

    def finish(self, record: str) -> None:
        """Write what rosbag2 keeps in the file itself, and the footer; then the file is closed.

        A disk that fails at it leaves the finished chunks.
        """
        try:
            self._writer.add_metadata("rosbag2", {"serialized_metadata": record})
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
            self.sync()
            self._file.close()
        except OSError:
            self.cut_back()
            self.close()
            raise

    def cut_back(self) -> None:
        """Leave the finished chunks and nothing behind them, now and later.

        The file stays open: somebody may be waiting in `sync`, who is to be told by the system, not by Python.
        """
        if self._file.closed:
            return
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._good)
        # What is left in the buffer must not be written behind that, whenever it is let go.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._file.fileno())
        os.close(nowhere)

    def close(self) -> None:
        """Let go of a file that was cut back, or has no messages."""
        self._file.close()

    def _schema(self, type_name: str) -> int:
        """Return the id of a type's schema, registered on first use."""
        if type_name not in self._schemas:
            text = message_definition(type_name).encode()
            self._schemas[type_name] = self._writer.register_schema(type_name, SchemaEncoding.ROS2, text)
        return self._schemas[type_name]

    def _take_note(self) -> None:
        """Count a chunk, where one was finished: they are the only thing that is written."""
        if (behind := self._file.tell()) != self._behind:
            self.chunks += 1
            self._behind = behind
