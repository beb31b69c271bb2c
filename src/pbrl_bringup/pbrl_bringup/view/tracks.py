"""What moves or changes, as the page gets it: planar poses, wrenches and the force at each gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrl_bag import PoseStream, WrenchStream
from pbrl_bringup.view.detail import band, gap_of, thinned

Array = NDArray[np.float64]

METRES, RADIANS, NEWTONS, SECONDS = 4, 4, 2, 4
"""Digits after the point."""


@dataclass(frozen=True)
class PoseTrack:
    """Planar poses of a frame in world.

    Attributes:
        time: (n,) increasing, on the page's clock [s].
        pose: (n, 3) [m, m, rad]; the angle is NaN where it was not observed.
    """

    time: Array
    pose: Array

    def to_json(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return at most `most` of the poses of an interval [s], as columns."""
        rows = thinned(self.time, start, end, most)
        pose = self.pose[rows]
        return {
            "time": listed(self.time[rows], SECONDS),
            "x": listed(pose[:, 0], METRES),
            "y": listed(pose[:, 1], METRES),
            "theta": listed(pose[:, 2], RADIANS),
            "gap": gap_of(self.time),
        }


@dataclass(frozen=True)
class BandTrack:
    """Curves over time.

    Attributes:
        time: (n,) increasing, on the page's clock [s].
        values: (n, k).
    """

    time: Array
    values: Array

    def to_json(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return an interval [s] as a band of at most `most` cells, as columns; `high` is null where it is `low`."""
        found = band(self.time, self.values, start, end, most)
        same = found.high is found.low
        return {
            "time": listed(found.time, SECONDS),
            "low": [listed(column, NEWTONS) for column in found.low.T],
            "high": None if same else [listed(column, NEWTONS) for column in found.high.T],
            "gap": gap_of(self.time),
        }


def pose_track(stream: PoseStream, origin: float) -> PoseTrack:
    """Return the planar part of a stream.

    Args:
        stream: of poses in world.
        origin: time at which the page's clock is zero [s].
    """
    x, y, z, w = stream.quaternion.T
    theta = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return PoseTrack(stream.time - origin, np.column_stack([stream.position[:, :2], theta]))


def wrench_track(stream: WrenchStream, origin: float) -> BandTrack:
    """Return force [N] and, where it was measured, torque [N m] as they were read."""
    values = stream.force if np.isnan(stream.torque).all() else np.hstack([stream.force, stream.torque])
    return BandTrack(stream.time - origin, values)


def force_track(stream: WrenchStream, gripper: PoseStream | None, origin: float) -> BandTrack | None:
    """Return the horizontal force (n, 2) [N] of a gripper on what it holds, in world axes; None: axes not known.

    Of a raw reading, weight and bias are still in it; the weight is vertical and does not show.
    """
    force = stream.force
    if stream.frame == "sensor":
        if gripper is None or not len(gripper.time) or not _turns(gripper.quaternion):
            return None
        nearest = np.clip(np.searchsorted(gripper.time, stream.time), 0, len(gripper.time) - 1)
        force = Rotation.from_quat(gripper.quaternion[nearest]).apply(force.copy())
    sign = -1.0 if stream.exerted_on == "gripper" else 1.0
    return BandTrack(stream.time - origin, sign * force[:, :2])


def _turns(quaternion: Array) -> bool:
    """Tell whether rows (n, 4) are orientations, of whatever length a driver has left them."""
    with np.errstate(over="ignore"):
        length = np.linalg.norm(quaternion, axis=1)
    return bool(np.isfinite(length).all() and (length > 0.0).all())


def listed(values: Array, digits: int) -> list[float | None]:
    """Return numbers rounded, None for those that are not finite: JSON has no NaN."""
    with np.errstate(over="ignore"):
        rounded: Array = np.round(values, digits)
    told: list[float | None] = rounded.tolist()
    if np.isfinite(rounded).all():
        return told
    return [value if value is not None and np.isfinite(value) else None for value in told]
