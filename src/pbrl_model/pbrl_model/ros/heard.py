"""What a listener has heard and may still be asked for: whole holds, with what comes just before and after them."""

from __future__ import annotations

import math
import struct
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rclpy.serialization import deserialize_message

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.errors import BagError
from pbrl_bag.roles import GRASPS_TOPIC, SCENE_TOPIC
from pbrl_bag.types import Recording

BEFORE = 3.0
"""Kept of what comes before a hold [s]: weight and bias of a wrist are read there, and the smoother looks back."""
AFTER = 2.0
"""Kept of what comes after it [s]."""
HOLDS = 8
"""Holds that a message is asked about: it is at most a few seconds old then."""
SCRAP = 0.5
"""So little that is left of a hold is none [s]: an episode has two poses at least."""
HEADER_BYTES = 12
"""Of the encapsulation and the stamp: a message that is shorter is none."""
RESTART = 1.0
"""Stamps that go back by more than this [s] are of another clock: a bag played again, a simulator started anew."""


@dataclass(frozen=True)
class Message:
    """One message as it came: its topic, its type, and its bytes (CDR), which begin with a header."""

    topic: str
    kind: type
    data: bytes

    def decoded(self) -> Any:
        """Return the message itself.

        Raises:
            BagError: its bytes are none of its type.
        """
        try:
            return deserialize_message(self.data, self.kind)
        except (RuntimeError, ValueError, MemoryError) as error:
            kind, told = self.kind.__name__, " ".join(str(error).split())
            raise BagError(
                f"{self.topic}: expected a {kind}, got {len(self.data)} bytes that are none: {told}"
            ) from None

    @property
    def stamp(self) -> float:
        """Return the header's stamp [s], read from its place in the bytes."""
        order = "<" if self.data[1] & 1 else ">"
        whole, nanoseconds = struct.unpack_from(f"{order}iI", self.data, 4)
        return float(whole + 1e-9 * nanoseconds)


class Heard:
    """Messages in the order in which they came; safe to ask from another thread.

    Args:
        most: bytes kept at most; beyond, the oldest go.
    """

    def __init__(self, most: int) -> None:
        self.count = 0
        self._most = most
        self._lock = threading.Lock()
        self._fresh: deque[Message] | None = None
        self._warned = False
        self._begin()

    def _begin(self) -> None:
        """Begin with nothing, on whatever clock comes."""
        self._rare: list[Message] = []
        self._kept: deque[Message] = deque()
        self._recent: deque[tuple[float, Message]] = deque()
        self._size = 0
        self._last: dict[str, float] = {}
        self._held_since: float | None = None
        self._holds: deque[tuple[float, float]] = deque(maxlen=HOLDS)
        self._grasps: Any = None

    def follow(self) -> None:
        """Keep every message for `fresh` from now on."""
        with self._lock:
            self._fresh = deque(self._rare)

    def fresh(self) -> list[Message]:
        """Return what was added since the last call."""
        with self._lock:
            out = list(self._fresh or ())
            if self._fresh:
                self._fresh.clear()
            return out

    def kept(self) -> list[Message]:
        """Return everything that is kept: scene and grasps, then the rest in order."""
        with self._lock:
            return [*self._rare, *self._kept, *(message for _, message in self._recent)]

    def newest(self) -> float:
        """Return the newest stamp [s], minus infinity before the first."""
        with self._lock:
            return max(self._last.values(), default=-math.inf)

    def add(self, message: Message) -> list[str]:
        """Take a message; return what somebody should be told."""
        with self._lock:
            self.count += 1
            if len(message.data) < HEADER_BYTES:
                return [f"{message.topic}: expected a message with a header, got {len(message.data)} bytes"]
            if self._fresh is not None:
                self._fresh.append(message)
            if message.topic == SCENE_TOPIC:
                self._rare = [one for one in self._rare if one.topic != SCENE_TOPIC] + [message]
                return []
            stamp = message.stamp
            notes = self._check_clock(message, stamp)
            last = self._last.get(message.topic, -math.inf)
            if stamp < last or (stamp == last and message.topic != GRASPS_TOPIC):
                return notes  # late, or twice: a recording with it would be refused
            self._last[message.topic] = stamp
            if message.topic == GRASPS_TOPIC:
                try:
                    self._note_grasps(message, stamp)
                except BagError as error:
                    notes.append(str(error))
                return notes
            self._recent.append((stamp, message))
            self._size += len(message.data)
            return notes + self._forget(stamp)

    def _check_clock(self, message: Message, stamp: float) -> list[str]:
        """Begin anew where stamps have gone back; scene and a last word on grasps that is not younger stay."""
        last = self._last.get(message.topic)
        if last is None or stamp >= last - RESTART:
            return []
        stay = [one for one in self._rare if one.topic == SCENE_TOPIC]
        grasps = [one for one in self._rare if one.topic == GRASPS_TOPIC and one.stamp <= stamp][-1:]
        self._begin()
        self._rare = stay
        for one in grasps:
            self._last[GRASPS_TOPIC] = one.stamp
            self._note_grasps(one, one.stamp)
        back = f"{message.topic}: time went back from {last:.1f} s to {stamp:.1f} s"
        return [f"{back}; what was heard before is forgotten"]

    def _note_grasps(self, message: Message, stamp: float) -> None:
        """Remember when things were held; a message that says what the last one said is not kept."""
        grasps = message.decoded().grasps
        if grasps == self._grasps:
            return
        self._grasps = grasps
        self._rare.append(message)
        held = bool(grasps)
        if held and self._held_since is None:
            self._held_since = stamp
        elif not held and self._held_since is not None:
            self._holds.append((self._held_since, stamp))
            self._held_since = None

    def _forget(self, now: float) -> list[str]:
        """Let go of what lies between two holds, and of the oldest where there is too much."""
        while self._recent and self._recent[0][0] < now - BEFORE:
            stamp, message = self._recent.popleft()
            if self._needed(stamp):
                self._kept.append(message)
            else:
                self._size -= len(message.data)
        lost = False
        while self._size > self._most and (self._kept or self._recent):
            oldest = self._kept.popleft() if self._kept else self._recent.popleft()[1]
            self._size -= len(oldest.data)
            lost = True
        if lost and (self._kept or self._recent):
            self._drop_grasps((self._kept[0] if self._kept else self._recent[0][1]).stamp + SCRAP)
        if not lost or self._warned:
            return []
        self._warned = True
        return [f"more than {self._most / 1e6:g} MB were heard: the oldest is forgotten from now on (memory)"]

    def _drop_grasps(self, before: float) -> None:
        """Let go of what was said on grasps before, but for the last word: nothing is left of those holds."""
        past = [one for one in self._rare if one.topic == GRASPS_TOPIC and one.stamp <= before][:-1]
        if past:
            self._rare = [one for one in self._rare if one not in past]

    def _needed(self, stamp: float) -> bool:
        """Tell whether a message lies within a hold, or just before or after one."""
        if self._held_since is not None and stamp >= self._held_since - BEFORE:
            return True
        return any(start - BEFORE <= stamp <= end + AFTER for start, end in self._holds)


def recording_of(messages: Iterable[Message], since: float = -math.inf) -> Recording:
    """Return what messages say as a recording.

    Args:
        messages: as they are kept.
        since: what was let go of before need not be complete, as where its body has left the scene [s].

    Raises:
        BagError: a topic is missing or a stream is malformed.
    """
    builder = RecordingBuilder()
    for message in messages:
        builder.add(message.topic, message.decoded())
    return builder.build("what was heard", since=since)
