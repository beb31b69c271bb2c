"""Stretches of a recording that are not to be believed: windows are cut between them, and none holds any of them.

The felt wrench drives every simulation, and the smoothed poses turn it into world axes. Where a sensor was at the end
of its range, or a stream had stopped, a simulation is wrong from then on; so nothing is simulated across.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import WIDENING, Windows, shooting_windows

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LEAST_PIECE = 0.3
"""Pieces between two missing stretches that are shorter than this are left out too [s]."""


@dataclass(frozen=True)
class Missing:
    """From `start` to `end` [s] something is not known; `why` says of which stream, and what was wrong with it.

    `saturated`: a sensor was at the end of its range, so that there was this much at least.
    """

    start: float
    end: float
    why: str
    saturated: bool = False


def runs_of(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield the rows [first, last) of each run of a mask (n,)."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    yield from zip(np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist(), strict=True)


def in_missing(time: Array, missing: Sequence[Missing], margin: float = 0.0) -> NDArray[np.bool_]:
    """Return which of the times (n,) lie in a missing stretch, or nearer to one than a margin [s]."""
    out = np.zeros(len(time), dtype=bool)
    for each in missing:
        out |= (time >= each.start - margin) & (time <= each.end + margin)
    return out


def seconds_missing(motions: Sequence[Motion], missing: Sequence[Missing]) -> float:
    """Return for how long something is missing while the object was held [s], stretches that overlap counted once."""
    return sum(
        motion.dt * int(in_missing(0.5 * (motion.time[1:] + motion.time[:-1]), missing).sum()) for motion in motions
    )


def known_windows(
    motions: Sequence[Motion], missing: Sequence[Missing], length: float, rate: float
) -> tuple[Windows, Index]:
    """Cut windows of about equal length that hold nothing that is missing.

    Args:
        motions: episodes.
        missing: stretches that are left out.
        length: wanted [s].
        rate: poses a second that count at most [1/s].

    Returns:
        The windows, and (W,) from which of the motions each was cut.

    Raises:
        ModelError: no window has enough poses.
    """
    if not missing:
        windows = shooting_windows(motions, length, rate=rate)
        return windows, windows.episode
    pieces = [(k, first, last) for k, motion in enumerate(motions) for first, last in _known(motion, missing)]
    windows = shooting_windows([_piece(motions[k], first, last) for k, first, last in pieces], length, rate=rate)
    owner = np.array([pieces[piece][0] for piece in windows.episode], dtype=np.int64)
    initial, covariance = windows.initial.copy(), windows.covariance.copy()
    for w, piece in enumerate(windows.episode):
        k, first, _ = pieces[piece]
        if first > 0 and windows.start[w] == motions[k].time[first]:  # begins in mid-motion, not at rest
            initial[w], covariance[w] = motions[k].state[first], WIDENING * motions[k].covariance[first]
    return replace(windows, initial=initial, covariance=covariance, episode=owner), owner


def _known(motion: Motion, missing: Sequence[Missing]) -> Iterator[tuple[int, int]]:
    """Yield steps (first, last) between missing stretches."""
    middle = 0.5 * (motion.time[1:] + motion.time[:-1])
    known = ~in_missing(middle, missing, 0.5 * motion.dt)
    for first, last in runs_of(known):
        if (last - first) * motion.dt >= LEAST_PIECE:
            yield first, last


def _piece(motion: Motion, first: int, last: int) -> Motion:
    """Return steps [first, last) of a motion."""
    kept = (motion.pose_time >= motion.time[first]) & (motion.pose_time <= motion.time[last])
    return replace(
        motion,
        time=motion.time[first : last + 1],
        wrench=motion.wrench[first:last],
        pose_time=motion.pose_time[kept],
        pose=motion.pose[kept],
        state=motion.state[first : last + 1],
        covariance=motion.covariance[first : last + 1],
    )
