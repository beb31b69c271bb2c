"""Wrenches that last: what floors, loads and sensors do all the time, in a few numbers for a whole recording.

A wrench that may be anything in every window has hundreds of numbers, and a test against it must see twenty nats where
a law would be sure of four. Most of what is left out goes on: it is constant in a frame, resists the motion, or follows
from a mass or an axis that is not where it was thought to be. No law of an effect is among these, only what a wrench
can be proportional to. That a force acts beside where it is thought to is none: millimetres of that are in every
recording.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts, Index
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.unknown.features import steady
from pbrl_mismatch.unknown.samples import Samples, moved
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]


def lasting_wrenches(cuts: Cuts, steps: Index) -> Array:
    """Return what each lasting wrench is at some steps of windows.

    Args:
        cuts: W windows of a track.
        steps: (W, k) of the track.

    Returns:
        (W, k, 3, K) forces in world axes and a torque over the radius of gyration, each of one newton in the root of
        the mean square.
    """
    track = cuts.track
    rows = steps.reshape(-1)
    samples = moved(track, track.seen).take(rows)
    columns = [*(each.values for each in steady(samples)), *_inertial(samples), _turned(track, rows)]
    found = np.concatenate(columns, axis=-1) / np.array([1.0, 1.0, track.gyration])[:, None]
    size = np.sqrt(np.mean(np.sum(found**2, axis=1), axis=0))
    return np.asarray((found / np.where(size > 0.0, size, 1.0)).reshape(*steps.shape, 3, -1))


def zero_errors(cuts: Cuts, steps: Index) -> Array:
    """Return what an error of the sensor's zero is in each hold, of its force along two axes and of its torque.

    Args:
        cuts: W windows of a track of H holds, before each of which the sensor was read at rest.
        steps: (W, k) of the track.

    Returns:
        (W, k, 3, 3 H) as those of `lasting_wrenches`, for one newton, and one newton at the radius of gyration.
    """
    track = cuts.track
    cosine, sine, x, y = (track.mount[steps, k] for k in range(4))
    one, none = np.ones(steps.shape), np.zeros(steps.shape)
    along = np.stack([cosine, sine, (x * sine - y * cosine) / track.gyration], -1)
    across = np.stack([-sine, cosine, (x * cosine + y * sine) / track.gyration], -1)
    zero = np.stack([along, across, np.stack([none, none, one], -1)], -1)
    hold = np.searchsorted(track.begin, cuts.span[:, 2], side="right") - 1
    own = (hold[:, None] == np.arange(len(track.begin))).astype(float)
    return np.asarray(np.einsum("wkij,wh->wkihj", zero, own).reshape(*steps.shape, 3, -1))


def _inertial(samples: Samples) -> Iterator[Array]:
    """Give (N, 3, k) of a mass that comes on, and of a centre of mass that is off by (x, y) in the body."""
    along, turning = samples.acceleration[:, :2], samples.acceleration[:, 2]
    later = samples.time - samples.time.mean()
    yield (-samples.acceleration * [1.0, 1.0, samples.gyration**2] * later[:, None])[..., None]
    off = plane_rotations(samples.heading)
    left = np.stack([-off[:, 1], off[:, 0]], 1)
    force = samples.spin[:, None, None] ** 2 * off - turning[:, None, None] * left
    moment = off[:, :1] * along[:, 1, None, None] - off[:, 1:] * along[:, 0, None, None]
    yield np.concatenate([force, -moment], axis=1)


def _turned(track: Track, rows: Index) -> Array:
    """Return (N, 3, 1) of a force that is felt turned, where the gripper holds."""
    (cosine, sine, along, across), (x, y) = track.mount[rows, :4].T, track.felt[rows, :2].T
    force = -sine * x - cosine * y, cosine * x - sine * y
    return np.stack([*force, along * force[1] - across * force[0]], -1)[..., None]
