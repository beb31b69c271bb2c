"""The wrench that would reconcile a model with what was seen, over time, with its covariance.

An unknown-input smoother: the body's state and a left-out wrench d are estimated together from recorded poses, never
by second differences. d is an Ornstein-Uhlenbeck process of a size that makes the poses most likely. It is linearised
about the recorded path as it was smoothed without any law, then half of the way to what came out, see
`smoother_kernel`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.missing import in_missing
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import WIDTH
from pbrl_mismatch.kernels.path_kernel import pushes_along
from pbrl_mismatch.kernels.smoother_kernel import SIZE, smooth_episode, true_centres
from pbrl_model.sensing.windows import LEAST_NOISE, WIDENING
from pbrl_model.transforms import yaw_matrices

Array = NDArray[np.float64]

MEMORY = 0.4
"""Time in which a left-out wrench forgets itself [s]: a contact's, a border's."""
MEMORIES = (MEMORY, 1.5, 5.0)
"""Those that are tried where none is told: what lasts for a push, or is steady, is lost in the noise of a short one."""
SIZES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Sizes of the left-out force that are tried [N]."""
SMALL = 1
"""Which of them is tried first."""
PASSES, AGAIN, SIZED = 4, 2, 2
"""Times that it is smoothed at most; where a path of a model like it is told; of the first, those that seek a size."""
SETTLED, PART = 0.5, 0.5
"""A gain below this [nat] ends it; each time the path that it is about is nearer to what was found by that part."""
UNKNOWN_FORCE = 1e3
"""Where the felt wrench is missing, nothing is known of what is left out beside it [N]."""


@dataclass(frozen=True)
class ResidualWrench:
    """What a model leaves out, in T steps of a track.

    Attributes:
        time: (T,) [s].
        path: (T, 6) smoothed states of the nominal centre of mass as tags see it.
        state: (T, 6) the same of the model's centre of mass.
        world: (T, 3) left-out wrench at the centre of mass in world axes [N, N, N m].
        covariance: (T, 3, 3) of `world`.
        size: of the left-out force before anything was seen [N].
        log_likelihood: of the poses [nat].
        first: (E,) first row of each episode.
    """

    time: Array
    path: Array
    state: Array
    world: Array
    covariance: Array
    size: float
    log_likelihood: float
    first: NDArray[np.int64]

    @property
    def body(self) -> Array:
        """Return (T, 3) the wrench in the body's axes."""
        return np.einsum("tij,tj->ti", yaw_matrices(-self.state[:, 2]), self.world)

    @property
    def body_covariance(self) -> Array:
        """Return (T, 3, 3) of `body`."""
        turns = yaw_matrices(-self.state[:, 2])
        return turns @ self.covariance @ np.swapaxes(turns, -1, -2)

    @property
    def significance(self) -> Array:
        """Return (T,) how many standard deviations the wrench is from nothing, as a root of chi-square over three."""
        squares = np.einsum("ti,tij,tj->t", self.world, np.linalg.inv(self.covariance), self.world)
        return np.sqrt(np.maximum(squares, 0.0) / 3.0)


def residual_wrench(
    track: Track,
    row: Array,
    *,
    size: float | None = None,
    memory: float | None = MEMORY,
    stride: int = 1,
    about: ResidualWrench | None = None,
) -> ResidualWrench:
    """Estimate what a model leaves out.

    Args:
        track: what was recorded.
        row: (WIDTH,) parameter row of the model.
        size: of the left-out force [N]; None: the likeliest of `SIZES`.
        memory: time in which it forgets itself [s]; None: the likeliest of `MEMORIES`.
        stride: every so many poses are used.
        about: what a model like it leaves out; None: nothing of that kind is known.

    Raises:
        MismatchError: the row does not fit, or a size is not above zero.
    """
    if row.shape != (WIDTH,):
        raise MismatchError(f"residual: expected a row of {WIDTH} columns, got shape {row.shape}")
    for what, value in (("size", 1.0 if size is None else size), ("memory", 1.0 if memory is None else memory)):
        if not (math.isfinite(value) and value > 0.0):
            raise MismatchError(f"residual: expected a {what} above zero, got {value}")
    begun = np.zeros((len(track.clock), SIZE))
    begun[:, :6] = track.seen if about is None else about.path
    if about is not None:
        begun[:, 6:] = about.world
    tried = MEMORIES if memory is None else (memory,)
    passes = PASSES if about is None else AGAIN
    smoothed = [_settled(track, row, size, each, stride, begun, passes) for each in tried]
    found = max(smoothed, key=lambda each: each.likelihood)
    # How far what is missing reaches is said by the data that are there and not by the memory, which may last a push.
    unknown = in_missing(track.clock, track.missing, min(found.memory, MEMORY))
    found.mean[unknown, 6:] = 0.0
    found.spread[unknown, 6:, 6:] += UNKNOWN_FORCE**2 * np.diag([1.0, 1.0, track.gyration**2])
    path, state = np.ascontiguousarray(found.mean[:, :6]), np.empty((len(found.mean), 6))
    true_centres(row, path, track.clock, track.body, state)
    covariance, first = found.spread[:, 6:, 6:], np.asarray(track.begin)
    return ResidualWrench(track.clock, path, state, found.mean[:, 6:], covariance, found.size, found.likelihood, first)


@dataclass(frozen=True)
class _Smoothed:
    """What `_smooth` gives for one size and memory.

    Attributes:
        mean: (T, SIZE) of state and left-out wrench.
        spread: (T, SIZE, SIZE) their covariances.
        size: of the left-out force [N].
        memory: in which it forgets itself [s].
        likelihood: of the poses [nat].
    """

    mean: Array
    spread: Array
    size: float
    memory: float
    likelihood: float


def _settled(
    track: Track, row: Array, size: float | None, memory: float, stride: int, about: Array, passes: int
) -> _Smoothed:
    """Return the likeliest of what is smoothed about one path after the other, from `about` (T, SIZE) on."""
    best, reached = None, SIZES[SMALL] if size is None else size
    for number in range(passes):
        if size is None and number < SIZED:
            reached = _likeliest_size(track, row, memory, stride, about, SIZES.index(reached))
        mean, spread, value = _smooth(track, row, reached, memory, stride, about, back=True)
        gained = math.inf if best is None else value - best.likelihood
        if best is None or gained > 0.0:
            best = _Smoothed(mean, spread, reached, memory, value)
        if abs(gained) < SETTLED:
            break
        about = about + PART * (mean - about)
    assert best is not None
    return best


def _likeliest_size(track: Track, row: Array, memory: float, stride: int, about: Array, best: int) -> float:
    """Return the likeliest of `SIZES` about a path (T, SIZE), climbed to from one: the likelihood has one top."""
    found: dict[int, float] = {}

    def likelihood(k: int) -> float:
        if k not in found:
            found[k] = _smooth(track, row, SIZES[k], memory, stride, about, back=False)[2]
        return found[k]

    for way in (-1, 1):
        while 0 <= best + way < len(SIZES) and likelihood(best + way) > likelihood(best):
            best += way
    return SIZES[best]


def _smooth(
    track: Track, row: Array, size: float, memory: float, stride: int, about: Array, *, back: bool
) -> tuple[Array, Array, float]:
    """Return means (T, SIZE) and covariances (T, SIZE, SIZE) of state and left-out wrench, and the likelihood [nat].

    With `back` unset only the likelihood is one.
    """
    count = len(track.clock)
    mean, spread = np.empty((count, SIZE)), np.empty((count, SIZE, SIZE))
    sizes = size * np.array([1.0, 1.0, track.gyration])
    total = 0.0
    for episode, motion in enumerate(track.motions):
        begin, last = int(track.begin[episode]), int(track.last[episode])
        noise = np.where(np.isfinite(motion.noise), np.maximum(motion.noise, LEAST_NOISE), 1.0)
        place = np.maximum((motion.pose_time - motion.time[0]) / motion.dt, 0.0)
        total += smooth_episode(
            row,
            about[begin : last + 1],
            motion.state[0].copy(),
            WIDENING * motion.covariance[0] + 1e-10 * np.eye(6),
            sizes,
            memory,
            track.felt,
            track.mount,
            track.seen,
            track.clock,
            np.array([begin, last + 1 - begin, begin, last]),
            track.pivot[episode],
            track.body,
            track.outline,
            track.feet,
            np.ascontiguousarray(place[::stride]),
            np.ascontiguousarray(motion.pose[::stride]),
            noise**2,
            mean[begin : last + 1],
            spread[begin : last + 1],
            back,
        )
    return mean, spread, total


def accelerations(track: Track, rows: Array, path: Array, stride: int) -> Array:
    """Return how each model would accelerate the body's centre of mass along a given path.

    Args:
        track: what was recorded.
        rows: (P, WIDTH).
        path: (T, 6) states of the nominal centre of mass, as tags would see it.
        stride: every so many steps.

    Returns:
        (P, n, 3) [m/s^2, m/s^2, rad/s^2], episode after episode.
    """
    parts = []
    for episode in range(len(track.motions)):
        begin, last = int(track.begin[episode]), int(track.last[episode])
        out = np.empty((len(rows), -(-(last + 1 - begin) // stride), 3))
        pushes_along(
            np.ascontiguousarray(rows),
            np.ascontiguousarray(path[begin : last + 1]),
            track.felt,
            track.mount,
            track.seen,
            track.clock,
            np.array([begin, last + 1 - begin, begin, last]),
            track.pivot[episode],
            track.body,
            track.outline,
            track.feet,
            stride,
            out,
        )
        parts.append(out)
    return np.concatenate(parts, axis=1)
