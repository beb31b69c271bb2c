"""What a body did at each moment, beside the wrench that a model lacks then.

Moments of the smoother are alike over its memory; a regression takes one in each memory, and passes what it fits
through the same smoother (`refined` of `regression.py`), so that what the smoother holds back weakens no law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import MEMORY, ResidualWrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.errors import MismatchError

Array = NDArray[np.float64]

MOST = 600
LEAST = 8
SPAN = 0.15
"""Half the time over which an acceleration is taken [s]."""


@dataclass(frozen=True)
class Samples:
    """N moments; forces in world axes at the centre of mass.

    Attributes:
        time: (N,) [s].
        place: (N, 2) of the centre of mass [m].
        heading: (N,) [rad].
        velocity: (N, 2) [m/s].
        spin: (N,) [rad/s].
        acceleration: (N, 3) [m/s^2, m/s^2, rad/s^2].
        wrench: (N, 3) left-out wrench as smoothed [N, N, N m].
        covariance: (N, 3, 3) of `wrench`.
        gyration: radius that turns a force scale into a torque scale [m].
    """

    time: Array
    place: Array
    heading: Array
    velocity: Array
    spin: Array
    acceleration: Array
    wrench: Array
    covariance: Array
    gyration: float

    def __len__(self) -> int:
        return len(self.time)

    @property
    def scale(self) -> Array:
        """Return (3,) of a unit of force in each component [1, 1, m]."""
        return np.array([1.0, 1.0, self.gyration])

    def take(self, rows: NDArray[np.int64]) -> Samples:
        """Return some of the moments."""
        return Samples(
            self.time[rows],
            self.place[rows],
            self.heading[rows],
            self.velocity[rows],
            self.spin[rows],
            self.acceleration[rows],
            self.wrench[rows],
            self.covariance[rows],
            self.gyration,
        )


def samples_of(track: Track, residual: ResidualWrench) -> Samples:
    """Return every moment of a residual wrench."""
    return replace(moved(track, residual.state), wrench=residual.world, covariance=residual.covariance)


def moved(track: Track, state: Array) -> Samples:
    """Return every moment of a track whose body was at states (T, 6), with no wrench beside."""
    rows = np.arange(len(state))
    ahead, behind = _neighbours(track, rows)
    return Samples(
        track.clock,
        state[:, :2],
        state[:, 2],
        state[:, 3:5],
        state[:, 5],
        (state[ahead, 3:] - state[behind, 3:]) / np.maximum((ahead - behind) * track.dt, track.dt)[:, None],
        np.zeros((len(state), 3)),
        np.zeros((len(state), 3, 3)),
        track.gyration,
    )


def apart(track: Track) -> NDArray[np.int64]:
    """Return moments that are as far apart as the smoother's memory, at most `MOST`.

    Raises:
        MismatchError: the recording is too short.
    """
    stride = max(1, round(MEMORY / track.dt), -(-len(track.clock) // MOST))
    rows = np.concatenate(
        [np.arange(b + stride // 2, e + 1, stride) for b, e in zip(track.begin, track.last, strict=True)]
    )
    if len(rows) < LEAST:
        raise MismatchError(
            f"{track.object}: expected at least {LEAST * MEMORY:.0f} s of motion to describe what is left out, "
            f"got {track.seconds:.1f} s"
        )
    return rows


def _neighbours(track: Track, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows a little later and a little earlier in the same episode."""
    span = max(1, round(SPAN / track.dt))
    episode = np.searchsorted(track.begin, rows, side="right") - 1
    return np.minimum(rows + span, track.last[episode]), np.maximum(rows - span, track.begin[episode])
