"""metadata.yaml of a bag folder, as `ros2 bag info` and `ros2 bag play` of Jazzy read it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pbrl_bag.errors import BagError
from pbrl_bag.qos import Qos, qos_from_metadata
from pbrl_bag.yaml_text import parse_yaml

FILE_NAME = "metadata.yaml"
VERSION = 9
STORAGES = ("mcap", "sqlite3")
"""That can be read."""


@dataclass(frozen=True)
class TopicMetadata:
    """One topic of a bag."""

    name: str
    type: str
    qos: tuple[Qos, ...]
    type_hash: str = ""

    def to_dict(self, count: int) -> dict[str, Any]:
        """Return the topic's entry in topics_with_message_count."""
        return {
            "topic_metadata": {
                "name": self.name,
                "type": self.type,
                "serialization_format": "cdr",
                "offered_qos_profiles": [qos.to_metadata() for qos in self.qos],
                "type_description_hash": self.type_hash,
            },
            "message_count": count,
        }


@dataclass
class FileContents:
    """What one file of a bag holds.

    Attributes:
        name: of the file, in the bag's folder.
        start: log time of the first message [ns]; None without messages.
        end: of the last [ns].
        counts: messages by topic.
    """

    name: str
    start: int | None = None
    end: int | None = None
    counts: dict[str, int] = field(default_factory=dict)

    @property
    def message_count(self) -> int:
        """Messages over all topics."""
        return sum(self.counts.values())

    def count(self, topic: str, log_time: int) -> None:
        """Take note of one message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.start = log_time if self.start is None else min(self.start, log_time)
        self.end = log_time if self.end is None else max(self.end, log_time)

    def to_dict(self) -> dict[str, Any]:
        """Return the file's entry in files."""
        return {"path": self.name, **_span([self]), "message_count": self.message_count}


@dataclass
class BagMetadata:
    """What metadata.yaml says of a bag."""

    ros_distro: str = "jazzy"
    topics: dict[str, TopicMetadata] = field(default_factory=dict)
    files: list[FileContents] = field(default_factory=list)

    def to_dict(self, only: FileContents | None = None) -> dict[str, Any]:
        """Return the whole document, or that of a bag of one of the files."""
        files = self.files if only is None else [only]
        counts = {name: sum(file.counts.get(name, 0) for file in files) for name in self.topics}
        return {
            "rosbag2_bagfile_information": {
                "version": VERSION,
                "storage_identifier": "mcap",
                **_span(files),
                "message_count": sum(counts.values()),
                "topics_with_message_count": [topic.to_dict(counts[name]) for name, topic in self.topics.items()],
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [file.name for file in files],
                "files": [file.to_dict() for file in files],
                "custom_data": None,
                "ros_distro": self.ros_distro,
            }
        }


def _span(files: list[FileContents]) -> dict[str, Any]:
    """Return duration and beginning of what some files hold together."""
    start = min((file.start for file in files if file.start is not None), default=0)
    end = max((file.end for file in files if file.end is not None), default=start)
    return {"duration": {"nanoseconds": end - start}, "starting_time": {"nanoseconds_since_epoch": start}}


def record_text(document: dict[str, Any]) -> str:
    """Return what rosbag2 keeps in the file itself, so that the file alone can be asked as well."""
    information = document["rosbag2_bagfile_information"]
    return yaml.dump(information, Dumper=_Dumper, sort_keys=False, default_flow_style=False)


def write_metadata(folder: Path, document: dict[str, Any]) -> None:
    """Replace metadata.yaml in one step: a reader sees the old one or the new one, whole."""
    part = folder / f".{FILE_NAME}.part"
    try:
        with part.open("w", encoding="utf-8") as file:
            yaml.dump(document, file, Dumper=_Dumper, sort_keys=False, default_flow_style=False)
            file.flush()
            os.fsync(file.fileno())
        part.replace(folder / FILE_NAME)
    except OSError:
        part.unlink(missing_ok=True)
        raise


class _Dumper(yaml.SafeDumper):
    """Writes repeated values out: yaml-cpp, which reads this, is not to meet anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def read_metadata(folder: Path) -> dict[str, Any]:
    """Return the information part of a bag's metadata.yaml.

    Raises:
        BagError: there is none, or it is not what rosbag2 writes.
    """
    path = folder / FILE_NAME
    try:
        document = parse_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BagError(f"{path}: expected a bag's metadata, {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise BagError(f"{path}: expected YAML, got: {error}") from error
    except ValueError as error:
        raise BagError(f"{path}: {error}") from error
    information = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(information, dict):
        raise BagError(f"{path}: expected key rosbag2_bagfile_information, got none; read the .mcap file itself")
    return information


def files_of_bag(folder: Path) -> tuple[Path, ...]:
    """Return the MCAP or SQLite files of a bag folder, in order.

    Raises:
        BagError: no such file, another storage, or a file that metadata.yaml names is not there.
    """
    if not (folder / FILE_NAME).exists():
        files = sorted(folder.glob("*.mcap")) or sorted(folder.glob("*.db3"))
        if not files:
            raise BagError(f"{folder}: expected {FILE_NAME} and .mcap or .db3 files, got neither; is it a bag?")
        return tuple(files)
    information = read_metadata(folder)
    if (storage := information.get("storage_identifier")) not in STORAGES:
        raise BagError(
            f"{folder}: expected storage {' or '.join(STORAGES)}, got {storage!r}; convert it with `ros2 bag convert`"
        )
    if information.get("compression_mode") not in (None, "", "NONE", "none") and storage != "mcap":
        raise BagError(
            f"{folder}: expected SQLite files that are not compressed, got compression mode "
            f"{information.get('compression_mode')!r}; convert it with `ros2 bag convert`"
        )
    names = information.get("relative_file_paths") or []
    if not isinstance(names, list):
        raise BagError(f"{folder}: {FILE_NAME}: relative_file_paths: expected a list, got {names!r}")
    files = [folder / str(name) for name in names]
    for name, path in zip(map(str, names), files, strict=True):
        if Path(name).is_absolute() or ".." in Path(name).parts or "\0" in name:
            raise BagError(
                f"{folder}: {FILE_NAME}: relative_file_paths: expected files in the bag's folder, got {name[:60]!r}"
            )
        if not _is_there(path):
            raise BagError(f"{folder}: expected {path.name[:60]}, which {FILE_NAME} names, got no such file")
    if not files:
        raise BagError(f"{folder}: expected relative_file_paths in {FILE_NAME}, got none")
    return tuple(files)


def _is_there(path: Path) -> bool:
    """Tell whether there is such a file; none has a name that is too long."""
    try:
        return path.exists()
    except OSError:
        return False


def qos_text(profiles: tuple[Qos, ...]) -> str:
    """Return offered QoS as the YAML text that rosbag2 keeps in a channel's metadata."""
    entries = [qos.to_metadata() for qos in profiles]
    return yaml.dump(entries, Dumper=_Dumper, sort_keys=False, default_flow_style=False).rstrip() if entries else ""


def qos_from_text(text: str, where: str) -> tuple[Qos, ...]:
    """Read what `qos_text` wrote, or what rosbag2 did.

    Raises:
        BagError: not a list of profiles.
    """
    try:
        entries = parse_yaml(text) if text else []
        return tuple(qos_from_metadata(entry) for entry in entries or [])
    except (AttributeError, TypeError, LookupError, ValueError, ArithmeticError) as error:
        raise BagError(f"{where}: offered_qos_profiles: expected a list of QoS profiles, got: {error}") from error
