"""How punctual nodes were, by a recording: each command by the simulated clock that was told before it was sent."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import files_of_bag

Array = NDArray[np.float64]

CLOCK = "/clock"
PERIODS: Mapping[str, float] = {"/cmd_vel": 0.01, "/object_twist_command": 0.02}
"""Of what is sent again and again while the robot is commanded [s of simulated time]."""
DEADLINES: Mapping[str, float] = {"/cmd_vel": 0.1, "/object_twist_command": 0.07}
"""After which who obeys takes it that nobody commands any more, and halts [s of simulated time]."""
UNEVEN = 2.0
"""Periods from one to the next beyond which a tick is called uneven: the clock itself is told every 10 ms."""
SMALL = 1e-6
PAUSE = 0.5
"""[s] of silence after which nothing was commanded: no deadline ran."""
STAMP = struct.Struct("<iI")
HEAD = 4
"""[bytes] before the fields of a message in CDR."""


@dataclass(frozen=True)
class Ticks:
    """How punctual one topic was.

    Attributes:
        count: of ticks that were due.
        missed: share of them that came after the deadline.
        uneven: share of them that came later than two periods after the one before.
        longest: time from one to the next [s of simulated time].
        gap: longest time in which nothing at all was recorded though the clock went on [s of simulated time].
        minutes: of the wall clock since the beginning, one after another.
        uneven_by_minute: share of uneven ones in each.
    """

    count: int
    missed: float
    uneven: float
    longest: float
    gap: float
    minutes: tuple[float, ...]
    uneven_by_minute: tuple[float, ...]


def read_ticks(bag: Path) -> dict[str, Ticks]:
    """Return how punctual each topic of `PERIODS` was.

    Raises:
        BagError: the recording cannot be read.
    """
    clock: list[tuple[float, float]] = []
    sent: dict[str, list[float]] = {topic: [] for topic in PERIODS}
    for path in files_of_bag(bag):
        for message in McapFile(path).messages():
            when = message.publish_time / 1e9  # when it was heard is the recorder's own affair
            if message.topic == CLOCK:
                second, nano = STAMP.unpack_from(message.data, HEAD)
                clock.append((when, second + 1e-9 * nano))
            elif message.topic in sent:
                sent[message.topic].append(when)
    wall, simulated = np.array(sorted(clock)).reshape(-1, 2).T
    gap = float(np.diff(simulated, prepend=0.0).max(initial=0.0))  # a clock that is set back is another room's
    found = {}
    for topic, times in sent.items():
        ordered = np.sort(times)
        ordered = ordered[ordered >= wall[0]] if len(wall) else ordered[:0]
        shown = simulated[np.searchsorted(wall, ordered, side="right") - 1]
        rows = np.column_stack(((ordered - ordered[0]) / 60.0, shown)) if len(ordered) else np.zeros((0, 2))
        found[topic] = ticks_of(rows, PERIODS[topic], DEADLINES[topic], gap)
    return found


def ticks_of(rows: Array, period: float, deadline: float, gap: float) -> Ticks:
    """Return how punctual a topic was.

    Args:
        rows: (n, 2) when each message came, on the wall clock [min] and on the simulated one [s].
        period: in which they are due [s].
        deadline: from one to the next [s].
        gap: of the recording [s].
    """
    since = np.diff(rows[:, 1])
    going = (since >= 0.0) & (since < PAUSE)
    minute, since = rows[1:, 0][going], since[going]
    if not len(since):
        return Ticks(0, 0.0, 0.0, 0.0, gap, (), ())
    due = np.maximum(since / period, 1.0)
    late, uneven = since > deadline + SMALL, since > UNEVEN * period + SMALL
    bins = np.floor(minute).astype(int)
    each = [(uneven[bins == k].sum() / due[bins == k].sum()) for k in np.unique(bins)]
    return Ticks(
        round(due.sum()),
        float(late.sum() / due.sum()),
        float(uneven.sum() / due.sum()),
        float(since.max()),
        gap,
        tuple(map(float, np.unique(bins))),
        tuple(map(float, each)),
    )
