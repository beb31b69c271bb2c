"""Reads the messages of an MCAP file, finished or not, whole chunks at a time.

A recorder that died leaves a file without footer, most often with half a chunk at its end. Every
chunk before that is read; what could not be is said in `McapFile.notes`.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Schema

from pbrl_bag.errors import BagError

MAGIC = b"\x89MCAP0\r\n"
FOOTER_OPCODE, DATA_END_OPCODE = int(Opcode.FOOTER), int(Opcode.DATA_END)
CHUNK_OPCODE, MESSAGE_OPCODE = int(Opcode.CHUNK), int(Opcode.MESSAGE)
LARGEST_CHUNK = 1 << 28  # [bytes] uncompressed; a recorder's have some megabytes
FREE = 1 << 28  # [bytes] that a file may unpack to, however small it is
DENSEST = 200  # times its own size that a file may unpack to beyond that; recordings do 2 to 20
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_SPAN = struct.Struct("<QQ")
_DAMAGE = (struct.error, ValueError, McapError, zstandard.ZstdError, RuntimeError, MemoryError, OverflowError)


class RawMessage(NamedTuple):
    """One message as it lies in the file; times in nanoseconds."""

    topic: str
    type: str
    log_time: int
    publish_time: int
    data: bytes
    channel: int


@dataclass
class McapFile:
    """An MCAP file, scanned from its beginning.

    Attributes:
        path: the file.
        finished: it has its footer; known once `messages` has come to its end.
        notes: sentences on what was lost, likewise.
        chunks: how many were read.
        header: profile and library.
        channels: by id.
        schemas: by id.
    """

    path: Path
    finished: bool = False
    notes: list[str] = field(default_factory=list)
    chunks: int = 0
    header: Header | None = None
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    _left: int = FREE

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message of every finished chunk, in the order of the file.

        Raises:
            BagError: no such file, an empty one, not an MCAP, or one that is damaged before its end.
        """
        try:
            with self.path.open("rb") as file:
                size = file.seek(0, io.SEEK_END)
                file.seek(0)
                if self._check_magic(file.read(len(MAGIC))):
                    yield from self._scan(file, size)
        except OSError as error:
            raise BagError(f"{self.path}: cannot read: {error.strerror or error}") from error

    def type_of(self, channel: Channel) -> str:
        """Return the message type of a channel, or an empty text where it names none."""
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def _check_magic(self, start: bytes) -> bool:
        """Tell whether the file starts as an MCAP does; False where it ends within its first bytes."""
        if not start:
            raise BagError(f"{self.path}: expected an MCAP file, got an empty one; was anything recorded?")
        if start == MAGIC:
            return True
        if MAGIC.startswith(start):
            self.notes.append(f"{self.path}: cut short within its first {len(MAGIC)} bytes: no message is left")
            return False
        raise BagError(f"{self.path}: expected an MCAP file, got one that starts with {start!r}; CSV needs suffix .csv")

    def _scan(self, file: BinaryIO, size: int) -> Iterator[RawMessage]:
        """Yield messages record by record until the footer or the end."""
        summary = False
        self._left = max(FREE, DENSEST * size)
        while True:
            at = file.tell()
            head = file.read(_RECORD.size)
            if len(head) < _RECORD.size:
                self._cut_short(at, size - at, "")
                return
            opcode, length = _RECORD.unpack(head)
            if at + _RECORD.size + length > size:
                span = _span_of_chunk(file.read(_SPAN.size)) if opcode == CHUNK_OPCODE else ""
                self._cut_short(at, size - at, span)
                return
            if opcode == FOOTER_OPCODE:
                self.finished = True
                return
            body = file.read(length)
            summary = summary or opcode == DATA_END_OPCODE
            if summary:  # repeats what came before
                continue
            try:
                yield from self._record(opcode, body)
            except _DAMAGE as error:
                raise BagError(
                    f"{self.path}: byte {at}: a record is damaged ({str(error) or type(error).__name__}); "
                    "copy the file again, or repair it with `mcap recover`"
                ) from error

    def _cut_short(self, at: int, lost: int, span: str) -> None:
        """Take note of a file without footer."""
        tail = f"the last {lost} bytes, an unfinished record{span}, are lost" if lost else "no half chunk follows"
        self.notes.append(
            f"{self.path.name}: not finished: the recorder ended without closing it; {self.chunks} chunks up to byte "
            f"{at} were read, {tail}; messages not yet in a chunk are lost"
        )

    def _record(self, opcode: int, body: bytes) -> Iterator[RawMessage]:
        """Yield the messages of one record."""
        if opcode == MESSAGE_OPCODE:
            yield self._message(body)
        elif opcode == CHUNK_OPCODE:
            data = _uncompressed(Chunk.read(_stream(body)), self._left)
            self._left -= len(data)
            messages = self._messages_of(data)
            self.chunks += 1
            yield from messages
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(body))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(body))
            self.channels[channel.id] = channel
        elif opcode == Opcode.HEADER:
            self.header = Header.read(_stream(body))

    def _messages_of(self, data: bytes) -> list[RawMessage]:
        """Return the messages of a chunk. There are hundreds of thousands in a recording: no call for each of them."""
        found: list[RawMessage] = []
        named: dict[int, tuple[str, str]] = {}
        at = 0
        while at < len(data):
            opcode, length = _RECORD.unpack_from(data, at)
            begin = at + _RECORD.size
            at = begin + length
            if at > len(data):
                raise ValueError("a record runs past the end of its chunk")
            if opcode != MESSAGE_OPCODE:
                found += self._record(opcode, data[begin:at])
                continue
            if length < _MESSAGE.size:
                raise ValueError(f"a message of {length} bytes")
            channel, _, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
            if channel not in named:
                named[channel] = self._named(channel)
            topic, kind = named[channel]
            found.append(RawMessage(topic, kind, log_time, publish_time, data[begin + _MESSAGE.size : at], channel))
        return found

    def _message(self, body: bytes) -> RawMessage:
        """Read one message record."""
        channel, _, log_time, publish_time = _MESSAGE.unpack_from(body)
        return RawMessage(*self._named(channel), log_time, publish_time, body[_MESSAGE.size :], channel)

    def _named(self, channel_id: int) -> tuple[str, str]:
        """Return topic and type of a channel."""
        channel = self.channels.get(channel_id)
        if channel is None:
            raise ValueError(f"message of channel {channel_id}, which nothing describes")
        return channel.topic, self.type_of(channel)


def _stream(body: bytes) -> ReadDataStream:
    """Wrap bytes for mcap's record readers."""
    return ReadDataStream(io.BytesIO(body))


def _uncompressed(chunk: Chunk, left: int) -> bytes:
    """Return the records of a chunk, its checksum checked; what would unpack to more than is left is refused before."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":  # what stands in its own head counts, whatever the chunk says
        size = max(size, zstandard.frame_content_size(chunk.data))
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, expected at most {LARGEST_CHUNK}")
    if size > left:
        raise ValueError(f"a file that unpacks to more than {DENSEST} times its size")
    if chunk.compression == "zstd":
        data = zstandard.decompress(chunk.data, chunk.uncompressed_size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        if len(data) != size:
            raise ValueError(f"a chunk of another size than the {size} bytes that it says")
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression!r}, expected zstd, lz4 or none")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("checksum of a chunk does not match")
    return bytes(data)


def _span_of_chunk(head: bytes) -> str:
    """Say which seconds an unfinished chunk held, from the first bytes of it that are there."""
    if len(head) < _SPAN.size:
        return ""
    start, end = _SPAN.unpack(head)
    return f" of messages from {start / 1e9:.3f} to {end / 1e9:.3f} s"
