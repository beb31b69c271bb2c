"""Streams of a bag that could play a role: poses by topic and frame, wrenches by topic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bag.clocks import clock_offsets
from pbrl_bag.decoding import PoseSample, poses_in, seconds, wrench_in
from pbrl_bag.errors import BagError
from pbrl_bag.foreign_bag import ForeignBag
from pbrl_bag.reader import Decoder, files_of, opened
from pbrl_bag.streams import are_turns
from pbrl_bag.types import Array

POSES = ("PoseStamped", "PoseWithCovarianceStamped", "Odometry", "TransformStamped")
"""Types of one pose each."""
TRANSFORMS, ARRAY, WRENCH = "TFMessage", "PoseArray", "WrenchStamped"
JOINTS, TEXT = "JointState", "String"
STATIC = "/tf_static"


@dataclass
class PoseCandidate:
    """Poses of one frame.

    Attributes:
        topic: that they came on.
        type: of its messages, without package.
        frame: that they are given in.
        child: the frame that they are of, where the topic carries several transforms; else None.
        index: which of a PoseArray they are; else None.
        rows: (time, position, quaternion) each.
        lags: when each message was heard less its stamp [s].
        clock_offset: what their times were put right by [s].
    """

    topic: str
    type: str
    frame: str
    child: str | None
    index: int | None = None
    rows: list[tuple[float, ...]] = field(default_factory=list)
    lags: list[float] = field(default_factory=list)
    clock_offset: float = 0.0

    @property
    def name(self) -> str:
        """Return what tells of what it is: the frame, or the topic."""
        return self.child or (self.topic if self.index is None else f"{self.topic}/{self.index}")

    def array(self) -> Array:
        """Return (n, 8): time [s], position [m], quaternion x y z w, in order of time, each time once."""
        rows = np.array(self.rows, dtype=float).reshape(-1, 8)
        _, first = np.unique(rows[:, 0], return_index=True)
        return rows[first]


@dataclass
class WrenchCandidate:
    """Wrenches of one topic, given in a frame; `rows` (time, force, torque) each; else as `PoseCandidate`."""

    topic: str
    frame: str
    rows: list[tuple[float, ...]] = field(default_factory=list)
    lags: list[float] = field(default_factory=list)
    clock_offset: float = 0.0

    def array(self) -> Array:
        """Return (n, 7): time [s], force [N], torque [N m], in order of time."""
        rows = np.array(self.rows, dtype=float).reshape(-1, 7)
        return rows[np.argsort(rows[:, 0], kind="stable")]


@dataclass
class JointCandidate:
    """Joint states of one topic.

    Attributes:
        topic: that they came on.
        messages: as decoded, with efforts; in order.
        lags: when each was heard less its stamp [s].
        clock_offset: what their times have to be put right by [s].
    """

    topic: str
    messages: list[Any] = field(default_factory=list)
    lags: list[float] = field(default_factory=list)
    clock_offset: float = 0.0

    @property
    def begins(self) -> float:
        """Return the time of the first, put right [s]."""
        return seconds(self.messages[0].header.stamp) + self.clock_offset

    def driven(self) -> tuple[str, ...]:
        """Return the joints that tell an effort: a number, and not always zero."""
        told: dict[str, list[float]] = {}
        for message in self.messages:
            for name, effort in zip(message.name, message.effort, strict=False):
                told.setdefault(str(name), []).append(float(effort))
        return tuple(name for name, values in told.items() if np.isfinite(values).all() and np.any(values))


@dataclass
class Candidates:
    """What a bag holds.

    Attributes:
        types: of all topics.
        poses: by topic, child frame or place in an array, and frame that they are given in.
        wrenches: by topic.
        joints: by topic; those without efforts are left out.
        descriptions: text of a URDF by topic.
        fixed: (position, quaternion) of a frame in its parent, which never changes, by (parent, child).
    """

    types: dict[str, str] = field(default_factory=dict)
    poses: dict[tuple[str, str, str], PoseCandidate] = field(default_factory=dict)
    wrenches: dict[str, WrenchCandidate] = field(default_factory=dict)
    joints: dict[str, JointCandidate] = field(default_factory=dict)
    descriptions: dict[str, str] = field(default_factory=dict)
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
            if kind in (*POSES, TRANSFORMS, ARRAY, WRENCH, JOINTS, TEXT):
                decoded = decode(message)
                try:
                    _take(found, message.topic, kind, decoded, message.log_time * 1e-9)
                except (AttributeError, TypeError, ValueError, ArithmeticError) as error:
                    raise BagError(
                        f"{path}: {message.topic}: expected a {message.type}, got one with other fields: {error}"
                    ) from error
    _put_clocks_right(found)
    return found


def _put_clocks_right(found: Candidates) -> None:
    """Shift the times of what was stamped by another clock than the wrenches."""
    streams: dict[str, PoseCandidate | WrenchCandidate | JointCandidate] = {}
    streams.update({f"wrench {topic}": each for topic, each in found.wrenches.items()})
    streams.update({f"joints {topic}": each for topic, each in found.joints.items()})
    streams.update({f"pose {key}": each for key, each in found.poses.items()})
    seen = {name for name, each in streams.items() if isinstance(each, PoseCandidate)}
    for name, offset in clock_offsets({name: each.lags for name, each in streams.items()}, seen).items():
        stream = streams[name]
        stream.clock_offset = offset
        if not isinstance(stream, JointCandidate):
            stream.rows = [(row[0] + offset, *row[1:]) for row in stream.rows]


def _take(found: Candidates, topic: str, kind: str, message: Any, heard: float) -> None:
    if kind == WRENCH:
        felt = wrench_in(topic, message)
        stream = found.wrenches.setdefault(topic, WrenchCandidate(topic, felt.frame))
        stream.rows.append((felt.time, *felt.force, *felt.torque))
        stream.lags.append(heard - felt.time)
        return
    if kind == JOINTS:
        if len(message.effort):
            joints = found.joints.setdefault(topic, JointCandidate(topic))
            joints.messages.append(message)
            joints.lags.append(heard - seconds(message.header.stamp))
        return
    if kind == TEXT:
        if "<robot" in str(message.data):
            found.descriptions[topic] = str(message.data)
        return
    for child, index, sample in _samples(topic, kind, message):
        if topic == STATIC and child is not None:
            turn = np.array(sample.quaternion)
            if are_turns(turn[None]).all():  # one that is none links nothing
                found.fixed[sample.frame, child] = (np.array(sample.position), turn)
            continue
        key = (topic, child or ("" if index is None else str(index)), sample.frame)
        one = found.poses.setdefault(key, PoseCandidate(topic, kind, sample.frame, child, index))
        one.rows.append((sample.time, *sample.position, *sample.quaternion))
        one.lags.append(heard - sample.time)


def _samples(topic: str, kind: str, message: Any) -> Iterator[tuple[str | None, int | None, PoseSample]]:
    """Yield the frames, places in an array, and poses of a message; the first two where a mapping has to name them."""
    if kind == ARRAY:
        for index in range(len(message.poses)):
            yield from ((None, index, sample) for sample in poses_in(topic, message, None, index))
        return
    if kind != TRANSFORMS:
        yield from ((None, None, sample) for sample in poses_in(topic, message, None))
        return
    for transform in message.transforms:
        child = str(transform.child_frame_id).lstrip("/")
        yield from ((child, None, sample) for sample in poses_in(topic, message, child))
