"""Reads a recording from a bag: MCAP, SQLite or ROS 1, a folder or a file; or from a CSV file."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping as MappingType
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel
from mcap_ros2.decoder import DecoderFactory

from pbrl_bag.batches import batch_of
from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.csv_reader import read_csv
from pbrl_bag.decoding import NANOSECONDS
from pbrl_bag.errors import BagError
from pbrl_bag.foreign_bag import ForeignBag, is_foreign
from pbrl_bag.mapping import Mapping, load_mapping
from pbrl_bag.mcap_file import McapFile, RawMessage
from pbrl_bag.metadata import files_of_bag
from pbrl_bag.names import canonical, namespace_of
from pbrl_bag.types import Recording

Hearers = MappingType[str, Callable[[Any], None]]
"""What takes the decoded messages of a topic, by topic."""


def read_recording(
    path: Path | str,
    mapping: Path | str | None = None,
    *,
    complete: bool = True,
    also: Hearers | None = None,
) -> Recording:
    """Read a recording.

    A file that a crash cut short is read up to its last finished chunk; `Recording.notes` says how
    much was lost.

    Args:
        path: a bag folder (MCAP or SQLite), an .mcap, .db3 or .bag (ROS 1) file, or a .csv file.
        mapping: a mapping file; needed for CSV and for bags whose topics are not the contract's.
        complete: whether what is needed to learn from it has to be there; see `RecordingBuilder.build`.
        also: topics beside those of a recording, and what takes each message of theirs, in order.

    Raises:
        BagError: anything missing or malformed, in one line that names file, topic, time and field.
    """
    path = Path(path)
    rules = None if mapping is None else load_mapping(mapping)
    files = files_of(path)
    if path.suffix.lower() != ".csv":
        return _read_bag(path, files, rules, complete, also or {})
    if rules is None:
        raise BagError(f"{path}: a CSV file needs a mapping that names its columns; see config/mappings/")
    return read_csv(path, rules, complete=complete)


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files that make up a recording.

    Raises:
        BagError: nothing there, or a folder that is no bag.
    """
    if not path.exists():
        raise BagError(f"{path}: expected a bag folder, an .mcap, .db3, .bag or .csv file, got nothing of that name")
    return files_of_bag(path) if path.is_dir() else (path,)


def opened(path: Path) -> McapFile | ForeignBag:
    """Return a file of a bag by its ending; what is in it is looked at when it is read."""
    return ForeignBag(path) if is_foreign(path) else McapFile(path)


class Decoder:
    """Turns raw messages of one file into objects with their fields as attributes."""

    def __init__(self, file: McapFile):
        self._file = file
        self._factory = DecoderFactory()
        self._decoders: dict[int, Callable[[bytes], Any]] = {}

    def decode(self, message: RawMessage) -> Any:
        """Decode one message.

        Raises:
            BagError: its schema or its bytes cannot be understood; names topic and time.
        """
        try:
            if message.channel not in self._decoders:
                self._decoders[message.channel] = self._decoder(self._file.channels[message.channel])
            return self._decoders[message.channel](message.data)
        except BagError:
            raise
        except Exception as error:  # the decoder follows a stranger's schema: it can fail in any way
            raise BagError(
                f"{self._file.path}: {message.topic}: t = {message.log_time / 1e9:.6f} s: expected a {message.type}, "
                f"got {len(message.data)} bytes that do not decode: {error}"
            ) from error

    def _decoder(self, channel: Channel) -> Callable[[bytes], Any]:
        """Return the decoder of a channel."""
        schema = self._file.schemas.get(channel.schema_id)
        decoder = self._factory.decoder_for(channel.message_encoding, schema)
        if decoder is None:
            encoding = schema.encoding if schema else "no"
            raise BagError(
                f"{self._file.path}: {channel.topic}: expected CDR with a ros2msg schema, got encoding "
                f"{channel.message_encoding!r} with {encoding} schema; record it with storage mcap"
            )
        return decoder


def _read_bag(path: Path, files: tuple[Path, ...], rules: Mapping | None, complete: bool, also: Hearers) -> Recording:
    """Read the messages that play a role; those of a robot in a namespace where there is none in the root."""
    builder, topics = _collected(files, rules, "", also)
    if not topics:
        why = builder.notes[-1] if builder.notes else "it was finished without one"
        raise BagError(f"{path}: expected messages, got none: {why}")
    namespace = "" if rules is not None else namespace_of(topics, str(path))
    if namespace:
        builder, _ = _collected(files, rules, namespace, also)
        builder.notes.append(f"the robot's namespace {namespace} is left out of the names of its topics")
    return builder.build(path, complete=complete)


def _collected(
    files: tuple[Path, ...], rules: Mapping | None, namespace: str, also: Hearers
) -> tuple[RecordingBuilder, set[str]]:
    """Return the messages of a namespace that play a role, in the order in which they were heard; and all topics."""
    builder, topics = RecordingBuilder(rules), set[str]()

    def role(message: RawMessage) -> str | None:
        topics.add(message.topic)
        name = canonical(message.topic, namespace)
        return name if name is not None and (builder.wants(name) or name in also) else None

    for file in map(opened, files):
        if isinstance(file, ForeignBag):  # in order already, and decoded while it is open
            for message in file.messages():
                if name := role(message):
                    _give(builder, also, name, file.decode(message), message)
            continue
        wanted: dict[str, list[RawMessage]] = {}
        for message in file.messages():
            if name := role(message):
                wanted.setdefault(name, []).append(message)
        decoder = Decoder(file)
        left: list[tuple[str, RawMessage]] = []
        for name, messages in wanted.items():
            if not _taken_together(builder, decoder, name, messages, also):
                left += [(name, each) for each in messages]
        for name, message in sorted(left, key=lambda one: one[1].log_time):
            _give(builder, also, name, decoder.decode(message), message)
        builder.notes += file.notes
    return builder, topics


def _give(builder: RecordingBuilder, also: Hearers, name: str, decoded: Any, message: RawMessage) -> None:
    builder.add(name, decoded, message.log_time / NANOSECONDS)
    if name in also:
        try:
            also[name](decoded)
        except (AttributeError, TypeError, ValueError, ArithmeticError) as error:  # a stranger's type of that name
            raise BagError(f"{message.topic}: expected a {message.type}, got one with other fields: {error}") from error


def _taken_together(
    builder: RecordingBuilder, decoder: Decoder, name: str, messages: list[RawMessage], also: Hearers
) -> bool:
    """Give the messages of one topic to the builder in one go, or return False where that cannot be done."""
    messages.sort(key=lambda one: one.log_time)
    several = len({one.channel for one in messages}) > 1
    batch = None if several or name in also else batch_of(messages[0].type, [one.data for one in messages])
    if batch is None or not builder.takes(name, batch):
        return False
    for k in (0, len(messages) // 2, -1):  # a stranger's type of that name can have its fields in another order
        try:
            alike = np.array_equal(batch.values[k], _numbers(decoder.decode(messages[k])), equal_nan=True)
        except (AttributeError, TypeError, ValueError):  # it has not even those fields
            alike = False
        if not alike:
            return False
    builder.add_batch(name, batch, np.array([one.log_time for one in messages]) / NANOSECONDS)
    return True


def _numbers(message: Any) -> list[float]:
    """Return the numbers of a stamped pose or wrench as a batch has them; none of anything else."""
    if hasattr(message, "pose"):
        at, turn = message.pose.position, message.pose.orientation
        return [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]
    if hasattr(message, "wrench"):
        force, torque = message.wrench.force, message.wrench.torque
        return [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    return []
