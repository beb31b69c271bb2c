"""From raw samples to checked streams: finite, forward in time, no faster than things move.

Nothing is repaired but what is said in a note: only exact repetitions of a sample are dropped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.types import Array, PoseStream, WrenchStream

POSITION_FLOOR = 0.05  # [m] a jump smaller than this is noise, however short the time step
ANGLE_FLOOR = 0.35  # [rad] likewise for a turn (20 degrees)
QUATERNION_NORM_TOLERANCE = 0.01


@dataclass(frozen=True)
class Limits:
    """The fastest that a pose may change between two samples; beyond it, the stream jumps.

    Attributes:
        speed: [m/s] nobody pushes furniture faster than a sprint's start.
        turn_rate: [rad/s] likewise; a tag seen upside down turns by pi between two frames.
    """

    speed: float = 5.0
    turn_rate: float = 12.0


def read_only(values: Array) -> Array:
    """Return `values` as a contiguous float array that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array


def pose_stream(
    source: str, time: Array, position: Array, quaternion: Array, limits: Limits, notes: list[str]
) -> PoseStream:
    """Check samples of one pose and make them a stream.

    Args:
        source: what to call the stream in an error: a topic, or a file and its columns.
        time: (n,) [s].
        position: (n, 3) [m] in world.
        quaternion: (n, 4) x y z w; rows all NaN where orientation was not observed.
        limits: what counts as a jump.
        notes: appended to when repeated samples are dropped.

    Raises:
        BagError: NaN, a quaternion of length far from 1, time going backwards, a jump.
    """
    time, position, quaternion = map(np.asarray, (time, position, quaternion))
    check_finite(source, time, position, ("position.x", "position.y", "position.z"))
    check_turns(source, time, quaternion)
    keep = _forward(source, time, np.hstack([position, quaternion]), notes)
    time, position = time[keep], position[keep]
    quaternion = quaternion[keep] / np.linalg.norm(quaternion[keep], axis=1, keepdims=True)
    _check_jumps(source, time, position, quaternion, limits)
    return PoseStream(read_only(time), read_only(position), read_only(quaternion))


def wrench_stream(
    source: str, time: Array, force: Array, torque: Array, exerted_on: str, frame: str, notes: list[str]
) -> WrenchStream:
    """Check samples of one wrench and make them a stream.

    Args:
        source: what to call the stream in an error.
        time: (n,) [s].
        force: (n, 3) [N].
        torque: (n, 3) [N m]; all NaN where the sensor has no torque.
        exerted_on: "gripper" or "object", see `WrenchStream`.
        frame: "sensor" or "world".
        notes: appended to when repeated samples are dropped.

    Raises:
        BagError: NaN or infinity in a force or torque, time going backwards.
    """
    time, force, torque = map(np.asarray, (time, force, torque))
    check_finite(source, time, force, ("force.x", "force.y", "force.z"))
    if len(torque) and not np.isnan(torque).all():
        check_finite(source, time, torque, ("torque.x", "torque.y", "torque.z"))
    keep = _forward(source, time, np.hstack([force, torque]), notes)
    return WrenchStream(read_only(time[keep]), read_only(force[keep]), read_only(torque[keep]), exerted_on, frame)


def are_turns(quaternion: Array) -> np.ndarray:
    """Tell which rows (n, 4) are unit quaternions, to a per cent: (n,) bool."""
    return np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) <= QUATERNION_NORM_TOLERANCE


def check_turns(source: str, time: Array, quaternion: Array) -> None:
    """Raise a BagError at the first row (n, 4) that is neither a unit quaternion nor all NaN; times are (n,) [s]."""
    wrong = ~np.isnan(quaternion).all(axis=1) & ~are_turns(quaternion)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise BagError(
            f"{source}: t = {time[i]:.6f} s: orientation: expected a unit quaternion, got "
            f"{np.array2string(quaternion[i], precision=4)} of length {np.linalg.norm(quaternion[i]):.3g}; correct the "
            "publisher, or ignore orientation in a mapping"
        )


def check_finite(source: str, time: Array, values: Array, fields: tuple[str, ...]) -> None:
    """Raise a BagError that names time and field of the first value that is NaN or infinite."""
    finite = np.isfinite(values)
    if finite.all() and np.isfinite(time).all():
        return
    if not np.isfinite(time).all():
        raise BagError(f"{source}: sample {int(np.argmin(np.isfinite(time)))}: time: expected a number, got NaN")
    i, k = np.unravel_index(int(np.argmin(finite)), finite.shape)
    raise BagError(
        f"{source}: t = {time[i]:.6f} s: {fields[k]}: expected a finite number, got {values[i, k]}; "
        "cut the recording around it or repair the sensor's driver"
    )


def _forward(source: str, time: Array, values: Array, notes: list[str]) -> np.ndarray:
    """Return which samples to keep so that time strictly increases; repeated samples are dropped.

    Raises:
        BagError: time goes backwards, or stands still while the values change.
    """
    step = np.diff(time)
    if (step < 0).any():
        i = int(np.argmax(step < 0))
        raise BagError(
            f"{source}: t = {time[i + 1]:.6f} s: stamp: time goes backwards by {-step[i]:.6f} s (sample {i + 1} after "
            f"t = {time[i]:.6f} s); was the clock reset? Cut the recording there"
        )
    still = step == 0
    same = ((values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))).all(axis=1)
    if (still & ~same).any():
        i = int(np.argmax(still & ~same))
        raise BagError(
            f"{source}: t = {time[i]:.6f} s: stamp: two different samples carry one stamp; "
            "stamp each sample with the time of its capture"
        )
    if still.any():
        notes.append(f"{source}: {int(still.sum())} repeated samples left out")
    return np.concatenate([np.ones(min(len(time), 1), dtype=bool), ~still])


def _check_jumps(source: str, time: Array, position: Array, quaternion: Array, limits: Limits) -> None:
    """Raise a BagError where the pose changes faster than `limits` allow."""
    dt = np.diff(time)
    with np.errstate(over="ignore"):  # of a number beyond all measure: it is a jump anyway
        distance = np.linalg.norm(np.diff(position, axis=0), axis=1)
    _jump(source, time, distance, np.maximum(limits.speed * dt, POSITION_FLOOR), "position", "m", limits.speed)
    seen = np.flatnonzero(~np.isnan(quaternion[:, 0]))
    cosine = np.abs(np.sum(quaternion[seen][1:] * quaternion[seen][:-1], axis=1))
    angle = 2.0 * np.arccos(np.clip(cosine, 0.0, 1.0))
    allowed = np.maximum(limits.turn_rate * np.diff(time[seen]), ANGLE_FLOOR)
    _jump(source, time[seen], angle, allowed, "orientation", "rad", limits.turn_rate)


def _jump(source: str, time: Array, change: Array, allowed: Array, field: str, unit: str, limit: float) -> None:
    """Raise a BagError at the first change beyond what is allowed."""
    over = change > allowed
    if over.any():
        i = int(np.argmax(over))
        raise BagError(
            f"{source}: t = {time[i + 1]:.6f} s: {field}: jumps by {change[i]:.3g} {unit} in "
            f"{time[i + 1] - time[i]:.3g} s, expected at most {limit:g} {unit}/s; "
            "cut the recording there, or raise the limit in a mapping"
        )
