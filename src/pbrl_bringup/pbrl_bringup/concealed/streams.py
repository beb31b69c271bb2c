"""Long streams of one table that is pushed with nothing concealed: many pushes, laid end to end on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bullet_sim.errors import SimError
from bullet_sim.hand_push import push_by_hand
from pbrl_bag.types import Grasp, PoseStream, Recording, WrenchStream
from pbrl_bringup.concealed import stage as staging
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import Stage
from pbrl_bringup.errors import BringupError

BETWEEN = 3.0
"""Without a word between two simulations [s]: somebody puts the table back."""
GENTLER = 0.85
"""From one try to the next."""
TRIES = 24


def clean_pushes(rng: np.random.Generator, stage: Stage, count: int) -> Recording:
    """Push the table of a stage anew, as a careful robot would, with nothing concealed.

    Args:
        rng: source of randomness.
        stage: whose table it is.
        count: pushes, one after the other.

    Raises:
        BringupError: none of the pushes drawn can be done.
    """
    scene, why = stage.with_concealed({}), ""
    for number in range(TRIES):
        pushes = tuple(staging.draw_push(rng, stage.half, gentle=GENTLER**number) for _ in range(count))
        try:
            found = push_by_hand(scene, pushes, seed=int(rng.integers(2**31)))
        except SimError as error:
            why = str(error)
            continue
        why = found.status if found.status != "done" else staging.violence(found)
        if not why:
            return to_recording(found, scene)
    raise BringupError(f"streams: expected one of {TRIES} drawn series of pushes to succeed, got {why!r} in the last")


def joined(parts: Sequence[Recording]) -> Recording:
    """Return recordings of the same bodies as one, one after the other."""
    shifts, clock = [], 0.0
    for part in parts:
        first, last = _span(part)
        shifts.append(clock - first)
        clock += last - first + BETWEEN
    first_part = parts[0]
    grasps: list[Grasp] = []
    for part, shift in zip(parts, shifts, strict=True):
        grasps += [replace(grasp, start=grasp.start + shift, end=grasp.end + shift) for grasp in part.grasps]
    return replace(
        first_part,
        object_poses={
            name: _poses([part.object_poses[name] for part in parts], shifts) for name in first_part.object_poses
        },
        gripper_poses={
            name: _poses([part.gripper_poses[name] for part in parts], shifts) for name in first_part.gripper_poses
        },
        wrenches={name: _wrenches([part.wrenches[name] for part in parts], shifts) for name in first_part.wrenches},
        grasps=tuple(grasps),
    )


def held_seconds(recording: Recording) -> float:
    """Return how long something is held in a recording [s]."""
    return sum(grasp.end - grasp.start for grasp in recording.grasps)


def _span(recording: Recording) -> tuple[float, float]:
    groups = (recording.object_poses, recording.gripper_poses, recording.wrenches)
    times = [stream.time for group in groups for stream in group.values()]
    return min(float(time[0]) for time in times), max(float(time[-1]) for time in times)


def _poses(streams: Sequence[PoseStream], shifts: Sequence[float]) -> PoseStream:
    return PoseStream(
        np.concatenate([stream.time + shift for stream, shift in zip(streams, shifts, strict=True)]),
        np.concatenate([stream.position for stream in streams]),
        np.concatenate([stream.quaternion for stream in streams]),
    )


def _wrenches(streams: Sequence[WrenchStream], shifts: Sequence[float]) -> WrenchStream:
    return replace(
        streams[0],
        time=np.concatenate([stream.time + shift for stream, shift in zip(streams, shifts, strict=True)]),
        force=np.concatenate([stream.force for stream in streams]),
        torque=np.concatenate([stream.torque for stream in streams]),
    )
