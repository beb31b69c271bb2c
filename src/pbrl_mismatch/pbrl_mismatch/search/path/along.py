"""Misfit of hypotheses along the recorded path: every window linear in the acceleration, its nuisances projected out.

Where a body went is measured well; what pushed it there is the question. Along a given path every model says how it
would accelerate the body; twice summed over a window that gives poses, with the start's six numbers and a small steady
wrench unknown. All of that is linear, so that the whitening that eliminates the nuisances is made once, for every
hypothesis. A window cannot run away, whatever its length: feet that stick and let go are where they were seen to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.kernels.path_kernel import accelerate_along

Array = NDArray[np.float64]
Index = NDArray[np.int64]

TINY = 1e-14
"""Variance that is added to a start, so that none is singular."""
MOST = 1e3
"""An acceleration that no body has [m/s^2]."""


@dataclass(frozen=True)
class Along:
    """Windows over a path, ready to be compared with models.

    Attributes:
        track: what was recorded.
        path: (T, 6) states of the nominal centre of mass as tags would see it.
        stride: steps between accelerations.
        index: (W, M) which accelerations each window needs.
        operator: (3, W, N, M) from accelerations to whitened poses, by axis.
        still: (3, W, N) whitened poses less those of no acceleration.
        counts: (W,) how many numbers were observed.
        log_det: log determinant of the whitening, all windows together [nat].
    """

    track: Track
    path: Array
    stride: int
    index: Index
    operator: Array
    still: Array
    counts: Array
    log_det: float

    def accelerations(self, rows: Array) -> Array:
        """Return (P, S, 3) of models (P, WIDTH) along the path."""
        track, parts = self.track, []
        for episode in range(len(track.motions)):
            begin, last = int(track.begin[episode]), int(track.last[episode])
            out = np.empty((len(rows), -(-(last + 1 - begin) // self.stride), 3))
            accelerate_along(
                np.ascontiguousarray(rows),
                np.ascontiguousarray(self.path[begin : last + 1]),
                track.felt,
                track.mount,
                track.seen,
                track.clock,
                np.array([begin, last + 1 - begin, begin, last]),
                track.pivot[episode],
                track.body,
                track.outline,
                track.feet,
                self.stride,
                out,
            )
            parts.append(out)
        return np.concatenate(parts, axis=1)

    def residual(self, rows: Array) -> Array:
        """Return (P, W, 3 N) whitened residuals of models (P, WIDTH)."""
        pushed = np.clip(np.nan_to_num(self.accelerations(rows)), -MOST, MOST)
        windows = np.moveaxis(pushed[:, self.index], 0, -1)
        moved = np.stack([self.operator[k] @ windows[:, :, k] for k in range(3)])
        out = self.still[..., None] - moved
        return np.ascontiguousarray(out.transpose(3, 1, 0, 2)).reshape(len(rows), len(self.counts), -1)


def lay_along(cuts: Cuts, path: Array, mass: float, floor: float, stride: int) -> Along:
    """Make windows ready to be compared with models along a path.

    Args:
        cuts: windows.
        path: (T, 6), see `Along`.
        mass: of the body, about [kg].
        floor: size of a sensor's own error [N]; as a torque, times the radius of gyration.
        stride: steps between accelerations.
    """
    track = cuts.track
    windows, poses = cuts.place.shape
    index, within = _needed(cuts, stride)
    spread = np.einsum("wij,wkj->wik", cuts.root, cuts.root)
    pose = _of_centre(cuts)
    scale = floor / mass * np.array([1.0, 1.0, 1.0 / track.gyration])
    operator, still = np.zeros((3, windows, poses, index.shape[1])), np.zeros((3, windows, poses))
    log_det = 0.0
    for w in range(windows):
        sums = _sums(cuts.place[w], int(cuts.span[w, 1]), track.dt)
        group = (within[w] + np.arange(cuts.span[w, 1])) // stride - within[w] // stride
        grouped = np.zeros((poses, index.shape[1]))
        np.add.at(grouped.T, group, sums.T)
        drift = np.column_stack([np.ones(poses), cuts.place[w] * track.dt])
        for k in range(3):
            weight = cuts.weight[w, :, k]
            known = spread[w][np.ix_([k, k + 3], [k, k + 3])] + TINY * np.eye(2)
            start = weight[:, None] * (drift @ np.linalg.cholesky(known))
            steady = weight * sums.sum(axis=1) * scale[k]
            factor = np.linalg.cholesky(np.eye(poses) + start @ start.T + np.outer(steady, steady))
            log_det -= float(np.log(np.diag(factor)).sum())
            whiten = np.linalg.inv(factor) * weight
            gone = pose[w, :, k] - drift @ cuts.told[w, [k, k + 3]]
            operator[k, w] = whiten @ grouped
            still[k, w] = whiten @ np.where(weight > 0.0, gone, 0.0)
    counts = np.maximum(np.sum(cuts.weight > 0.0, axis=(1, 2)), 1).astype(float)
    return Along(track, path, stride, index, operator, still, counts, log_det)


def _needed(cuts: Cuts, stride: int) -> tuple[Index, Index]:
    """Return which accelerations each window needs (W, M), and its first step within its episode (W,)."""
    track = cuts.track
    lengths = -(-(track.last - track.begin + 1) // stride)
    offset = np.concatenate([[0], np.cumsum(lengths)])
    episode = np.searchsorted(track.begin, cuts.span[:, 0], side="right") - 1
    within = cuts.span[:, 0] - cuts.span[:, 2]
    longest = int(np.max((within + cuts.span[:, 1]) // stride - within // stride)) + 1
    first = offset[episode] + within // stride
    return np.minimum(first[:, None] + np.arange(longest), offset[episode + 1][:, None] - 1), within


def _of_centre(cuts: Cuts) -> Array:
    """Return recorded poses of the nominal centre of mass (W, N, 3), its turn next to the start's."""
    body, pose = cuts.track.body, cuts.pose.copy()
    turn = pose[..., 2]
    pose[..., 0] += np.cos(turn) * body[1] - np.sin(turn) * body[2]
    pose[..., 1] += np.sin(turn) * body[1] + np.cos(turn) * body[2]
    started = cuts.told[:, None, 2]
    pose[..., 2] = turn - 2.0 * np.pi * np.round((turn - started) / (2.0 * np.pi))
    return pose


def _sums(place: Array, steps: int, dt: float) -> Array:
    """Return (N, steps) how much an acceleration in each step moves the poses: positions go with the old velocity."""
    since = place[:, None] - 1.0 - np.arange(steps)
    return np.maximum(since, 0.0) * dt * dt
