"""Cuts a recording into episodes: one object, held by the same grippers all the while."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.streams import read_only
from pbrl_bag.types import Array, Grasp, PoseStream, Recording, WrenchStream

FEWEST_POSES = 2


@dataclass(frozen=True)
class Episode:
    """An interval in which the set of grippers that hold an object did not change.

    Attributes:
        object: name of the body.
        start: [s].
        end: [s].
        contacts: (2,) [m] in the object's frame, by gripper: the grippers that hold it.
        poses: of the object, from `start` to `end`.
        gripper_poses: of the grippers that hold it, where observed; one sample more at either end
            where there is one, so that the whole interval can be interpolated.
        wrenches: likewise.
    """

    object: str
    start: float
    end: float
    contacts: Mapping[str, Array]
    poses: PoseStream
    gripper_poses: Mapping[str, PoseStream]
    wrenches: Mapping[str, WrenchStream]

    @property
    def grippers(self) -> tuple[str, ...]:
        """The grippers that hold the object, in order of their names."""
        return tuple(sorted(self.contacts))

    @property
    def duration(self) -> float:
        """Length of the interval [s]."""
        return self.end - self.start


def cut_episodes(recording: Recording) -> tuple[Episode, ...]:
    """Return the episodes of a recording, in order of object and start.

    While one gripper closes after another, a short interval can hold fewer than two poses of the
    object; it tells nothing and is left out, and so is a grasp that the end of the recording cut off.

    Args:
        recording: as read.

    Raises:
        BagError: a grasp of no duration, or one during which its object was never seen or its wrist
            never felt, unless the recording ended right there.
    """
    episodes: list[Episode] = []
    empty: list[tuple[str, list[Grasp]]] = []
    for name in sorted({grasp.object for grasp in recording.grasps}):
        for hold in _holds([grasp for grasp in recording.grasps if grasp.object == name]):
            found = [_episode(recording, name, *interval) for interval in _intervals(hold)]
            useful = [episode for episode in found if len(episode.poses.time) >= FEWEST_POSES]
            episodes += useful
            if not useful:
                empty.append((name, hold))
    end = _end(recording)
    for name, hold in empty:
        if not episodes or max(grasp.end for grasp in hold) < end:
            raise _empty(recording, name, hold)
    for episode in episodes:
        _check_wrenches(recording, episode)
    return tuple(episodes)


def _end(recording: Recording) -> float:
    """Return the time of the last sample [s]."""
    streams: tuple[PoseStream | WrenchStream, ...] = (
        *recording.object_poses.values(),
        *recording.gripper_poses.values(),
        *recording.wrenches.values(),
    )
    return max((float(stream.time[-1]) for stream in streams), default=0.0)


def clip(time: Array, start: float, end: float, margin: int = 0) -> slice:
    """Return the slice of samples in [start, end], with `margin` samples more at either end."""
    first = int(np.searchsorted(time, start, side="left")) - margin
    last = int(np.searchsorted(time, end, side="right")) + margin
    return slice(max(first, 0), min(last, len(time)))


def _holds(grasps: list[Grasp] | tuple[Grasp, ...]) -> list[list[Grasp]]:
    """Group grasps into holds: those that overlap or touch in time belong together."""
    holds: list[list[Grasp]] = []
    until = -np.inf
    for grasp in sorted(grasps, key=lambda grasp: grasp.start):
        if grasp.start <= until and holds:
            holds[-1].append(grasp)
        else:
            holds.append([grasp])
            until = -np.inf
        until = max(until, grasp.end)
    return holds


def _intervals(hold: list[Grasp]) -> list[tuple[float, float, tuple[Grasp, ...]]]:
    """Return (start, end, grasps) between changes within one hold."""
    edges = sorted({edge for grasp in hold for edge in (grasp.start, grasp.end)})
    found = []
    for start, end in itertools.pairwise(edges):
        active = tuple(grasp for grasp in hold if grasp.start <= start and grasp.end >= end)
        if active:
            found.append((start, end, active))
    return found


def _episode(recording: Recording, name: str, start: float, end: float, grasps: tuple[Grasp, ...]) -> Episode:
    """Cut the streams of one interval."""
    grippers = [grasp.gripper for grasp in grasps]
    return Episode(
        object=name,
        start=start,
        end=end,
        contacts={grasp.gripper: grasp.contact for grasp in grasps},
        poses=_cut_poses(recording.object_poses[name], start, end, 0),
        gripper_poses={
            side: _cut_poses(recording.gripper_poses[side], start, end, 1)
            for side in grippers
            if side in recording.gripper_poses
        },
        wrenches={side: _cut_wrenches(recording.wrenches[side], start, end) for side in grippers},
    )


def _cut_poses(stream: PoseStream, start: float, end: float, margin: int) -> PoseStream:
    """Return the part of a pose stream within an interval."""
    part = clip(stream.time, start, end, margin)
    return PoseStream(*(read_only(values[part]) for values in (stream.time, stream.position, stream.quaternion)))


def _cut_wrenches(stream: WrenchStream, start: float, end: float) -> WrenchStream:
    """Return the part of a wrench stream within an interval, one sample more at either end."""
    part = clip(stream.time, start, end, margin=1)
    time, force, torque = (read_only(values[part]) for values in (stream.time, stream.force, stream.torque))
    return WrenchStream(time, force, torque, stream.exerted_on, stream.frame, stream.covariance)


def _empty(recording: Recording, name: str, hold: list[Grasp]) -> BagError:
    """Return the error for a hold with nothing to learn from."""
    start, end = min(grasp.start for grasp in hold), max(grasp.end for grasp in hold)
    grippers = " and ".join(sorted({grasp.gripper for grasp in hold}))
    if end <= start:
        return BagError(
            f"{recording.path}: t = {start:.6f} s: grasps: {grippers} on {name!r}: expected an episode, got one of "
            "zero length; release later, or cut the grasp out of the recording"
        )
    time = recording.object_poses[name].time
    n = len(time[clip(time, start, end)])
    return BagError(
        f"{recording.path}: t = {start:.6f} to {end:.6f} s: object_poses.{name}: expected at least {FEWEST_POSES} "
        f"poses while {grippers} holds it, got {n}; was its tag hidden?"
    )


def _check_wrenches(recording: Recording, episode: Episode) -> None:
    """Raise a BagError where a gripper that holds the object felt nothing all the while."""
    for side, wrench in episode.wrenches.items():
        if len(wrench.time[clip(wrench.time, episode.start, episode.end)]) < FEWEST_POSES:
            raise BagError(
                f"{recording.path}: t = {episode.start:.6f} to {episode.end:.6f} s: wrenches.{side}: expected at least "
                f"{FEWEST_POSES} samples while it holds {episode.object!r}, got fewer; was the sensor on?"
            )
