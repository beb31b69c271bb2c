"""Writes bags: MCAP with profile `ros2`, in a folder that `ros2 bag` reads, safe against sudden death.

A finished chunk is never lost: chunks are finished at least every `FLUSH_SECONDS` of wall time and
handed to the disk, so a process that is killed loses no more than that and the file reads up to there.
A disk that fails or is full costs no more either: the file is cut back to its last finished chunk.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer

from pbrl_bag.encoding import Encoder
from pbrl_bag.errors import BagError
from pbrl_bag.metadata import BagMetadata, TopicMetadata, qos_text, record_text, write_metadata
from pbrl_bag.qos import Qos, default_qos
from pbrl_bag.schema import message_definition, type_hash

FLUSH_SECONDS = 0.4  # [s] of wall time; a chunk in work is never older
METADATA_SECONDS = 1.0  # [s]
CHUNK_BYTES = 1 << 20


class BagWriter:
    """Writes one bag folder `<name>/<name>_0.mcap` with its metadata.yaml.

    Args:
        folder: has not to exist yet: recordings are never written over.
        live: finish chunks by wall time, for recordings of running graphs. False: by size alone,
            so that the same messages make the same bytes.
        ros_distro: what metadata.yaml says.

    Raises:
        BagError: the folder exists or cannot be made.

    Safe to call from several threads.
    """

    def __init__(self, folder: Path | str, *, live: bool = True, ros_distro: str = "jazzy"):
        self.folder = Path(folder)
        name = self.folder.resolve().name
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError as error:
            raise BagError(
                f"{folder}: expected a new folder, got one that exists; give another or remove it"
            ) from error
        except OSError as error:
            raise BagError(f"{folder}: cannot make this folder: {error.strerror or error}") from error
        self.path = self.folder / f"{name}_0.mcap"
        self._file = self.path.open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=Profile.ROS2, library="pbrl_bag")
        self._file.flush()  # a recorder killed at once leaves an empty recording, not an empty file
        self._good = self._file.tell()
        self._metadata = BagMetadata(self.path.name, ros_distro)
        self._channels: dict[str, tuple[int, str]] = {}
        self._schemas: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._encoder = Encoder()
        self._lock = threading.RLock()
        self._failure: OSError | None = None
        self._dirty = False
        self._closed = threading.Event()
        self._on_disk = self._metadata.to_dict()
        self._save()
        self._thread = threading.Thread(target=self._keep_safe, name="bag-flush", daemon=True) if live else None
        if self._thread:
            self._thread.start()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def message_count(self) -> int:
        """Messages written so far, over all topics."""
        return sum(topic.count for topic in self._metadata.topics.values())

    def add_topic(self, topic: str, type_name: str, qos: Iterable[Qos] | None = None) -> None:
        """Announce a topic: its type and how it is offered; `write` does so with the contract's QoS.

        Raises:
            BagError: the type is not installed, or the topic is there with another type.
        """
        with self._lock:
            known = self._channels.get(topic)
            if known is not None:
                if known[1] != type_name:
                    raise BagError(f"{topic}: expected one type, got {known[1]} before and {type_name} now")
                return
            profiles = (default_qos(topic),) if qos is None else tuple(qos)
            schema = self._schema(type_name)
            channel = self._writer.register_channel(
                topic,
                MessageEncoding.CDR,
                schema,
                {"offered_qos_profiles": qos_text(profiles), "topic_type_hash": type_hash(type_name)},
            )
            self._channels[topic] = (channel, type_name)
            self._metadata.topics[topic] = TopicMetadata(topic, type_name, profiles, type_hash(type_name))

    def write(
        self, topic: str, type_name: str, message: Any, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Write one message.

        Args:
            topic: where it was heard.
            type_name: "geometry_msgs/msg/PoseStamped".
            message: CDR bytes as they came over the wire, or a message instance (any object with its
                attributes). An instance is better than `serialize_message` of it, whose estimate of
                the length can leave bytes at the end that strict readers refuse.
            log_time_ns: when it was heard [ns]; the bag is played by this.
            publish_time_ns: when it was sent; `log_time_ns` if left out.

        Raises:
            BagError: the type is not installed, the message does not fit, the disk failed, or the bag is closed.
        """
        with self._lock:
            self._check_open()
            self.add_topic(topic, type_name)
            data = message if isinstance(message, bytes) else self._encode(topic, type_name, message)
            self._sequence[topic] = sequence = self._sequence.get(topic, 0) + 1
            try:
                self._writer.add_message(
                    self._channels[topic][0],
                    log_time_ns,
                    data,
                    log_time_ns if publish_time_ns is None else publish_time_ns,
                    sequence,
                )
            except OSError as error:
                raise self._fail(error) from error
            self._metadata.count(topic, log_time_ns)
            self._dirty = True

    def flush(self) -> None:
        """Finish the chunk in work and hand it to the disk.

        Raises:
            BagError: the disk failed.
        """
        with self._lock:
            if self._closed.is_set() or not self._dirty:
                return
            try:
                self._writer.flush()  # type: ignore[no-untyped-call]
                self._file.flush()
            except OSError as error:
                raise self._fail(error) from error
            self._dirty = False
            self._good = self._file.tell()
            self._on_disk = self._metadata.to_dict()
        try:
            os.fsync(self._file.fileno())
        except OSError as error:  # what was thought to be written is not
            with self._lock:
                raise self._fail(error) from error

    def close(self) -> None:
        """Write footer and metadata; does nothing the second time.

        Raises:
            BagError: the disk failed, now or before.
        """
        with self._lock:
            if self._closed.is_set():
                return
            self._closed.set()
        if self._thread:
            self._thread.join()
        if self._failure:
            raise self._disk(self._failure)
        whole = self._metadata.to_dict()
        try:
            self._writer.add_metadata("rosbag2", {"serialized_metadata": record_text(whole)})
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise self._fail(error) from error
        self._on_disk = whole
        self._save_if_there_is_room()

    def _schema(self, type_name: str) -> int:
        """Return the id of a type's schema, registered on first use."""
        if type_name not in self._schemas:
            text = message_definition(type_name).encode()
            self._schemas[type_name] = self._writer.register_schema(type_name, SchemaEncoding.ROS2, text)
        return self._schemas[type_name]

    def _encode(self, topic: str, type_name: str, message: Any) -> bytes:
        """Encode a message, naming the topic if that fails."""
        try:
            return self._encoder.encode(type_name, message)
        except BagError as error:
            raise BagError(f"{topic}: {error}") from error

    def _check_open(self) -> None:
        """Raise a BagError where nothing can be written any more."""
        if self._failure:
            raise self._disk(self._failure)
        if self._closed.is_set():
            raise BagError(f"{self.folder}: expected an open bag, got a closed one")

    def _disk(self, error: OSError) -> BagError:
        """Return the error for a disk that failed."""
        kept = self._on_disk["rosbag2_bagfile_information"]["message_count"]
        return BagError(
            f"{self.path}: cannot write: {error.strerror or error}; the {kept} messages before it are kept, make room "
            f"and record again"
        )

    def _fail(self, error: OSError) -> BagError:
        """Return the error for a disk that failed, and keep what is on it: whole chunks, and nothing behind them."""
        if self._failure is None:
            self._failure = error
            with suppress(OSError):
                os.ftruncate(self._file.fileno(), self._good)
            # What is left in the buffer must not be written behind that, whenever it is let go.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._file.fileno())
            os.close(nowhere)
            self._file.close()
            self._save_if_there_is_room()
        return self._disk(self._failure)

    def _save(self) -> None:
        """Write metadata.yaml: what finished chunks hold, so that it never promises what a crash takes."""
        write_metadata(self.folder, self._on_disk)

    def _save_if_there_is_room(self) -> None:
        """Save metadata; where it cannot be, what was saved last stays, and tells of a little less."""
        with suppress(OSError):
            self._save()

    def _keep_safe(self) -> None:
        """Finish chunks and refresh metadata until closed; runs in a thread of its own."""
        saved = time.monotonic()
        while not self._closed.wait(FLUSH_SECONDS):
            try:
                self.flush()
                if time.monotonic() - saved >= METADATA_SECONDS:
                    self._save()
                    saved = time.monotonic()
            except OSError as error:
                with self._lock:
                    self._fail(error)
                return
            except BagError:  # it is kept, and said by whoever writes next
                return
