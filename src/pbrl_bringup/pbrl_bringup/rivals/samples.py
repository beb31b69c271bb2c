"""A recording as samples, and regimes: bins of time, of floor, of speed and of direction that samples fall into."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.track import Track

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Interval = tuple[float, float]
Regimes = Mapping[str, Mapping[str, Mask]]

EVERY = 0.1
"""Between samples [s]."""
MOVING = 0.02
"""A body that is slower than this, half its turn rate [rad/s] included, stands [m/s]."""
SPAN = 2.0
"""Of a bin of time [s]."""
CELL = 0.2
"""Side of a cell of the floor [m]."""
SPEEDS, SECTORS = 4, 8
"""Bins of speed, as many samples in each, and of direction in the body's axes."""
AXES = ("time", "floor", "speed", "direction")


@dataclass(frozen=True)
class Samples:
    """n samples of one object, `EVERY` seconds apart, over all its episodes.

    Attributes:
        step: (n,) which step of the track.
        time: (n,) [s].
        state: (n, 6) smoothed state of the nominal centre of mass.
        feet: (n, F, 2) where what carries the load stands, in `world` [m].
        moving: (n,) whether the body moves.
    """

    step: NDArray[np.int64]
    time: Array
    state: Array
    feet: Array
    moving: Mask

    def inside(self, intervals: Sequence[Interval]) -> Mask:
        """Return (n,) which samples lie in one of the intervals [s]."""
        found = np.zeros(len(self.time), dtype=bool)
        for start, end in intervals:
            found |= (self.time >= start - 0.5 * EVERY) & (self.time <= end + 0.5 * EVERY)
        return found

    def intervals(self, chosen: Mask) -> tuple[Interval, ...]:
        """Return samples (n,) as intervals [s] from the first to the last of each run; `inside` gives them back."""
        found: list[Interval] = []
        for time in self.time[chosen]:
            if found and time - found[-1][1] < 1.25 * EVERY:
                found[-1] = (found[-1][0], float(time))
            else:
                found.append((float(time), float(time)))
        return tuple(found)


def take_samples(track: Track) -> Samples:
    """Return the samples of a track."""
    stride = max(1, round(EVERY / track.dt))
    steps = np.concatenate([np.arange(b, e + 1, stride) for b, e in zip(track.begin, track.last, strict=True)])
    state = track.seen[steps]
    arms = track.feet - track.body[1:3]
    c, s = np.cos(state[:, 2]), np.sin(state[:, 2])
    turned = np.stack([np.outer(c, arms[:, 0]) - np.outer(s, arms[:, 1]), np.outer(s, arms[:, 0])], -1)
    turned[..., 1] += np.outer(c, arms[:, 1])
    moving = np.hypot(state[:, 3], state[:, 4]) + 0.5 * np.abs(state[:, 5]) > MOVING
    return Samples(steps, track.clock[steps], state, state[:, None, :2] + turned, moving)


def cells_of(places: Array) -> NDArray[np.int64]:
    """Return the floor cells (..., 2) that places (..., 2) [m] lie in."""
    return np.floor(places / CELL).astype(np.int64)


def regimes_of(samples: Samples) -> Regimes:
    """Return the regimes of a recording: by axis and name which samples (n,) are in each; standing ones in none."""
    state, moving = samples.state, samples.moving
    speed = np.hypot(state[:, 3], state[:, 4])
    edges = np.quantile(speed[moving], np.linspace(0.0, 1.0, SPEEDS + 1)) if moving.any() else np.zeros(SPEEDS + 1)
    slow = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, SPEEDS - 1)
    turn = np.arctan2(state[:, 4], state[:, 3]) - state[:, 2]
    sector = np.floor((turn % (2.0 * np.pi)) / (2.0 * np.pi) * SECTORS).astype(int) % SECTORS
    span = np.floor((samples.time - samples.time[0]) / SPAN).astype(int)
    return {
        "time": _bins(span, moving),
        "floor": _floor(samples),
        "speed": _bins(slow, moving),
        "direction": _bins(sector, moving),
    }


def _bins(number: NDArray[np.int64], moving: Mask) -> dict[str, Mask]:
    return {str(each): moving & (number == each) for each in np.unique(number[moving])}


def _floor(samples: Samples) -> dict[str, Mask]:
    """Return the cells that a foot visits: a sample is in as many of them as the body has feet on different cells."""
    cells = cells_of(samples.feet)
    found: dict[str, Mask] = {}
    for number in np.flatnonzero(samples.moving):
        for x, y in cells[number]:
            found.setdefault(f"{x},{y}", np.zeros(len(samples.time), dtype=bool))[number] = True
    return dict(sorted(found.items()))
