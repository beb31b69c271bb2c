"""Levels of detail: long streams as few samples or as a band, so that a page draws no more than it has pixels.

Nothing is smoothed: thinned poses are poses of the stream, and a band reaches from the least to the greatest value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

GAP_STEPS, LEAST_GAP = 8.0, 0.5
"""A stream is interrupted where a step is so many times the usual one, and at least so long [s]."""


@dataclass(frozen=True)
class Band:
    """Values over time as a band.

    Attributes:
        time: (m,) middle of each cell that has samples, or the samples' own times [s].
        low: (m, k) least value in each cell.
        high: (m, k) greatest value in each cell; the same array as `low` where every sample is there.
    """

    time: Array
    low: Array
    high: Array


def inside(time: Array, start: float, end: float) -> slice:
    """Return the samples from `start` to `end` [s], and one more on each side, so that curves reach the border."""
    first, last = np.searchsorted(time, [start, end], side="left")
    return slice(max(int(first) - 1, 0), min(int(last) + 1, len(time)))


def thinned(time: Array, start: float, end: float, most: int) -> Indices:
    """Return at most `most` (at least 2) samples of an interval: every so many, the first and the last of all.

    Args:
        time: (n,) increasing [s].
        start: of the interval [s].
        end: of the interval [s].
        most: how many.
    """
    chosen = inside(time, start, end)
    count = chosen.stop - chosen.start
    if count <= most:
        return np.arange(chosen.start, chosen.stop)
    return chosen.start + np.unique(np.linspace(0, count - 1, most).astype(np.intp))


def band(time: Array, values: Array, start: float, end: float, most: int) -> Band:
    """Return what lies in an interval as a band of at most `most` cells of equal length.

    Where there are no more than two samples a cell, the samples themselves are returned.

    Args:
        time: (n,) increasing [s].
        values: (n, k).
        start: of the interval [s].
        end: of the interval [s].
        most: how many cells.
    """
    chosen = inside(time, start, end)
    time, values = time[chosen], values[chosen]
    if len(time) <= 2 * most:
        return Band(time, values, values)
    edges = np.linspace(time[0], time[-1], most + 1)
    first = np.searchsorted(time, edges[:-1])
    filled = np.diff(np.append(first, len(time))) > 0
    starts = first[filled]
    middle = 0.5 * (edges[:-1] + edges[1:])[filled]
    return Band(middle, np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts))


def gap_of(time: Array) -> float:
    """Return the step of a stream [s] from which on it was interrupted."""
    return LEAST_GAP if len(time) < 2 else max(LEAST_GAP, GAP_STEPS * float(np.median(np.diff(time))))
