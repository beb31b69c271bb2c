"""What a bag holds, without decoding a message: topics, rates, gaps, and whether it was finished."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import qos_from_text
from pbrl_bag.qos import Qos
from pbrl_bag.reader import files_of, opened
from pbrl_bag.types import Array

FEWEST_FOR_GAPS = 10
GAP_FACTOR = 5.0  # a silence counts as a gap beyond this many usual intervals
SHORTEST_GAP = 0.1  # [s]


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a bag.

    Attributes:
        name: of the topic.
        type: of its messages.
        count: how many.
        rate: [Hz] mean over the topic's own span; NaN below two messages.
        first: log time of the first message, since the bag's start [s].
        last: of the last.
        gaps: (k, 2) start and end of silences, since the bag's start [s].
        qos: as offered when it was recorded; empty where the bag does not say.
    """

    name: str
    type: str
    count: int
    rate: float
    first: float
    last: float
    gaps: Array
    qos: tuple[Qos, ...]

    @property
    def longest_gap(self) -> float:
        """Length of the longest silence [s]; 0 where there is none."""
        return float((self.gaps[:, 1] - self.gaps[:, 0]).max()) if len(self.gaps) else 0.0


@dataclass(frozen=True)
class BagInfo:
    """One bag.

    Attributes:
        path: folder or file.
        files: that it is made of.
        size: of the files [bytes].
        start: log time of the first message [s]; NaN without messages.
        duration: [s].
        message_count: over all topics.
        topics: in order of name.
        finished: every file has its footer; False: the recorder crashed or still records.
        notes: what was lost, a sentence each.
        profile: of the MCAP header; "ros2" for bags of ROS 2; empty for other storages.
        library: that wrote it, likewise.
    """

    path: Path
    files: tuple[Path, ...]
    size: int
    start: float
    duration: float
    message_count: int
    topics: tuple[TopicInfo, ...]
    finished: bool
    notes: tuple[str, ...]
    profile: str
    library: str


def describe(path: Path | str) -> BagInfo:
    """Describe a bag folder or a bag's file.

    Raises:
        BagError: nothing there, not a bag, or a damaged one.
    """
    path = Path(path)
    files = files_of(path)
    scanned = [opened(name) for name in files]
    times: dict[str, list[int]] = {}
    types: dict[str, str] = {}
    for file in scanned:
        for message in file.messages():
            times.setdefault(message.topic, []).append(message.log_time)
            types[message.topic] = message.type
    start = min((min(stamps) for stamps in times.values()), default=0)
    end = max((max(stamps) for stamps in times.values()), default=0)
    ours = [file for file in scanned if isinstance(file, McapFile)]
    qos = {name: profiles for file in ours for name, profiles in _qos(file).items()}
    header = next((file.header for file in ours if file.header), None)
    return BagInfo(
        path=path,
        files=files,
        size=sum(name.stat().st_size for name in files),
        start=start / 1e9 if times else float("nan"),
        duration=(end - start) / 1e9,
        message_count=sum(map(len, times.values())),
        topics=tuple(_topic(name, types[name], times[name], start, qos.get(name, ())) for name in sorted(times)),
        finished=all(file.finished for file in scanned),
        notes=tuple(note for file in scanned for note in file.notes),
        profile=header.profile if header else "",
        library=header.library if header else "",
    )


def gaps_in(time: Array) -> Array:
    """Return silences (k, 2) [s] in times (n,) [s] that increase: much longer than is usual there."""
    if len(time) < FEWEST_FOR_GAPS:
        return np.empty((0, 2))
    step = np.diff(time)
    long = step > max(GAP_FACTOR * float(np.median(step)), SHORTEST_GAP)
    return np.column_stack([time[:-1][long], time[1:][long]])


def _topic(name: str, type_name: str, stamps: list[int], start: int, qos: tuple[Qos, ...]) -> TopicInfo:
    """Describe one topic."""
    time = np.sort(np.array([stamp - start for stamp in stamps], dtype=np.float64) / 1e9)  # they have 64 bits, unsigned
    span = time[-1] - time[0]
    rate = float((len(time) - 1) / span) if span > 0 else float("nan")
    return TopicInfo(name, type_name, len(time), rate, float(time[0]), float(time[-1]), gaps_in(time), qos)


def _qos(file: McapFile) -> dict[str, tuple[Qos, ...]]:
    """Return the QoS that a file keeps for its topics."""
    return {
        channel.topic: qos_from_text(channel.metadata.get("offered_qos_profiles", ""), f"{file.path}: {channel.topic}")
        for channel in file.channels.values()
    }
