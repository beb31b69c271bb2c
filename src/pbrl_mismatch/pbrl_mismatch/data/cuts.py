"""Windows of a track as the kernel wants them, and blocks that are held out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.missing import known_windows
from pbrl_mismatch.data.track import Track
from pbrl_model.sensing.windows import POSE_RATE, WIDENING, Windows

Array = NDArray[np.float64]

KNOCKED = 4.0
"""The start of a grasp is so much less known than smoothing says."""
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Cuts:
    """W windows of a track with at most N poses each.

    Attributes:
        track: that they were cut from.
        span: (W, 4) first step, steps, first and last step of the episode, in steps of the track.
        pivot: (W, 3) see `Track`.
        place: (W, N) where each pose lies, in steps of the window; past the end where there is none.
        told: (W, 6) smoothed state at the start.
        root: (W, 6, 6) its covariance is root root^T.
        pose: (W, N, 3) recorded.
        weight: (W, N, 3) one over the noise of a pose; 0 where nothing was seen.
        start: (W,) [s].
    """

    track: Track
    span: Index
    pivot: Array
    place: Array
    told: Array
    root: Array
    pose: Array
    weight: Array
    start: Array

    def __len__(self) -> int:
        return len(self.span)

    @property
    def observations(self) -> int:
        """Return how many numbers were observed."""
        return int(np.count_nonzero(self.weight))

    @property
    def middle(self) -> Array:
        """Return (W,) the middle of each window [s]."""
        return self.start + 0.5 * self.span[:, 1] * self.track.dt

    @property
    def seconds(self) -> float:
        """Return the time that all windows last together [s]."""
        return float(self.span[:, 1].sum() * self.track.dt)

    def take(self, rows: Index | NDArray[np.bool_]) -> Cuts:
        """Return some of the windows."""
        return Cuts(
            self.track,
            self.span[rows],
            self.pivot[rows],
            self.place[rows],
            self.told[rows],
            self.root[rows],
            self.pose[rows],
            self.weight[rows],
            self.start[rows],
        )


def cut_windows(track: Track, length: float, *, rate: float = POSE_RATE) -> Cuts:
    """Cut a track into windows of about equal length [s] that hold nothing that is missing.

    Raises:
        ModelError: no window has enough poses.
    """
    windows, episode = known_windows(track.motions, track.missing, length, rate)
    starts = np.array([motion.time[0] for motion in track.motions])
    first = np.round((windows.start - starts[episode]) / track.dt).astype(np.int64) + track.begin[episode]
    span = np.stack([first, windows.steps, track.begin[episode], track.last[episode]], -1)
    initial, covariance = windows.initial.copy(), windows.covariance.copy()
    # A body that was let go may still roll when it is taken again, at a centimetre a second say, which smoothing does
    # not tell from rest: what is taken for rest and is none looks like a blow.
    for w in np.flatnonzero(span[:, 0] == span[:, 2]):
        motion = track.motions[int(episode[w])]
        initial[w], covariance[w] = motion.state[0], WIDENING * motion.covariance[0]
    values, vectors = np.linalg.eigh(covariance)
    # Plates that close on a body which is not at rest stop it by a knock: smoothed poses do not know its speed then.
    scale = np.where(span[:, 0] == span[:, 2], KNOCKED, 1.0)
    seen = windows.seen.any(axis=2)
    place = np.where(seen, windows.step + windows.fraction, windows.steps[:, None].astype(float))
    return Cuts(
        track,
        np.ascontiguousarray(span, dtype=np.int64),
        track.pivot[episode],
        place,
        initial,
        scale[:, None, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :],
        windows.pose,
        _weights(windows),
        windows.start,
    )


def _weights(windows: Windows) -> Array:
    return windows.seen / windows.noise[:, None, :]


def held_out_blocks(track: Track, block: float, every: int) -> list[tuple[float, float]]:
    """Return the times (start, end) that are held out: one block of every so many, in each episode.

    Args:
        track: episodes.
        block: length of a block [s].
        every: one of so many is held out.
    """
    out = []
    for motion in track.motions:
        start, end = float(motion.time[0]), float(motion.time[-1])
        count = max(1, round((end - start) / block))
        edges = np.linspace(start, end, count + 1)
        out += [(float(edges[k]), float(edges[k + 1])) for k in range(every // 2, count, every)]
    return out


def inside(cuts: Cuts, blocks: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return (W,) whether the middle of each window lies in one of the blocks."""
    middle = cuts.middle
    out = np.zeros(len(cuts), dtype=bool)
    for start, end in blocks:
        out |= (middle > start) & (middle < end)
    return out


def touching(cuts: Cuts, blocks: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return (W,) whether each window overlaps one of the blocks by more than a step."""
    first, last = cuts.start, cuts.start + cuts.span[:, 1] * cuts.track.dt
    out = np.zeros(len(cuts), dtype=bool)
    for start, end in blocks:
        out |= (last > start + 2 * cuts.track.dt) & (first < end - 2 * cuts.track.dt)
    return out
