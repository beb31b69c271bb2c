"""Readings at the end of a wrist sensor's range: there was more than it shows, and nobody knows how much.

A recording does not say what its sensor can show. But a range that is reached gives itself away: readings pile up on
one value that is never passed, while a force that has its greatest value inside the range passes through all values
next to it, and noise spreads it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import WrenchStream
from pbrl_mismatch.data.missing import runs_of

Array = NDArray[np.float64]

IN_A_ROW = 5
"""Readings at the end of the range, one after the other, that make one look."""
PILED = 2.0
"""So many times more readings lie on the end of a range than close below it."""
CLOSE, FAR = 4.0, 8.0
"""In usual steps from reading to reading: what is close below the end, and how far from rest the end is at least."""
CHANGING = 0.5
"""Share of the readings in which another axis goes on changing: else the whole sensor has stopped, or has no noise."""
AXES = ("force x", "force y", "force z", "torque x", "torque y", "torque z")


def saturated(stream: WrenchStream, held: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Return which readings lie at the end of the range, by axis; axes that stay inside are left out.

    Args:
        stream: of a wrist sensor.
        held: (n,) readings at which something was held, where ends are looked for.
    """
    values = np.concatenate([stream.force, stream.torque], axis=1)
    found = {}
    for axis, name in enumerate(AXES):
        value = values[:, axis]
        if not np.isfinite(value).all():
            continue
        ends = [end for end in (float(value.max()), float(value.min())) if _is_end(values, axis, end, held)]
        if ends:
            at = np.isin(value, ends)
            # Ranges are alike on both sides: a single touch of the other end counts too.
            found[name] = at | np.isin(value, [-end for end in ends])
    return found


def _is_end(values: Array, axis: int, end: float, held: NDArray[np.bool_]) -> bool:
    value = values[:, axis]
    at = (value == end) & held
    runs = [(first, last) for first, last in runs_of(at) if last - first >= IN_A_ROW]
    if not runs:
        return False
    steps = np.abs(np.diff(value))[held[1:] & ~at[1:] & ~at[:-1]]
    steps = steps[steps > 0.0]
    if not len(steps):
        return False
    usual = float(np.median(steps))
    rest = float(np.median(value[~held])) if (~held).any() else 0.0
    near = held & ~at & (np.abs(value - end) < CLOSE * usual)
    piled = sum(last - first for first, last in runs)
    others = np.delete(values, axis, axis=1)
    changing = np.mean([np.any(np.diff(others[a:b], axis=0) != 0.0, axis=1).mean() for a, b in runs])
    return piled > PILED * int(near.sum()) and abs(end - rest) > FAR * usual and float(changing) > CHANGING
