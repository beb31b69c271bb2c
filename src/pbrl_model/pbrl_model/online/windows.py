"""Windows of an episode while it still goes on: cut as soon as nothing can change them any more.

A window's first state and the noise of its poses come from the smoother, which looks a second ahead. A window that is
that much older than the last sample is complete. Its borders are fixed from the grasp on, so the same windows come out
however often one looks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.sensing.gravity import GravityMethod
from pbrl_model.sensing.motion import MARGIN, Motion, observe
from pbrl_model.sensing.windows import Windows, shooting_windows

Array = NDArray[np.float64]
Stream = PoseStream | WrenchStream

CONTEXT = 3
"""So many windows before the new ones are smoothed with them: the noise of the poses shows in more of them."""
SILENCE = 2.0
"""A stream that lies back by more than this is not waited for [s]."""
SHORTEST = 0.5
"""What is left at the end of an episode is a window of its own if it is as long as this [s]."""
TINY = 1e-6
"""Times nearer than this are one [s]."""


@dataclass(frozen=True)
class Hold:
    """One object in the hands of the same grippers; `ended` tells whether that is over, times in [s]."""

    grippers: tuple[str, ...]
    start: float
    end: float
    ended: bool


@dataclass(frozen=True)
class Piece:
    """Complete windows of one hold, in order and without a gap.

    Attributes:
        windows: W of them.
        motion: the same stretch on one clock.
        since: when the hold began [s].
    """

    windows: Windows
    motion: Motion
    since: float


@dataclass(frozen=True)
class Stretch:
    """What to cut: from `first` to `last` into windows of `length`, smoothed from `begin` on [s]."""

    begin: float
    first: float
    last: float
    length: float


def holds_of(recording: Recording, name: str) -> tuple[Hold, ...]:
    """Return the holds of one object in order; what is still held at the recording's end has not ended."""
    grasps = [grasp for grasp in recording.grasps if grasp.object == name]
    end = last_sample(recording)
    edges = sorted({edge for grasp in grasps for edge in (grasp.start, grasp.end)})
    found = []
    for start, stop in pairwise(edges):
        grippers = tuple(sorted(grasp.gripper for grasp in grasps if grasp.start <= start and grasp.end >= stop))
        if grippers:
            found.append(Hold(grippers, start, stop, stop < end - TINY))
    return tuple(found)


def last_sample(recording: Recording) -> float:
    """Return the time of the last sample of any stream [s]."""
    groups: tuple[Mapping[str, Stream], ...] = (recording.object_poses, recording.gripper_poses, recording.wrenches)
    return max((float(one.time[-1]) for group in groups for one in group.values() if len(one.time)), default=-np.inf)


def known_until(recording: Recording, name: str, grippers: Sequence[str]) -> float:
    """Return until when every stream that an episode needs has come in [s]; one that fell silent is not waited for."""
    streams: list[Stream | None] = [recording.object_poses.get(name)]
    for gripper in grippers:
        streams += [recording.gripper_poses.get(gripper), recording.wrenches.get(gripper)]
    last = [float(stream.time[-1]) for stream in streams if stream is not None and len(stream.time)]
    return max(min(last), last_sample(recording) - SILENCE) if last else -np.inf


def next_stretch(
    recording: Recording, name: str, hold: Hold, *, length: float, since: float, at_the_end: bool = False
) -> Stretch | None:
    """Return what is complete of a hold and was not cut before, None where nothing is.

    Args:
        recording: what has been heard.
        name: of the object.
        hold: of it.
        length: of a window [s].
        since: end of what was cut before [s].
        at_the_end: nothing more will come, so there is nothing to wait for.
    """
    done = max(0, math.ceil((since - hold.start) / length - TINY)) if since > hold.start else 0
    known = known_until(recording, name, hold.grippers)
    ready = known if at_the_end else known - MARGIN
    count = int(np.floor((min(ready, hold.end) - hold.start) / length + TINY))
    first = hold.start + done * length
    if count > done:
        return Stretch(hold.start + max(0, done - CONTEXT) * length, first, hold.start + count * length, length)
    end = hold.end if hold.ended else min(known, hold.end)
    left = end - first
    if not (hold.ended or at_the_end) or ready < end - TINY or left < SHORTEST or since >= end - TINY:
        return None
    before = min(2, int((first - hold.start) / left + TINY))
    return Stretch(first - before * left, first, end, left)


def cut(
    recording: Recording,
    name: str,
    hold: Hold,
    com: Array,
    stretch: Stretch,
    *,
    gravity: GravityMethod = "weight",
    delay: float = 0.0,
) -> Piece:
    """Put a stretch on one clock and cut its windows.

    Args:
        recording: what has been heard.
        name: of the object.
        hold: of it.
        com: (2,) centre of mass in the object's frame [m].
        stretch: of the hold.
        gravity: how raw wrenches are compensated.
        delay: by how much poses come after wrenches [s], see `observe`.

    Raises:
        ModelError: a stream is missing or broken there.
    """
    motion = observe(recording, name, hold.grippers, stretch.begin, stretch.last, com, gravity=gravity, delay=delay)
    windows = shooting_windows([motion], stretch.length)
    windows = windows.take(windows.start > stretch.first - 2.0 * motion.dt)
    if len(windows) == 0:
        raise ModelError(
            f"{name}: expected poses between {stretch.first:.2f} s and {stretch.last:.2f} s, got too few; was its tag "
            "hidden?"
        )
    return Piece(windows, trimmed(motion, stretch.first), hold.start)


def trimmed(motion: Motion, start: float) -> Motion:
    """Return a motion without what lies before `start` [s]."""
    first = int(np.clip(round((start - motion.time[0]) / motion.dt), 0, len(motion.wrench) - 1))
    keep = motion.pose_time >= motion.time[first]
    return replace(
        motion,
        time=motion.time[first:],
        wrench=motion.wrench[first:],
        pose_time=motion.pose_time[keep],
        pose=motion.pose[keep],
        state=motion.state[first:],
        covariance=motion.covariance[first:],
    )


def joined_motion(before: Motion, after: Motion) -> Motion:
    """Return one motion of two, the second of which begins where the first ends; angles go on unbroken."""
    turns = 2 * np.pi * np.round((before.state[-1, 2] - after.state[0, 2]) / (2 * np.pi))
    pose, state = after.pose.copy(), after.state.copy()
    pose[:, 2] += turns
    state[:, 2] += turns
    fresh = after.pose_time > (before.pose_time[-1] if len(before.pose_time) else -np.inf)
    return replace(
        after,
        time=before.time[0] + after.dt * np.arange(len(before.wrench) + len(after.wrench) + 1),
        wrench=np.concatenate([before.wrench, after.wrench]),
        pose_time=np.concatenate([before.pose_time, after.pose_time[fresh]]),
        pose=np.concatenate([before.pose, pose[fresh]]),
        state=np.concatenate([before.state[:-1], state]),
        covariance=np.concatenate([before.covariance[:-1], after.covariance]),
    )


def joined_windows(parts: Sequence[Windows]) -> Windows:
    """Return all windows of several, padded to one shape.

    Raises:
        ModelError: they are of different grids.
    """
    values = {}
    for entry in fields(Windows):
        own = [getattr(part, entry.name) for part in parts]
        if not isinstance(own[0], np.ndarray):
            if any(value != own[0] for value in own):
                raise ModelError(f"windows: expected one {entry.name} to join them, got {sorted(set(own))}")
            values[entry.name] = own[0]
            continue
        widest = max((value.shape[1] for value in own if value.ndim > 1), default=0)
        values[entry.name] = np.concatenate([_padded(value, widest) for value in own])
    return Windows(**values)


def _padded(value: np.ndarray, width: int) -> np.ndarray:
    """Fill the second axis up with zeros."""
    if value.ndim < 2 or value.shape[1] == width:
        return value
    return np.pad(value, [(0, 0), (0, width - value.shape[1])] + [(0, 0)] * (value.ndim - 2))
