"""Writes bags: MCAP with profile `ros2`, in a folder that `ros2 bag` reads, safe against sudden death.

A finished chunk is never lost: chunks are finished at least every `FLUSH_SECONDS` of wall time and
handed to the disk, so a process that is killed loses no more than that and the file reads up to there.
A disk that fails or is full costs no more either: the file is cut back to its last finished chunk.

A live recording is one of several files: the index of a file's chunks lies in memory until the file is
finished, and grows with each of them. What is in the files before the last is whole whatever happens.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from pbrl_bag.bag_file import BagFile
from pbrl_bag.encoding import Encoder
from pbrl_bag.errors import BagError
from pbrl_bag.metadata import BagMetadata, TopicMetadata, record_text, write_metadata
from pbrl_bag.qos import Qos, default_qos
from pbrl_bag.schema import type_hash

FLUSH_SECONDS = 0.4  # [s] of wall time; a chunk in work is never older
METADATA_SECONDS = 1.0  # [s]
FILE_CHUNKS = 1500
"""In a file of a live recording: ten minutes, where chunks are finished by time."""


class BagWriter:
    """Writes one bag folder: `<name>/<name>_0.mcap`, `<name>_1.mcap` and so on, with their metadata.yaml.

    Args:
        folder: has not to exist yet: recordings are never written over.
        live: finish chunks by wall time, and files after so many of them, for recordings of running
            graphs. False: chunks by size alone and one file, so that the same messages make the same bytes.
        ros_distro: what metadata.yaml says.
        file_chunks: of a live recording's file; then the next is begun.

    Raises:
        BagError: the folder exists or cannot be made.

    Safe to call from several threads.
    """

    def __init__(
        self, folder: Path | str, *, live: bool = True, ros_distro: str = "jazzy", file_chunks: int = FILE_CHUNKS
    ):
        self.folder = Path(folder)
        self._file_chunks = file_chunks
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError as error:
            raise BagError(
                f"{folder}: expected a new folder, got one that exists; give another or remove it"
            ) from error
        except OSError as error:
            raise BagError(f"{folder}: cannot make this folder: {error.strerror or error}") from error
        self._metadata = BagMetadata(ros_distro)
        self._sequence: dict[str, int] = {}
        self._encoder = Encoder()
        self._lock = threading.RLock()
        self._disk_lock = threading.Lock()  # taken before the other, by who waits for the disk: messages do not
        self._failure: OSError | None = None
        self._dirty = False
        self._closed = threading.Event()
        try:
            self._file = self._next_file()
            self._save()
        except OSError as error:
            raise BagError(f"{folder}: cannot write: {error.strerror or error}; nothing is recorded") from error
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
    def path(self) -> Path:
        """The file that is written to."""
        return self._file.path

    @property
    def message_count(self) -> int:
        """Messages written so far, over all topics."""
        with self._lock:
            return sum(file.message_count for file in self._metadata.files)

    def add_topic(self, topic: str, type_name: str, qos: Iterable[Qos] | None = None) -> None:
        """Announce a topic: its type and how it is offered; `write` does so with the contract's QoS.

        Raises:
            BagError: the type is not installed, or the topic is there with another type.
        """
        with self._lock:
            known = self._metadata.topics.get(topic)
            if known is not None:
                if known.type != type_name:
                    raise BagError(f"{topic}: expected one type, got {known.type} before and {type_name} now")
                return
            profiles = (default_qos(topic),) if qos is None else tuple(qos)
            new = TopicMetadata(topic, type_name, profiles, type_hash(type_name))
            self._file.announce(new)
            self._metadata.topics[topic] = new

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
            sent_ns = log_time_ns if publish_time_ns is None else publish_time_ns
            try:
                self._file.add(topic, data, log_time_ns, sent_ns, sequence)
            except OSError as error:
                raise self._fail(error) from error
            self._dirty = True

    def flush(self) -> None:
        """Finish the chunk in work and hand it to the disk.

        Raises:
            BagError: the disk failed.
        """
        with self._disk_lock:
            with self._lock:
                if self._closed.is_set() or not self._dirty:
                    return
                self._finish_chunk()
            try:
                self._file.sync()
            except OSError as error:  # what was thought to be written is not
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
        with self._disk_lock:
            if self._failure:
                self._file.close()
                raise self._disk(self._failure)
            whole = self._metadata.to_dict()
            self._finish(self._file)
            self._on_disk = whole
            self._save_if_there_is_room()

    def _next_file(self) -> BagFile:
        """Make the bag's next file, and name it in metadata."""
        number = len(self._metadata.files)
        file = BagFile(self.folder / f"{self.folder.resolve().name}_{number}.mcap")
        self._metadata.files.append(file.contents)
        self._on_disk = self._metadata.to_dict()
        return file

    def _begin_next_file(self) -> None:
        """Go on in a new file and finish the one before, while messages come.

        metadata.yaml names the new file before anything is in it: who dies meanwhile has both.

        Raises:
            BagError: the disk failed.
        """
        with self._disk_lock:
            with self._lock:
                self._finish_chunk()
                try:
                    following = self._next_file()
                except OSError as error:
                    raise self._fail(error) from error
            try:
                before = self._go_on_in(following)
            except BagError:
                following.close()
                raise
            self._finish(before)

    def _go_on_in(self, following: BagFile) -> BagFile:
        """Let all that comes be written into the next file; return the one before, its last chunk finished."""
        try:
            self._save()
        except OSError as error:
            raise self._fail(error) from error
        with self._lock:
            self._finish_chunk()
            for topic in self._metadata.topics.values():
                following.announce(topic)
            before, self._file = self._file, following
        return before

    def _finish_chunk(self) -> None:
        """Finish the chunk in work; with the lock held. After a failure nothing that is left in work is on the disk."""
        if self._failure:
            raise self._disk(self._failure)
        try:
            self._file.finish_chunk()
        except OSError as error:
            raise self._fail(error) from error
        self._dirty = False
        self._on_disk = self._metadata.to_dict()

    def _finish(self, file: BagFile) -> None:
        """Finish a file that nobody writes to any more."""
        try:
            file.finish(record_text(self._metadata.to_dict(only=file.contents)))
        except OSError as error:
            raise self._fail(error) from error

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
        with self._lock:
            if self._failure is None:
                self._failure = error
                self._file.cut_back()
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
                if self._file.chunks >= self._file_chunks:
                    self._begin_next_file()
                if time.monotonic() - saved >= METADATA_SECONDS:
                    self._save()
                    saved = time.monotonic()
            except OSError as error:
                self._fail(error)
                return
            except BagError:  # it is kept, and said by whoever writes next
                return
