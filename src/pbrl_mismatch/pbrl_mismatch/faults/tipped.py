"""A body that is pushed over: it leans and rises on some of its feet, and what it left the floor with is no plane's.

A wheel that is off the floor holds nothing, and no law of the plane says so: a table that a hand at its top tipped by
three degrees moved for two seconds as if it had none. Tags see it: the body is higher than it was and leans, both more
than their noise. Poses are compared with what a camera and a tag that are not level make of the same places and
headings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pbrl_bag.types import Grasp, PoseStream
from pbrl_mismatch.data.missing import runs_of
from pbrl_model.sensing.clock import planar_yaw

Array = NDArray[np.float64]

SPAN = 0.5
"""Poses are averaged over so long [s]."""
LEAST_ERROR = np.array([1e-3, 2e-3, 2e-3])
"""Of such an average at least: height [m], lean [rad] about two axes. A body on rubber feet gives as much."""
UNLIKE, BEGINS, RISES = 30.0, 11.3, 2.0
"""Off its feet is a body whose height and lean are together off by so many squared deviations (chi-square of three
degrees: by chance once in a million averages), and whose height alone is up by so many deviations; and so it is before
and after for as long as they are off by the second (once in a hundred) and it is up at all."""
LEAST = 40
"""Fewer poses say nothing of what is usual."""
MAD = 1.4826
"""A standard deviation over the median of absolute deviations."""


@dataclass(frozen=True)
class Tip:
    """From `start` to `end` [s] a body was off some of its feet: it rose by `rise` [m] and leaned by `lean` [rad]."""

    start: float
    end: float
    rise: float
    lean: float


def tips(stream: PoseStream, grasps: Sequence[Grasp]) -> list[Tip]:
    """Return when a body was off some of its feet while it was held.

    Args:
        stream: poses of the body; the vertical is the third axis.
        grasps: in which it is looked at.
    """
    time, spaces = stream.time, np.diff(stream.time)
    yaw = planar_yaw(stream.quaternion)
    known = np.isfinite(yaw) & np.isfinite(stream.position).all(axis=1)
    held = [np.flatnonzero(known & (time >= grasp.start) & (time <= grasp.end)) for grasp in grasps]
    if sum(map(len, held)) < LEAST or not np.all(spaces >= 0.0) or np.median(spaces) == 0.0:
        return []
    count = max(round(SPAN / float(np.median(spaces))), 1)
    held = [own for own in held if len(own) >= count]
    if not held:
        return []
    rows = np.unique(np.concatenate(held))
    off = np.full((len(time), 3), math.nan)
    off[rows] = _off_usual(stream, yaw, rows)
    runs = [(own, sliding_window_view(off[own], count, axis=0).mean(axis=-1)) for own in held]
    every = np.concatenate([mean for _, mean in runs])
    # Noise may last: of so few averages their own spread says it less well than that of all poses, were it white.
    white = np.median(np.abs(off[rows]), axis=0) / math.sqrt(count)
    error = np.maximum(MAD * np.maximum(np.median(np.abs(every), axis=0), white), LEAST_ERROR)
    return [tip for own, mean in runs for tip in _stretches(time[own], mean, error, count)]


def _off_usual(stream: PoseStream, yaw: Array, rows: NDArray[np.int64]) -> Array:
    """Return (n, 3) height [m] and lean [rad] beyond what is usual of a body at such a place with such a heading."""
    x, y, z, w = stream.quaternion[rows].T
    seen = np.column_stack([stream.position[rows, 2], 2.0 * (x * z + w * y), 2.0 * (y * z - w * x)])
    place = stream.position[rows, :2] - stream.position[rows, :2].mean(axis=0)
    usual = np.column_stack([np.ones(len(rows)), place, np.cos(yaw[rows]), np.sin(yaw[rows])])
    out = np.empty_like(seen)
    for k, value in enumerate(seen.T):
        middle = float(np.median(value))
        scale = max(MAD * float(np.median(np.abs(value - middle))), float(LEAST_ERROR[k]))
        begin = np.zeros(usual.shape[1])
        # What is tipped must not tell what is usual: its weight falls with its square.
        found = least_squares(_residual, begin, loss="cauchy", args=(usual, (value - middle) / scale))
        out[:, k] = -scale * _residual(found.x, usual, (value - middle) / scale)
    return out


def _residual(coefficients: Array, usual: Array, value: Array) -> Array:
    return np.asarray(usual @ coefficients - value, dtype=np.float64)


def _stretches(time: Array, mean: Array, error: Array, count: int) -> Iterator[Tip]:
    """Yield the stretches in which averages (m, 3) of poses at times (n,) are those of a body off its feet."""
    deviations = mean / error
    unlike, up = np.sum(deviations**2, axis=1), deviations[:, 0]
    tipped = (unlike > UNLIKE) & (up > RISES)
    for first, after in runs_of((unlike > BEGINS) & (up > 0.0)):
        if not tipped[first:after].any():
            continue
        rise, lean = mean[first:after, 0].max(), np.linalg.norm(mean[first:after, 1:], axis=1).max()
        yield Tip(float(time[first]), float(time[after - 1 + count - 1]), float(rise), float(lean))
