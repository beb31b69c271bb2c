"""Stretches of a recording: what had been heard by a moment, and the last of it for a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_model.online.windows import holds_of, known_until

BEFORE = 2.5
"""Kept before a grasp [s]: weight and bias of a wrist are read there, and the smoother looks back."""
AFTER = 0.5
"""And after its beginning [s]."""
TAIL = 1.0
"""Kept after the last hold [s]."""


def between(recording: Recording, start: float, end: float) -> Recording:
    """Return what was heard from one time to another [s]; a hold that still lasts then ends there.

    Samples around the beginning of a hold that began earlier and lasts are kept, for its reference reading.

    Args:
        recording: all of it.
        start: [s].
        end: [s].
    """
    lasting = [g.start for g in recording.grasps if g.start < start < g.end and g.start <= end]

    def kept(time: NDArray[np.float64]) -> NDArray[np.int64]:
        first, last = np.searchsorted(time, start, "left"), np.searchsorted(time, end, "right")
        rows = [np.arange(first, last)]
        for began in lasting:
            from_, to = np.searchsorted(time, [began - BEFORE, min(began + AFTER, end)])
            rows.append(np.arange(from_, min(to, first)))
        return np.unique(np.concatenate(rows))

    def poses(stream: PoseStream) -> PoseStream:
        rows = kept(stream.time)
        return PoseStream(stream.time[rows], stream.position[rows], stream.quaternion[rows])

    def wrenches(stream: WrenchStream) -> WrenchStream:
        rows = kept(stream.time)
        return replace(stream, time=stream.time[rows], force=stream.force[rows], torque=stream.torque[rows])

    return replace(
        recording,
        object_poses={name: poses(stream) for name, stream in recording.object_poses.items()},
        gripper_poses={name: poses(stream) for name, stream in recording.gripper_poses.items()},
        wrenches={name: wrenches(stream) for name, stream in recording.wrenches.items()},
        grasps=tuple(
            replace(grasp, end=min(grasp.end, end))
            for grasp in recording.grasps
            if grasp.start < end and grasp.end > start
        ),
    )


def last_holds(recording: Recording, name: str, seconds: float) -> Recording:
    """Return the last holds of an object that last so long together [s], each whole, with what comes before them.

    A hold is never cut: its reference reading lies before its beginning. Two grippers that take turns hold it on.
    """
    holds: list[list[float]] = []
    for hold in holds_of(recording, name):
        if holds and hold.start <= holds[-1][1]:
            holds[-1][1] = hold.end
        else:
            holds.append([hold.start, hold.end])
    end = start = holds[-1][1] if holds else 0.0
    total = 0.0
    while holds and total < seconds:
        start, until = holds.pop()
        total += until - start
    return between(recording, start - BEFORE, end + TAIL)


def heard_to_the_end(recording: Recording, name: str, since: float) -> bool:
    """Tell whether an object's last hold ended after `since` [s], and all has come in that `last_holds` takes of it."""
    holds = holds_of(recording, name)
    if not holds or not holds[-1].ended or holds[-1].end <= since:
        return False
    return known_until(recording, name, holds[-1].grippers) >= holds[-1].end + TAIL
