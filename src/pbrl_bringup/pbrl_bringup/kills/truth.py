"""What a simulator wrote down of its robot's motion, and when that came to rest."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.errors import BringupError

Array = NDArray[np.float64]

ROW = struct.Struct("<5d")
"""Wall clock [s], simulated time [s], speed of the base [m/s], its turning [rad/s], fastest joint [rad/s]; no signs."""
WALL, SIMULATED = 0, 1
STILL = np.array([0.01, 0.02, 0.03])
"""Speed, turning and joint rate below which it is at rest: drives that hold still against a load do half of that."""
SETTLED = 0.1
"""For so long it has to stay below them [s], as far as there is anything to see."""


def read_truth(path: Path) -> Array:
    """Return the rows (n, 5) of a file, without a last one that was cut off; none where there is no file.

    Raises:
        BringupError: it cannot be read.
    """
    try:
        data = path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise BringupError(f"{path}: cannot read: {error.strerror or error}") from error
    whole = len(data) - len(data) % ROW.size
    return np.frombuffer(data[:whole], dtype="<f8").reshape(-1, 5).copy()


def moves(rows: Array, wall: float) -> bool:
    """Tell whether the robot moves at a moment of the wall clock [s], by the last row (5,) before it."""
    before = rows[rows[:, WALL] <= wall]
    return bool(len(before) and (before[-1, 2:] > STILL).any())


def time_to_rest(rows: Array, wall: float, until: float) -> float:
    """Return how long after a moment the robot comes to rest, in simulated time [s].

    Args:
        rows: (n, 5) of one simulator.
        wall: the moment, on the wall clock [s].
        until: what came later on that clock is left aside [s].

    Returns:
        Seconds; infinity where it does not within what there is, NaN where there is nothing to see.
    """
    before = rows[rows[:, WALL] <= wall]
    after = rows[(rows[:, WALL] > wall) & (rows[:, WALL] <= until)]
    if not len(before) or not len(after):
        return float("nan")
    begin = before[-1, SIMULATED]
    moving: NDArray[np.bool_] = np.any(after[:, 2:] > STILL, axis=1)
    for k in np.flatnonzero(~moving):
        settled = after[:, SIMULATED] <= after[k, SIMULATED] + SETTLED
        if not moving[k:][settled[k:]].any():
            return float(after[k, SIMULATED] - begin)
    return float("inf")
