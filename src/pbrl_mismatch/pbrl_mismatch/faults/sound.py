"""What of a recording can be believed: its faults told apart from physics, each by stream, time and what it is.

What cannot be used at all is refused in a line. What is wrong for a while becomes missing data: no window holds it, and
a note says what was left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Grasp, PoseStream, Recording, WrenchStream
from pbrl_mismatch.data.missing import Missing, seconds_missing
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.faults.carried import check_carried
from pbrl_mismatch.faults.repeats import stopped_poses, stopped_wrenches
from pbrl_mismatch.faults.saturation import saturated
from pbrl_mismatch.faults.tipped import tips
from pbrl_model.sensing.motion import LONGEST_GAP, REFERENCE_SPAN

Array = NDArray[np.float64]

WRENCH_GAP, USUAL_PERIODS = 0.1, 5.0
"""A wrench stream is interrupted where nothing came for so long [s], and for so many of its usual periods."""
MARGIN = 0.05
"""Missing stretches are taken to be longer by so much on both sides [s]: streams are not of one clock."""
TOGETHER = 0.3
"""Stretches of one fault that are closer than this are one [s]."""
FILLED = 0.05
"""Between readings that are put in where none came, so that what comes after can be read [s]; no window has them."""
LEAST_KNOWN, LEAST_SHARE = 2.0, 0.2
"""Held for less than so long [s], or for less than this share, with everything known is too little to diagnose."""
STILL = 0.005
"""A body that stays within this while it is held does not move [m]; turning counts over the radius of gyration."""
FELT = 2.0
"""A wrist that is held on to feels this many times more than its noise, on one axis at least."""
LEAST_READINGS = 20


@dataclass(frozen=True)
class Sound:
    """A recording without what is not to be believed.

    Attributes:
        recording: poses that a stopped tracker repeated are out, gaps in wrenches are filled so that it can be read.
        missing: stretches while the object was held in which something is not known, filled gaps among them.
    """

    recording: Recording
    missing: tuple[Missing, ...]


def without_faults(recording: Recording, name: str) -> Sound:
    """Find out what of a recording can be believed where one object is concerned.

    Args:
        recording: as read.
        name: of the object.

    Raises:
        MismatchError: another object goes along with the gripper, a stream is missing or had stopped throughout, or
            nothing is felt.
    """
    grasps = [grasp for grasp in recording.grasps if grasp.object == name]
    _check_streams(recording, name, grasps)
    _check_followed(recording, name, grasps)
    missing: list[Missing] = []
    poses, grippers = dict(recording.object_poses), dict(recording.gripper_poses)
    wrenches = dict(recording.wrenches)
    poses[name] = _moving(poses[name], grasps, f"pose of {name}", missing)
    _on_its_feet(poses[name], grasps, name, missing)
    for gripper in sorted({grasp.gripper for grasp in grasps}):
        held = [grasp for grasp in grasps if grasp.gripper == gripper]
        if gripper in grippers:
            grippers[gripper] = _moving(grippers[gripper], held, f"pose of {gripper} gripper", missing)
        wrenches[gripper] = _felt(wrenches[gripper], held, f"wrench of {gripper} gripper", missing)
    clean = replace(recording, object_poses=poses, gripper_poses=grippers, wrenches=wrenches)
    check_carried(clean, name)
    return Sound(clean, tuple(missing))


def check_track(track: Track) -> None:
    """Check that what is left of a recording is enough to diagnose an object.

    Raises:
        MismatchError: the object does not move, or too much is missing.
    """
    lost = seconds_missing(track.motions, track.missing)
    known = track.seconds - lost
    if lost > 0.0 and known < max(LEAST_SHARE * track.seconds, min(LEAST_KNOWN, 0.5 * track.seconds)):
        raise MismatchError(
            f"{track.object}: expected a recording that is sound, got one of {track.seconds:.1f} s of which "
            f"{lost:.1f} s are lost: {'; '.join(missing_notes(track))}"
        )
    ways = [np.ptp(motion.state[:, :3], axis=0) * [1.0, 1.0, track.gyration] for motion in track.motions]
    far = max(float(way[: 2 + track.oriented].max()) for way in ways)
    if far < STILL:
        force = float(np.hypot(track.felt[:, 0], track.felt[:, 1]).max())
        raise MismatchError(
            f"{track.object}: expected it to move while it is held, got one that stays within {1000 * far:.1f} mm "
            f"under up to {force:.0f} N; what does not move shows nothing of its physics"
        )


def missing_notes(track: Track) -> tuple[str, ...]:
    """Return a sentence for each fault: what it is, where, and how much was left out for it."""
    notes = []
    for why in dict.fromkeys(each.why for each in track.missing):
        own = [each for each in track.missing if each.why == why]
        lost = seconds_missing(track.motions, own)
        if lost > 0.0:
            times = f"t = {own[0].start:.2f} to {own[0].end:.2f} s"
            more = f" and {len(own) - 1} more times" if len(own) > 1 else ""
            share = 100.0 * lost / track.seconds
            notes.append(f"{why} at {times}{more}: {lost:.1f} s, {share:.0f} % of what was held, are left out")
    return tuple(notes)


def _check_streams(recording: Recording, name: str, grasps: list[Grasp]) -> None:
    if name not in recording.object_poses:
        known = ", ".join(sorted(recording.object_poses)) or "none"
        raise MismatchError(f"{recording.path}: expected poses of {name}, which is held, got those of {known}")
    for grasp in grasps:
        if grasp.gripper not in recording.wrenches:
            known = ", ".join(sorted(recording.wrenches)) or "none"
            raise MismatchError(
                f"{recording.path}: expected the wrench of the {grasp.gripper} gripper, which holds {name}, got a "
                f"wrench of {known}; was the sensor recorded?"
            )


def _check_followed(recording: Recording, name: str, grasps: list[Grasp]) -> None:
    """Raise where a tracker gives one pose throughout."""
    stream = recording.object_poses[name]
    held = np.zeros(len(stream.time), dtype=bool)
    for grasp in grasps:
        held |= (stream.time >= grasp.start) & (stream.time <= grasp.end)
    seen = np.nan_to_num(np.hstack([stream.position, stream.quaternion]))[held]
    if len(seen) > 1 and np.all(seen == seen[0]):
        raise MismatchError(
            f"{recording.path}: {name}: expected poses that change while it is held, got the same one {len(seen)} "
            "times; had its tracker stopped?"
        )


def _moving(stream: PoseStream, grasps: list[Grasp], what: str, missing: list[Missing]) -> PoseStream:
    """Return poses without those that a stopped tracker repeated; note where there are none for long."""
    if len(stream.time) < 2 or not np.isfinite(stream.time).all():
        return stream
    keep = np.ones(len(stream.time), dtype=bool)
    for first, last in stopped_poses(stream):
        keep[first + 1 : last + 1] = False
        stuck = f"{what}: the tracker had stopped and sent one pose"
        _add(missing, grasps, float(stream.time[first]), float(stream.time[last]), stuck)
    for start, end in _gaps(stream.time, LONGEST_GAP):
        _add(missing, grasps, start, end, f"{what}: none came, or its clock jumped,")
    return stream if keep.all() else PoseStream(stream.time[keep], stream.position[keep], stream.quaternion[keep])


def _on_its_feet(stream: PoseStream, grasps: list[Grasp], name: str, missing: list[Missing]) -> None:
    """Note where a body was off some of its feet."""
    found = tips(stream, grasps)
    if found:
        rise, lean = 100.0 * max(tip.rise for tip in found), math.degrees(max(tip.lean for tip in found))
        why = f"{name} was off some of its feet: it rose by up to {rise:.1f} cm and leaned by up to {lean:.0f} deg"
        for tip in found:
            _add(missing, grasps, tip.start, tip.end, why)


def _felt(stream: WrenchStream, grasps: list[Grasp], what: str, missing: list[Missing]) -> WrenchStream:
    """Return wrenches with gaps filled; note gaps, and where the sensor had stopped or was at the end of its range."""
    time = stream.time
    finite = all(np.isfinite(each).all() for each in (time, stream.force))
    if len(time) < 2 or not finite or np.any(np.diff(time) < 0.0):
        return stream  # told by whoever reads it, with time and field
    held = np.zeros(len(time), dtype=bool)
    for grasp in grasps:
        held |= (time >= grasp.start) & (time <= grasp.end)
    _check_felt(stream, held, _before(time, grasps), what)
    for first, last in stopped_wrenches(stream):
        _add(
            missing,
            grasps,
            float(time[first]),
            float(time[last]),
            f"{what}: the sensor had stopped and sent one reading",
        )
    for axis, at in saturated(stream, held).items():
        unit = "N" if axis.startswith("force") else "N m"
        values = (stream.force if axis.startswith("force") else stream.torque)[at]
        most = float(np.abs(values[:, "xyz".index(axis[-1])]).max())
        why = f"{what}: {axis} was at the end of its range, {most:.3g} {unit}"
        for row in np.flatnonzero(at & held).tolist():
            start, end = float(time[max(row - 1, 0)]), float(time[min(row + 1, len(time) - 1)])
            _add(missing, grasps, start, end, why, saturated=True)
    period = float(np.median(np.diff(time)))
    gaps = list(_gaps(time, min(max(WRENCH_GAP, USUAL_PERIODS * period), LONGEST_GAP)))
    for start, end in gaps:
        _add(missing, grasps, start, end, f"{what}: none came, or its clock jumped,")
    return _filled(stream, gaps)


def _before(time: Array, grasps: list[Grasp]) -> NDArray[np.bool_]:
    """Return which times (n,) are those at which weight and bias are read."""
    out = np.zeros(len(time), dtype=bool)
    for grasp in grasps:
        out |= (time >= grasp.start - REFERENCE_SPAN[0]) & (time <= grasp.start - REFERENCE_SPAN[1])
    return out


def _check_felt(stream: WrenchStream, held: NDArray[np.bool_], before: NDArray[np.bool_], what: str) -> None:
    """Raise where a sensor gives one reading throughout, or no more than its noise."""
    values = np.nan_to_num(np.concatenate([stream.force, stream.torque], axis=1))
    if held.sum() < LEAST_READINGS:
        return
    if np.all(values[held] == values[held][0]):
        nothing = "zero" if not values[held].any() else "one reading"
        raise MismatchError(f"{what}: expected it to change, got {nothing} throughout; was the sensor on?")
    if stream.exerted_on != "gripper" or stream.frame != "sensor" or before.sum() < LEAST_READINGS:
        return
    rest, felt = values[before].std(axis=0), values[held].std(axis=0)
    if np.all(rest[:3] > 0.0) and np.all(felt <= FELT * rest):
        raise MismatchError(
            f"{what}: expected a force while something is held, got no more than the sensor's noise "
            f"({felt[:3].max():.2g} N, and {rest[:3].max():.2g} N with nothing held); was the sensor in the hand?"
        )


def _gaps(time: Array, longest: float) -> Iterator[tuple[float, float]]:
    """Yield (start, end) of steps in time that are longer than `longest` [s]."""
    for row in np.flatnonzero(np.diff(time) > longest).tolist():
        yield float(time[row]), float(time[row + 1])


def _filled(stream: WrenchStream, gaps: list[tuple[float, float]]) -> WrenchStream:
    """Return a stream with readings on the straight line across gaps."""
    if not gaps:
        return stream
    extra = [np.arange(start + FILLED, end - 0.5 * FILLED, FILLED) for start, end in gaps]
    time = np.sort(np.concatenate([stream.time, *extra]))

    def across(values: Array) -> Array:
        return np.stack([np.interp(time, stream.time, column) for column in values.T], -1)

    return replace(stream, time=time, force=across(stream.force), torque=across(stream.torque))


def _add(
    missing: list[Missing], grasps: list[Grasp], start: float, end: float, why: str, *, saturated: bool = False
) -> None:
    """Add a stretch if anything was held in it; one that is close to the last of its kind lengthens that."""
    if not any(grasp.start < end and grasp.end > start for grasp in grasps):
        return
    start, end = start - MARGIN, end + MARGIN
    own = next((k for k in range(len(missing) - 1, -1, -1) if missing[k].why == why), None)
    if own is not None and start - missing[own].end < TOGETHER:
        missing[own] = Missing(missing[own].start, max(missing[own].end, end), why, saturated)
    else:
        missing.append(Missing(start, end, why, saturated))
