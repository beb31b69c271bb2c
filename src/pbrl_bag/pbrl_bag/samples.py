"""What the streams of a recording have brought so far, before it is checked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pbrl_bag.mapping import PoseSource, WrenchSource
from pbrl_bag.types import Array


@dataclass
class Samples:
    """What one stream has brought so far, in the units and the frame it came in.

    Attributes:
        label: what to call the stream in errors.
        source: how it is read.
        rows: (time, six or seven values) each: position and quaternion, or force and torque; the newest.
        before: the same as arrays (n, 7 or 8), before `rows`.
        lags: when each was heard less its stamp [s], where that is known.
    """

    label: str
    source: PoseSource | WrenchSource
    rows: list[tuple[float, ...]] = field(default_factory=list)
    before: list[Array] = field(default_factory=list)
    lags: list[Array] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.rows) + sum(map(len, self.before))

    def add(self, time: float, values: tuple[float, ...], heard: float | None) -> None:
        """Take one sample, its time put right by what the mapping says of the clock."""
        time += self.source.clock_offset
        self.rows.append((time, *values))
        if heard is not None:
            self.lags.append(np.array([heard - time]))

    def extend(self, rows: Array, heard: Array | None = None) -> None:
        """Take many samples (n, 7 or 8), heard at times (n,) [s]; the same as `add` one by one."""
        if self.rows:
            self.before.append(np.array(self.rows, dtype=np.float64))
            self.rows = []
        rows = rows.copy()
        rows[:, 0] += self.source.clock_offset
        self.before.append(rows)
        if heard is not None:
            self.lags.append(heard - rows[:, 0])

    def array(self, width: int) -> Array:
        """Return the samples as (n, width)."""
        newest = np.array(self.rows, dtype=np.float64).reshape(-1, width)
        return np.concatenate([*self.before, newest]) if self.before else newest
