"""Streams of a bag that could play a role: poses by topic and frame, wrenches by topic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bag.decoding import PoseSample, poses_in, wrench_in
from pbrl_bag.foreign_bag import ForeignBag
from pbrl_bag.reader import Decoder, files_of, opened
from pbrl_bag.types import Array

POSES = ("PoseStamped", "PoseWithCovarianceStamped", "Odometry", "TransformStamped")
"""Types of one pose each."""
TRANSFORMS, WRENCH = "TFMessage", "WrenchStamped"
STATIC = "/tf_static"


@dataclass
class PoseCandidate:
    """Poses of one frame.

    Attributes:
        topic: that they came on.
        type: of its messages, without package.
        frame: that they are given in.
        child: the frame that they are of, where the topic carries several; else None.
        rows: (time, position, quaternion) each.
    """

    topic: str
    type: str
    frame: str
    child: str | None
    rows: list[tuple[float, ...]] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Return what tells of what it is: the frame, or the topic."""
        return self.child or self.topic

    def array(self) -> Array:
        """Return (n, 8): time [s], position [m], quaternion x y z w, in order of time, each time once."""
        rows = np.array(self.rows, dtype=float).reshape(-1, 8)
        _, first = np.unique(rows[:, 0], return_index=True)
        return rows[first]


@dataclass
class WrenchCandidate:
    """Wrenches of one topic, given in a frame; `rows` (time, force, torque) each."""

    topic: str
    frame: str
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def array(self) -> Array:
        """Return (n, 7): time [s], force [N], torque [N m], in order of time."""
        rows = np.array(self.rows, dtype=float).reshape(-1, 7)
        return rows[np.argsort(rows[:, 0], kind="stable")]


@dataclass
class Candidates:
    """What a bag holds.

    Attributes:
        types: of all topics.
        poses: by topic, child frame and frame that they are given in.
        wrenches: by topic.
        fixed: (position, quaternion) of a frame in its parent, which never changes, by (parent, child).
    """

    types: dict[str, str] = field(default_factory=dict)
    poses: dict[tuple[str, str, str], PoseCandidate] = field(default_factory=dict)
    wrenches: dict[str, WrenchCandidate] = field(default_factory=dict)
    fixed: dict[tuple[str, str], tuple[Array, Array]] = field(default_factory=dict)


def candidates_of(path: Path) -> Candidates:
    """Read every stream of a bag that could play a role.

    Raises:
        BagError: it cannot be read.
    """
    found = Candidates()
    for file in (opened(name) for name in files_of(path)):
        decode = file.decode if isinstance(file, ForeignBag) else Decoder(file).decode
        for message in file.messages():
            found.types[message.topic] = message.type
            kind = message.type.rsplit("/", 1)[-1]
            if kind in (*POSES, TRANSFORMS, WRENCH):
                _take(found, message.topic, kind, decode(message))
    return found


def _take(found: Candidates, topic: str, kind: str, message: Any) -> None:
    if kind == WRENCH:
        felt = wrench_in(topic, message)
        stream = found.wrenches.setdefault(topic, WrenchCandidate(topic, felt.frame))
        stream.rows.append((felt.time, *felt.force, *felt.torque))
        return
    for child, sample in _samples(topic, kind, message):
        if topic == STATIC and child is not None:
            found.fixed[sample.frame, child] = (np.array(sample.position), np.array(sample.quaternion))
            continue
        key = (topic, child or "", sample.frame)
        one = found.poses.setdefault(key, PoseCandidate(topic, kind, sample.frame, child))
        one.rows.append((sample.time, *sample.position, *sample.quaternion))


def _samples(topic: str, kind: str, message: Any) -> Iterator[tuple[str | None, PoseSample]]:
    """Yield the frames and poses of a message; the frame where a mapping has to name it."""
    if kind != TRANSFORMS:
        yield from ((None, sample) for sample in poses_in(topic, message, None))
        return
    for transform in message.transforms:
        child = str(transform.child_frame_id).lstrip("/")
        yield from ((child, sample) for sample in poses_in(topic, message, child))
