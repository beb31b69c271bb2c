"""Which streams can still be trusted: pure, `now` is given.

A stream is lost when nothing comes any more, and frozen when what comes has not changed although the robot moves. At
rest nothing is called frozen: a sensor without noise may well say the same for as long as nothing happens.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pbrl_control.planar import Array
from pbrl_control.settings import WatchSettings

SLOW_STREAM = 2.2
"""Periods of a stream without which it is cut, where that is longer than the settings have it: slow is no fault."""
FORGET = 0.1
"""Share of each new period in what is kept of a stream's."""


class Stream:
    """The last change of one stream, and how long the robot has moved since."""

    def __init__(self) -> None:
        self.seen: float | None = None
        self.moved = 0.0
        self.period = 0.0
        self._value: Array | None = None
        self._before = 0.0

    def feed(self, now: float, value: Array, moving: bool) -> None:
        """Take in a sample that came at `now` [s]; `moving`: whether the robot moves as it was taken."""
        if self._value is None or not np.array_equal(value, self._value):
            self._value, self.moved = value.copy(), 0.0
        elif moving:
            self.moved += max(now - self._before, 0.0)
        if self.seen is not None and now > self.seen:
            since = now - self.seen
            self.period += FORGET * (min(since, 2.0 * self.period) - self.period) if self.period else since
        self.seen = self._before = now


class SensorWatch:
    """Keeps when each stream was last heard of, and says which of those that are needed is lost or frozen.

    Args:
        settings: after what time.
    """

    def __init__(self, settings: WatchSettings) -> None:
        self._settings = settings
        self._streams: dict[str, Stream] = {}

    def feed(self, name: str, now: float, value: Array, *, moving: bool) -> None:
        """Take in a sample (k,) of a stream.

        Args:
            name: as complaints name it, such as "wrench of the left gripper".
            now: when it came [s].
            value: its numbers.
            moving: whether the robot is told to move.
        """
        self._streams.setdefault(name, Stream()).feed(now, value, moving)

    def cut(self, now: float, links: Iterable[str]) -> str:
        """Return which of the streams that were there once says nothing any more, in a sentence; empty where none is.

        A link that is cut stops the robot sooner than a tag that is hidden: nothing of what happens is known then.
        """
        for name in links:
            stream = self._streams.get(name)
            if stream is None or stream.seen is None:
                continue
            if now - stream.seen > max(self._settings.link, SLOW_STREAM * stream.period):
                return f"{name}: expected samples, none for {now - stream.seen:.2f} s; is its source running?"
        return ""

    def complaint(self, now: float, needed: Iterable[str]) -> str:
        """Return what is wrong with the streams that are needed, in a sentence; empty where nothing is."""
        settings = self._settings
        for name in needed:
            stream = self._streams.get(name)
            if stream is None or stream.seen is None:
                return f"{name}: expected a sample, none has come yet"
            age = now - stream.seen
            if age > settings.lost:
                return f"{name}: expected samples, none for {age:.1f} s; is its source running?"
            if stream.moved > settings.frozen:
                return f"{name}: expected changes as the robot moves, got the same for {stream.moved:.1f} s: frozen?"
        return ""
