"""Episodes cut into windows (multiple shooting): short enough that a rollout of each keeps to what was seen.

Every window starts from a state that is not known but has a Gaussian, taken from the smoother and widened: the
smoother has seen the very poses that the window is going to be judged by. An episode that starts at rest knows it.
The limits of the same cut are the thesis's likelihoods: one window a pose (25), one window an episode of which
only the last pose counts (39).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.sensing.motion import Motion

Array = NDArray[np.float64]
Index = NDArray[np.int64]

WIDENING = 9.0
"""Factor on the smoother's covariance of a window's first state."""
REST = np.array([1e-3, 1e-3, 2e-3])
"""Standard deviation of the velocity of a body known to be at rest [m/s, m/s, rad/s]."""
NEARLY_REST = np.array([5e-3, 5e-3, 1e-2])
"""Smoothed velocities below this, or within three of their own standard deviations, are rest."""
POSE_RATE = 20.0
"""So many poses a second count at most: errors of a model are not white, and more of them say nothing new."""
RATE_STEPS = 2
"""Steps to each side over which a wrench's change is taken."""
LEAST_NOISE = np.array([1e-3, 1e-3, 1e-3])
"""Poses are never taken to be better than this [m, m, rad]: no body is rigid, and no gripper holds without play."""


@dataclass(frozen=True)
class Windows:
    """W windows of at most T steps with at most N recorded poses each.

    Attributes:
        dt: [s].
        wrench: (W, T, 3) at the centre of mass, world axes; zero after a window's end.
        rate: (W, T, 3) its change in time [1/s], for wrenches that are a little older or younger than thought; zero
            where their age is taken as known.
        delay: by how much wrenches were shifted to be as late as the poses [s], see `Motion`.
        heading: (W, T) smoothed heading of the body at each step [rad].
        steps: (W,) steps of each window.
        initial: (W, 6) mean of the state of the centre of mass at the start.
        covariance: (W, 6, 6) of it; zero where it is taken as known.
        step: (W, N) the grid step at or before each recorded pose.
        fraction: (W, N) how far it lies towards the next one, 0..1.
        pose: (W, N, 3) recorded poses of the object's frame.
        seen: (W, N, 3) whether that number was observed.
        episode: (W,) which of the motions the window was cut from.
        start: (W,) [s].
        noise: (W, 3) standard deviation of one recorded pose [m, m, rad].
    """

    dt: float
    wrench: Array
    rate: Array
    delay: float
    heading: Array
    steps: Index
    initial: Array
    covariance: Array
    step: Index
    fraction: Array
    pose: Array
    seen: NDArray[np.bool_]
    episode: Index
    start: Array
    noise: Array

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def observations(self) -> int:
        """Return how many numbers were observed."""
        return int(self.seen.sum())

    @property
    def times(self) -> Array:
        """Return (W, N) the times of the recorded poses [s]."""
        return self.start[:, None] + self.dt * (self.step + self.fraction)

    def take(self, rows: Index | NDArray[np.bool_]) -> Windows:
        """Return a selection of the windows."""
        values: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        chosen: dict[str, Any] = {
            name: value if isinstance(value, float) else value[rows] for name, value in values.items()
        }
        return Windows(**chosen)


@dataclass(frozen=True)
class _Cut:
    """One window before it is padded: steps [first, last) of a motion, poses `rows` of it, start known or not."""

    episode: int
    first: int
    last: int
    rows: Index
    known: bool


def _initial(motion: Motion, cut: _Cut) -> tuple[Array, Array]:
    """Return mean and covariance of the state at the start of a window."""
    mean, covariance = motion.state[cut.first].copy(), WIDENING * motion.covariance[cut.first]
    if cut.first == 0:
        deviation = np.sqrt(np.diag(motion.covariance[0])[3:])
        if np.all(np.abs(mean[3:]) < np.maximum(NEARLY_REST, 3.0 * deviation)):
            mean[3:] = 0.0
            covariance[3:, :] = 0.0
            covariance[:, 3:] = 0.0
            covariance[3:, 3:] = np.diag(REST**2)
            if not motion.oriented:
                covariance[5, 5] = 0.0
    return mean, np.zeros((6, 6)) if cut.known else covariance


def _rate(motion: Motion) -> Array:
    """Return (T, 3) the change of the wrench in time, over a span that keeps the sensor's noise out."""
    rows = np.arange(len(motion.wrench))
    after = np.minimum(rows + RATE_STEPS, len(rows) - 1)
    before = np.maximum(rows - RATE_STEPS, 0)
    return (motion.wrench[after] - motion.wrench[before]) / (motion.dt * np.maximum(after - before, 1))[:, None]


def _noise(motion: Motion) -> Array:
    """Return (3,) the noise of a pose; one where it is not observed, which is then not used."""
    return np.where(np.isfinite(motion.noise), np.maximum(motion.noise, LEAST_NOISE), 1.0)


def _assemble(motions: Sequence[Motion], cuts: Sequence[_Cut]) -> Windows:
    """Pad the cuts to arrays."""
    if not cuts:
        raise ModelError("windows: expected at least one window with recorded poses, got none; record a longer episode")
    dt = motions[0].dt
    if any(motion.dt != dt for motion in motions):
        raise ModelError(f"windows: expected motions on one grid step, got {sorted({m.dt for m in motions})} s")
    if any(motion.delay != motions[0].delay for motion in motions):
        raise ModelError(f"windows: expected motions of one delay, got {sorted({m.delay for m in motions})} s")
    count = len(cuts)
    longest, most = max(cut.last - cut.first for cut in cuts), max(len(cut.rows) for cut in cuts)
    wrench, rate, heading = np.zeros((count, longest, 3)), np.zeros((count, longest, 3)), np.zeros((count, longest))
    rates = [_rate(motion) for motion in motions]
    initial, covariance = np.zeros((count, 6)), np.zeros((count, 6, 6))
    step, fraction = np.zeros((count, most), dtype=np.int64), np.zeros((count, most))
    pose, seen = np.zeros((count, most, 3)), np.zeros((count, most, 3), dtype=bool)
    for w, cut in enumerate(cuts):
        motion, n = motions[cut.episode], len(cut.rows)
        wrench[w, : cut.last - cut.first] = motion.wrench[cut.first : cut.last]
        if not cut.known:
            rate[w, : cut.last - cut.first] = rates[cut.episode][cut.first : cut.last]
        heading[w, : cut.last - cut.first] = motion.state[cut.first : cut.last, 2]
        initial[w], covariance[w] = _initial(motion, cut)
        place = np.clip((motion.pose_time[cut.rows] - motion.time[cut.first]) / dt, 0.0, cut.last - cut.first)
        step[w, :n] = np.minimum(np.floor(place), cut.last - cut.first - 1)
        fraction[w, :n] = place - step[w, :n]
        seen[w, :n] = np.isfinite(motion.pose[cut.rows])
        pose[w, :n] = np.where(seen[w, :n], motion.pose[cut.rows], 0.0)
    return Windows(
        dt,
        wrench,
        rate,
        motions[0].delay,
        heading,
        np.array([cut.last - cut.first for cut in cuts], dtype=np.int64),
        initial,
        covariance,
        step,
        fraction,
        pose,
        seen,
        np.array([cut.episode for cut in cuts], dtype=np.int64),
        np.array([motions[cut.episode].time[cut.first] for cut in cuts]),
        np.stack([_noise(motions[cut.episode]) for cut in cuts]),
    )


def shooting_windows(
    motions: Sequence[Motion], length: float, *, least_poses: int = 4, rate: float = POSE_RATE
) -> Windows:
    """Cut motions into windows of about equal length, each with its unknown start.

    Args:
        motions: episodes.
        length: wanted length [s]; a motion is cut into equal parts as near to it as possible.
        rate: poses a second that count at most [1/s].
        least_poses: windows with fewer recorded poses are left out: they say nothing that is not the start.

    Raises:
        ModelError: the length is not positive or no window has enough poses.
    """
    if not (np.isfinite(length) and length > 0.0):
        raise ModelError(f"windows: expected a length above zero, got {length} s")
    cuts = []
    for episode, motion in enumerate(motions):
        steps = len(motion.time) - 1
        parts = max(1, round(steps * motion.dt / length))
        borders = np.linspace(0, steps, parts + 1).round().astype(int)
        for first, last in pairwise(borders.tolist()):
            after = motion.pose_time >= motion.time[first]
            until = motion.pose_time <= motion.time[-1] if last == steps else motion.pose_time < motion.time[last]
            rows = np.flatnonzero(after & until)
            rows = rows[:: max(1, round(len(rows) / ((last - first) * motion.dt * rate)))]
            if len(rows) >= least_poses:
                cuts.append(_Cut(episode, first, last, rows, known=False))
    return _assemble(motions, cuts)


def one_step_windows(motions: Sequence[Motion]) -> Windows:
    """Cut at every recorded pose: from the smoothed state there, predict the next pose alone (25, 26)."""
    cuts = []
    for episode, motion in enumerate(motions):
        place = np.clip(np.round((motion.pose_time - motion.time[0]) / motion.dt).astype(int), 0, len(motion.time) - 1)
        for row in range(1, len(place)):
            if place[row] > place[row - 1]:
                cuts.append(_Cut(episode, int(place[row - 1]), int(place[row]), np.array([row]), known=True))
    return _assemble(motions, cuts)


def integrated_windows(motions: Sequence[Motion]) -> Windows:
    """One window an episode, from its known start; only its last pose counts (39)."""
    cuts = [
        _Cut(episode, 0, len(motion.time) - 1, np.array([len(motion.pose_time) - 1]), known=True)
        for episode, motion in enumerate(motions)
        if len(motion.pose_time) > 0
    ]
    return _assemble(motions, cuts)


def whole_windows(motions: Sequence[Motion]) -> Windows:
    """One window an episode with every pose: for open-loop prediction."""
    cuts = [
        _Cut(episode, 0, len(motion.time) - 1, np.arange(len(motion.pose_time)), known=False)
        for episode, motion in enumerate(motions)
        if len(motion.pose_time) > 0
    ]
    return _assemble(motions, cuts)
