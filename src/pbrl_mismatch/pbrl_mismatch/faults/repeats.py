"""Streams that repeat themselves: a tracker or a sensor that has stopped, and goes on sending what it had last.

Readings have noise: two in a row are hardly ever equal to the last bit. Where a stream that else does not repeat itself
gives the same reading for long, nothing was measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream, WrenchStream
from pbrl_mismatch.data.missing import runs_of

Array = NDArray[np.float64]
Run = tuple[int, int]
"""First and last row of readings that are all the same."""

USUAL = 0.05
"""A stream that repeats itself in more than this share of its readings has no noise to judge it by."""
POSES, POSE_SECONDS = 4, 0.3
"""A tracker that has stopped gives the same pose at least so often, for so long [s]."""
WRENCHES, WRENCH_SECONDS = 8, 0.1
"""A wrist sensor that has stopped gives the same wrench at least so often, for so long [s]."""
JUMP = 0.005
"""A body that really stood still is where it was when readings change again [m]."""
ROUGH = 3e-4
"""A tag's noise: half the readings bend away from a line by more than this [m]."""


def equal_runs(time: Array, values: Array, count: int, seconds: float) -> list[Run]:
    """Return the runs of equal rows that are long enough.

    Args:
        time: (n,) [s].
        values: (n, k); NaN equals NaN.
        count: rows that a run has at least.
        seconds: that it lasts at least.
    """
    same = np.all(np.nan_to_num(values[1:]) == np.nan_to_num(values[:-1]), axis=1)
    return [(a, b) for a, b in runs_of(same) if b - a + 1 >= count and time[b] - time[a] >= seconds]


def stopped_poses(stream: PoseStream) -> list[Run]:
    """Return the runs in which a tracker had stopped; what stands still and is seen without noise is none."""
    values = np.concatenate([stream.position, stream.quaternion], axis=1)
    runs = equal_runs(stream.time, values, POSES, POSE_SECONDS)
    if not runs or _repeats(values, runs) > USUAL:
        return []
    noisy = _roughness(stream.position, runs) > ROUGH
    return [run for run in runs if noisy or _jumps(stream.position, run)]


def stopped_wrenches(stream: WrenchStream) -> list[Run]:
    """Return the runs in which a wrist sensor had stopped, or was off."""
    values = np.concatenate([stream.force, stream.torque], axis=1)
    runs = equal_runs(stream.time, values, WRENCHES, WRENCH_SECONDS)
    return runs if runs and _repeats(values, runs) <= USUAL else []


def _outside(count: int, runs: Sequence[Run]) -> NDArray[np.bool_]:
    out = np.ones(count, dtype=bool)
    for first, last in runs:
        out[first : last + 1] = False
    return out


def _repeats(values: Array, runs: Sequence[Run]) -> float:
    """Return the share of readings outside runs that repeat the one before; of a stream of runs alone, one."""
    outside = _outside(len(values), runs)
    both = outside[1:] & outside[:-1]
    if not both.any():
        return 1.0
    return float(np.mean(np.all(np.nan_to_num(values[1:]) == np.nan_to_num(values[:-1]), axis=1)[both]))


def _roughness(position: Array, runs: Sequence[Run]) -> float:
    """Return how far the middle one of readings outside runs lies off the line through its neighbours [m]."""
    outside = _outside(len(position), runs)
    three = outside[2:] & outside[1:-1] & outside[:-2]
    if not three.any():
        return 0.0
    bend = position[1:-1] - 0.5 * (position[2:] + position[:-2])
    return float(np.median(np.linalg.norm(bend[three, :2], axis=1)))


def _jumps(position: Array, run: Run) -> bool:
    last = run[1]
    return last + 1 < len(position) and bool(np.linalg.norm(position[last + 1, :2] - position[last, :2]) > JUMP)
