"""Links and clocks that fail on purpose: what a simulator publishes and obeys comes late, twice, or not at all.

A scene's `faults:` says which topics, how, and from when on. Room and robot are none the worse; what is said of them
and to them is. No ROS here: messages are whatever has fields.
"""

from __future__ import annotations

import copy
import fnmatch
import heapq
import itertools
import math
from collections.abc import Iterator
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from bullet_sim.settings import NonNegative, Settings

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Delay = Annotated[float, Field(ge=0.0, le=60.0)]
Jump = Annotated[float, Field(ge=-1e6, le=1e6)]

CLOCK = "/clock"
FLOATS = ("float", "double")


class LinkFaults(Settings):
    """What happens to the messages of a topic.

    Attributes:
        lost: probability that one does not come.
        doubled: that it comes twice.
        late: by so much [s of simulated time].
        jitter: and by so much more at most, drawn evenly [s]: what was said first may come last.
        reordered: probability that one is held back until the next has come.
        nan: that one of its numbers is none.
        since: from when on [s of simulated time].
        until: until when; None: to the end.
    """

    lost: Share = 0.0
    doubled: Share = 0.0
    late: Delay = 0.0
    jitter: Delay = 0.0
    reordered: Share = 0.0
    nan: Share = 0.0
    since: NonNegative = 0.0
    until: NonNegative | None = None

    @model_validator(mode="after")
    def _begins_before_it_ends(self) -> Self:
        if self.until is not None and self.until <= self.since:
            raise ValueError(f"expected until after since, {self.since} s, got {self.until} s")
        return self

    def at(self, time: float) -> bool:
        """Tell whether it is so at a time [s]."""
        return self.since <= time and (self.until is None or time < self.until)


class ClockJump(Settings):
    """At a time `at` [s of simulated time] the clock that is told jumps `by` so much [s]; stamps stay as they are."""

    at: NonNegative
    by: Jump


class Faults(Settings):
    """Everything that goes wrong between the simulator and others.

    Attributes:
        links: by topic, or pattern of topics with `*`; of those that fit and are in force the first holds. Published
            topics and commands alike.
        clock: jumps of `/clock`.
    """

    links: dict[str, LinkFaults] = Field(default_factory=dict)
    clock: tuple[ClockJump, ...] = ()

    @property
    def any(self) -> bool:
        """Whether anything goes wrong at all."""
        return bool(self.links or self.clock)


class FaultyLinks:
    """Carries messages as the settings have it; the same messages and seed fail in the same way.

    Args:
        settings: what goes wrong.
        rng: of every draw.
    """

    def __init__(self, settings: Faults, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings, rng
        self._number = itertools.count()
        self._waiting: list[tuple[float, int, str, Any]] = []  # due [s], in which order it was sent, topic, message
        self._held: dict[str, Any] = {}

    def send(self, time: float, topic: str, message: Any) -> None:
        """Take a message at a time [s]; what comes of it, and when, is for `due`."""
        if topic == CLOCK:
            message = self._jumped(time, message)
        fitting = (each for name, each in self._settings.links.items() if fnmatch.fnmatchcase(topic, name))
        faults = next((each for each in fitting if each.at(time)), None)
        if faults is None:
            self._put(time, topic, message)
            self._let_go(time, topic)
            return
        lost, doubled, held, nan, more = self._rng.uniform(size=5)
        if lost < faults.lost:
            return
        if nan < faults.nan:
            message = self._spoilt(message)
        due = time + faults.late + more * faults.jitter
        if held < faults.reordered and topic not in self._held:
            self._held[topic] = message
            return
        self._put(due, topic, message)
        self._let_go(due, topic)
        if doubled < faults.doubled:
            self._put(due, topic, message)

    def due(self, time: float) -> Iterator[tuple[str, Any]]:
        """Yield what arrives by a time [s], topic and message."""
        while self._waiting and self._waiting[0][0] <= time:
            _, _, topic, message = heapq.heappop(self._waiting)
            yield topic, message

    def _put(self, due: float, topic: str, message: Any) -> None:
        heapq.heappush(self._waiting, (due, next(self._number), topic, message))

    def _let_go(self, due: float, topic: str) -> None:
        """Send what was held back behind what came after it."""
        if topic in self._held:
            self._put(due, topic, self._held.pop(topic))

    def _jumped(self, time: float, message: Any) -> Any:
        """Return a clock that has jumped; it never shows less than nothing."""
        by = sum(jump.by for jump in self._settings.clock if time >= jump.at)
        if not by:
            return message
        shown = copy.deepcopy(message)
        total = max(0, shown.clock.sec * 10**9 + shown.clock.nanosec + round(by * 1e9))
        shown.clock.sec, shown.clock.nanosec = divmod(total, 10**9)
        return shown

    def _spoilt(self, message: Any) -> Any:
        """Return the message with one of its numbers not a number; as it is where it has none."""
        spoilt = copy.deepcopy(message)
        places = list(_numbers(spoilt))
        if places:
            holder, name, index = places[int(self._rng.integers(len(places)))]
            if index is None:
                setattr(holder, name, math.nan)
            else:
                getattr(holder, name)[index] = math.nan
        return spoilt


def _numbers(message: Any) -> Iterator[tuple[Any, str, int | None]]:
    """Yield where each floating-point number of a message is: what holds it, the field, and which of a sequence."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            yield from _numbers(value)
        elif isinstance(value, float):
            yield message, name, None
        elif any(word in kind for word in FLOATS):
            yield from ((message, name, index) for index in range(len(value)))
        elif "/" in kind:
            for each in value:
                yield from _numbers(each)
