"""What a recording must be before anything is learned from it; every fault in one line, by stream and time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon

Array = NDArray[np.float64]


def check_recording(recording: Recording, name: str) -> None:
    """Check the streams and the geometry that an object is learned from.

    Args:
        recording: as read, or made by hand.
        name: of the object.

    Raises:
        ModelError: the object is not known, its outline or mass is not one, or a stream is empty, out of order in time,
            or holds numbers that are not finite. A pose without orientation (NaN throughout) is no fault.
    """
    _check_body(recording, name)
    if name not in recording.object_poses:
        known = sorted(recording.object_poses) or "none"
        raise ModelError(f"object poses: expected a stream for {name}, got {known}")
    held_by = sorted({grasp.gripper for grasp in recording.grasps if grasp.object == name})
    stream = recording.object_poses[name]
    _check_times(f"pose of {name}", stream.time)
    _check_finite(f"pose of {name}", "position", stream.time, stream.position)
    _check_finite(f"pose of {name}", "orientation", stream.time, stream.quaternion, missing=True)
    for gripper in held_by:
        if gripper in recording.gripper_poses:
            pose, what = recording.gripper_poses[gripper], f"pose of {gripper} gripper"
            _check_times(what, pose.time)
            _check_finite(what, "position", pose.time, pose.position)
            _check_finite(what, "orientation", pose.time, pose.quaternion, missing=True)
        if gripper in recording.wrenches:
            _check_times(f"wrench of {gripper} gripper", recording.wrenches[gripper].time)


def _check_body(recording: Recording, name: str) -> None:
    if name not in recording.bodies:
        raise ModelError(f"geometry: expected that of {name}, got {sorted(recording.bodies) or 'none'}; map it")
    body = recording.bodies[name]
    try:
        check_polygon(body.footprint)
    except ModelError as error:
        raise ModelError(f"{name}: {error}") from None
    if not (math.isnan(body.nominal_mass) or 0.0 < body.nominal_mass < math.inf):
        raise ModelError(f"{name}: expected a nominal mass above zero [kg], or NaN for none, got {body.nominal_mass}")


def _check_times(what: str, time: Array) -> None:
    if len(time) == 0:
        raise ModelError(f"{what}: expected readings, got an empty stream")
    if not np.all(np.isfinite(time)):
        raise ModelError(f"{what}: expected finite times, got {time[~np.isfinite(time)][0]}")
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        raise ModelError(
            f"{what}: expected times in order, got t = {time[back[0] + 1]:.3f} s after {time[back[0]]:.3f} s"
        )


def _check_finite(what: str, part: str, time: Array, values: Array, *, missing: bool = False) -> None:
    """Complain of numbers that are not finite; rows of nothing but NaN are not observed, where that may be."""
    broken = ~np.all(np.isfinite(values), axis=-1)
    if missing:
        broken &= ~np.all(np.isnan(values), axis=-1)
    if np.any(broken):
        row = int(np.argmax(broken))
        raise ModelError(
            f"{what}: expected a finite {part}, got {values[row].tolist()} at t = {time[row]:.3f} s; cut it out"
        )
