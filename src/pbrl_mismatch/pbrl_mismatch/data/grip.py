"""How a gripper moves against what it holds: the place where it holds on, seen from the body, beside what is felt.

The motion of a body under a felt wrench is the same however softly it is held. What the hold gives way is seen between
the gripper's pose and the body's. The body's smoothed pose is off for some readings in a row, so that readings are
taken together in groups, of which neighbours still err somewhat alike. It also cuts corners, by about half the square
of the smoother's width times the acceleration, which goes with the force as what a hold gives does: a group has the
mean of what was recorded, which is off to no side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Grasp, PoseStream, Recording
from pbrl_mismatch.data.missing import in_missing
from pbrl_mismatch.data.track import Track
from pbrl_model.sensing.motion import Motion

Array = NDArray[np.float64]

MARGIN = 0.3
"""Left out at both ends of a grasp, while plates close and open [s]."""
FIRST = 0.6
"""The gripper's own point that holds on is where the contact is in this time from the start [s]."""
LEAST = 20
"""Readings of a grasp that are worth a look."""
LEAST_POSES = 3
"""Recorded poses of the body without which a group is left out."""
TOGETHER = 0.6
"""Readings within so long are one: the body's smoothed pose errs alike for about that time [s]."""


@dataclass(frozen=True)
class GripTrack:
    """N means of readings of grippers while they held an object.

    Attributes:
        grasp: (N,) which grasp each belongs to, from zero.
        time: (N,) [s].
        place: (N, 2) of the gripper's point that holds on, less the contact, in the body's frame [m].
        heading: (N,) of the body [rad].
        turn: (N,) of the gripper against the body [rad]: an edge turns between its plates.
        contact: (N, 2) where it was said to hold on, in the body's frame [m].
        force: (N, 2) felt, in the body's axes [N].
        velocity: (N, 2) of the contact, in the body's axes [m/s].
    """

    grasp: NDArray[np.int64]
    time: Array
    place: Array
    heading: Array
    turn: Array
    contact: Array
    force: Array
    velocity: Array


def lay_grips(recording: Recording, track: Track) -> GripTrack | None:
    """Return how grippers moved against an object; None where no gripper was seen.

    Only grasps by one gripper count: with two, who feels what is not known apart.

    Args:
        recording: with the grippers' poses.
        track: of the object.
    """
    parts: list[tuple[Array, ...]] = []
    for episode, motion in enumerate(track.motions):
        gripper = motion.grippers[0]
        stream = recording.gripper_poses.get(gripper)
        if len(motion.grippers) != 1 or stream is None:
            continue
        grasps = [each for each in recording.grasps if each.gripper == gripper and each.object == track.object]
        grasp = min(grasps, key=lambda each: abs(each.start - motion.time[0]))
        found = _readings(track, episode, motion, grasp, stream)
        if found is not None:
            parts.append(found)
    if not parts:
        return None
    number = np.concatenate([np.full(len(part[0]), k) for k, part in enumerate(parts)])
    return GripTrack(number.astype(np.int64), *(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _readings(track: Track, episode: int, motion: Motion, grasp: Grasp, stream: PoseStream) -> tuple[Array, ...] | None:
    rows = slice(int(track.begin[episode]), int(track.last[episode]) + 1)
    clock = track.clock[rows]
    keep = (stream.time > clock[0] + MARGIN) & (stream.time < clock[-1] - MARGIN)
    keep &= ~in_missing(stream.time, track.missing)
    # A pose that has no orientation says where the gripper is, and not where what it holds is.
    keep &= np.isfinite(stream.position).all(axis=1) & np.isfinite(stream.quaternion).all(axis=1)
    if keep.sum() < LEAST:
        return None
    time, gripper = stream.time[keep], stream.position[keep][:, :2]
    turn = _yaw(stream.quaternion[keep])
    state, lever = _smoothed(track, rows, time, grasp)
    mount, felt = track.mount[rows], track.felt[rows]
    world = np.stack([mount[:, 0] * felt[:, 0] - mount[:, 1] * felt[:, 1]], -1)
    world = np.column_stack([world, mount[:, 1] * felt[:, 0] + mount[:, 0] * felt[:, 1]])
    force = np.stack([np.interp(time, clock, world[:, k]) for k in range(2)], -1)
    early = time < time[0] + FIRST
    hold = _turned(-turn, state[:, :2] + lever - gripper)[early].mean(axis=0)
    there = gripper + _turned(turn, np.broadcast_to(hold, gripper.shape))
    place = _turned(-state[:, 2], there - state[:, :2] - lever)
    speed = state[:, 3:5] + state[:, 5:] * np.column_stack([-lever[:, 1], lever[:, 0]])
    contact = np.broadcast_to(grasp.contact[:2], (len(time), 2))
    across, along = _turned(-state[:, 2], force), _turned(-state[:, 2], speed)
    off, seen = _put_back(time, *_cut_corners(track, rows, motion, grasp))
    if not seen.any():
        return None
    place = place - off
    columns = (time, place, state[:, 2], turn - state[:, 2], contact, across, along)
    return tuple(_together(time[seen], each[seen]) for each in columns)


def _smoothed(track: Track, rows: slice, time: Array, grasp: Grasp) -> tuple[Array, Array]:
    """Return smoothed states (n, 6) at times, and the contact's place from the centre of mass (n, 2) in world axes."""
    state = np.stack([np.interp(time, track.clock[rows], track.seen[rows, k]) for k in range(6)], -1)
    return state, _turned(state[:, 2], np.broadcast_to(grasp.contact[:2] - track.body[1:3], (len(time), 2)))


def _cut_corners(track: Track, rows: slice, motion: Motion, grasp: Grasp) -> tuple[Array, Array]:
    """Return times (n,) of recorded poses, and how far each has the contact (n, 2) off the smoothed one, body axes."""
    known = np.all(np.isfinite(motion.pose), axis=1) & ~in_missing(motion.pose_time, track.missing)
    time, pose = motion.pose_time[known], motion.pose[known]
    state, lever = _smoothed(track, rows, time, grasp)
    recorded = pose[:, :2] + _turned(pose[:, 2], np.broadcast_to(grasp.contact[:2], (len(time), 2)))
    return time, _turned(-state[:, 2], recorded - state[:, :2] - lever)


def _put_back(time: Array, recorded: Array, cut: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return means (n, 2) of what was cut off (m, 2) in the groups of readings, and which had poses enough for one.

    Args:
        time: (n,) of the readings.
        recorded: (m,) times of the poses.
        cut: (m, 2).
    """
    groups, at = np.unique(_group(time, time[0]), return_inverse=True)
    of = _group(recorded, time[0])
    within = np.isin(of, groups) & (recorded <= time[-1])
    where = np.searchsorted(groups, of[within])
    count, sums = np.bincount(where, minlength=len(groups)), np.zeros((len(groups), 2))
    np.add.at(sums, where, cut[within])
    return (sums / np.maximum(count, 1)[:, None])[at], (count >= LEAST_POSES)[at]


def _group(time: Array, first: float) -> NDArray[np.int64]:
    """Return which span of `TOGETHER` times (n,) lie in, from the first reading's on."""
    return np.floor((time - first) / TOGETHER).astype(np.int64)


def _together(time: Array, values: Array) -> Array:
    """Return the means of values (n, ...) within spans of `TOGETHER`, empty spans left out."""
    _, span, count = np.unique(_group(time, time[0]), return_inverse=True, return_counts=True)
    sums = np.zeros((len(count), *values.shape[1:]))
    np.add.at(sums, span, values)
    return sums / count.reshape(-1, *(1 for _ in values.shape[1:]))


def _turned(angle: Array, vectors: Array) -> Array:
    """Return vectors (n, 2) turned by angles (n,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]])


def _yaw(quaternion: Array) -> Array:
    """Return the turns (n,) about the vertical [rad] of quaternions (n, 4), x y z w, without jumps."""
    x, y, z, w = quaternion.T
    return np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
