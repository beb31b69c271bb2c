"""When to publish which message of a bag: the part of playing that needs no ROS."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pbrl_bag.errors import BagError
from pbrl_bag.foreign_bag import is_foreign
from pbrl_bag.mcap_file import McapFile, RawMessage
from pbrl_bag.metadata import qos_from_text
from pbrl_bag.qos import Qos, default_qos
from pbrl_bag.reader import files_of

CLOCK_TOPIC = "/clock"


@dataclass(frozen=True)
class PlayedTopic:
    """One topic to publish."""

    name: str
    type: str
    qos: Qos


@dataclass(frozen=True)
class LoadedBag:
    """A bag in memory.

    Attributes:
        messages: in order of log time.
        topics: by name.
        notes: what was lost of a bag that was not finished.
    """

    messages: tuple[RawMessage, ...]
    topics: dict[str, PlayedTopic]
    notes: tuple[str, ...]


def load_bag(path: Path | str) -> LoadedBag:
    """Load a bag folder or MCAP file for playing.

    Raises:
        BagError: nothing there, not an MCAP, a damaged one, or one without messages.
    """
    path = Path(path)
    messages: list[RawMessage] = []
    topics: dict[str, PlayedTopic] = {}
    notes: list[str] = []
    for name in files_of(path):
        if is_foreign(name):
            raise BagError(f"{name}: expected an MCAP to play, got another storage; play it with `ros2 bag play`")
        file = McapFile(name)
        messages += file.messages()
        for channel in file.channels.values():
            where = f"{name}: {channel.topic}"
            if channel.message_encoding != "cdr":
                raise BagError(f"{where}: expected encoding cdr, got {channel.message_encoding!r}; it cannot be played")
            offered = qos_from_text(channel.metadata.get("offered_qos_profiles", ""), where)
            qos = strongest(offered) if offered else default_qos(channel.topic)
            topics[channel.topic] = PlayedTopic(channel.topic, file.type_of(channel), qos)
        notes += file.notes
    if not messages:
        raise BagError(f"{path}: expected messages to play, got none{': ' + notes[-1] if notes else ''}")
    return LoadedBag(tuple(sorted(messages, key=lambda one: one.log_time)), topics, tuple(notes))


def strongest(offered: Sequence[Qos]) -> Qos:
    """Return one offer that every subscriber to the recorded offers can be served with.

    Reliable and transient local serve those that ask for less; an unknown history, which is what
    discovery tells, becomes keep-last 10.
    """
    first = offered[0]
    known = first.history in ("keep_last", "keep_all") and first.depth > 0
    return Qos(
        history=first.history if known else "keep_last",
        depth=max(qos.depth for qos in offered) if known else 10,
        reliability="reliable" if any(qos.reliability == "reliable" for qos in offered) else first.reliability,
        durability=(
            "transient_local" if any(qos.durability == "transient_local" for qos in offered) else first.durability
        ),
        deadline=first.deadline,
        lifespan=first.lifespan,
        liveliness=first.liveliness if first.liveliness in ("automatic", "manual_by_topic") else "automatic",
        liveliness_lease_duration=first.liveliness_lease_duration,
    )


@dataclass
class Schedule:
    """Which messages are due after how much wall time.

    Args:
        times: (n,) log times [ns], in order.
        rate: seconds of the bag per second of wall time.
        start_offset: seconds of the bag to leave out at its beginning.
        loop: begin again at the end, for ever.

    Raises:
        BagError: a rate that is not positive, an offset outside the bag.
    """

    times: Sequence[int]
    rate: float = 1.0
    start_offset: float = 0.0
    loop: bool = False
    rounds: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        duration = (self.times[-1] - self.times[0]) / 1e9
        if not (0.0 < self.rate < float("inf")):
            raise BagError(f"rate: expected a number above 0, got {self.rate:g}")
        if not 0.0 <= self.start_offset <= duration:
            raise BagError(
                f"start_offset: expected 0 to {duration:.3f} s, the length of the bag, got {self.start_offset:g}"
            )
        self.begin = self.times[0] + round(self.start_offset * 1e9)
        self.first = bisect.bisect_left(self.times, self.begin)
        self._next = self.first
        self._round_start = 0.0

    @property
    def finished(self) -> bool:
        """Nothing is left to publish."""
        return self._next >= len(self.times) and not self.loop

    def due(self, elapsed: float) -> range:
        """Return the indices of messages due by `elapsed` [s] of wall time, each once.

        At the end of a round of a loop only what is left of the round is returned; call again.
        """
        if self._next >= len(self.times) and self.loop:
            self._round_start += max((self.times[-1] - self.begin) / 1e9 / self.rate, 1e-3)
            self._next = self.first
            self.rounds += 1
        now = self.clock(elapsed)
        end = bisect.bisect_right(self.times, now, lo=self._next)
        found = range(self._next, end)
        self._next = end
        return found

    def wait(self, elapsed: float) -> float:
        """Return how long it is [s] until a message is due, at `elapsed` [s]; 0 when one is."""
        if self._next >= len(self.times):
            return 0.0
        return max(0.0, self._round_start + (self.times[self._next] - self.begin) / 1e9 / self.rate - elapsed)

    def clock(self, elapsed: float) -> int:
        """Return the bag's time [ns] at `elapsed` [s] of wall time, not beyond its end."""
        return min(self.begin + round((elapsed - self._round_start) * self.rate * 1e9), self.times[-1])


def latched_before(bag: LoadedBag, first: int) -> list[RawMessage]:
    """Return the last message of each transient-local topic before index `first`.

    Someone who begins in the middle still has to be told what was said once, at the beginning.
    """
    found: dict[str, RawMessage] = {}
    for message in bag.messages[:first]:
        if bag.topics[message.topic].qos.durability == "transient_local":
            found[message.topic] = message
    return list(found.values())
