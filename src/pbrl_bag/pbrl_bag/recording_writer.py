"""Writes a `Recording` as a bag of the contract: what was simulated, cut or cleaned reads like what was recorded.

Only the contract's own form can be written: raw wrist wrenches in the sensor's axes, poses with their orientation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.roles import CONTRACT, GRASPS_TOPIC, SCENE_TOPIC, Kind, topic_of
from pbrl_bag.types import Array, BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bag.writer import BagWriter

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
SCENE, GRASPS = "pbrl_msgs/msg/Scene", "pbrl_msgs/msg/Grasps"
NANO = 1_000_000_000

Message = tuple[int, str, str, Any]
"""When it was heard [ns], topic, type, message."""


def write_recording(recording: Recording, folder: Path | str) -> Path:
    """Write a recording; the same recording makes the same bytes, and `read_recording` gives it back.

    Times are kept to the nanosecond. A grasp that lasts to the end of the recording stays closed in the bag.

    Args:
        recording: what to write.
        folder: has not to exist yet.

    Returns:
        The folder.

    Raises:
        BagError: the folder exists, a wrench is not raw in sensor axes or not a sensor's, or a number is missing.
    """
    _check(recording)
    messages = sorted(_messages(recording), key=lambda one: one[0])
    with BagWriter(folder, live=False) as bag:
        for time, topic, type_name, message in messages:
            bag.write(topic, type_name, message, time)
    return Path(folder)


def _check(recording: Recording) -> None:
    """Raise a BagError for what the contract's messages cannot hold."""
    where = recording.path
    for side, felt in recording.wrenches.items():
        if felt.exerted_on != "gripper" or felt.frame != "sensor":
            raise BagError(
                f"{where}: {side}: expected a raw wrench in the sensor's axes, got one exerted on the "
                f"{felt.exerted_on} in {felt.frame} axes; a bag of the contract cannot hold it"
            )
        if felt.covariance is not None:
            raise BagError(
                f"{where}: {side}: expected the wrench of a sensor, got one with the covariance of an error that "
                "stays; a bag of the contract cannot hold it"
            )
    streams: list[tuple[str, list[Array]]] = []
    for name, pose in (*recording.object_poses.items(), *recording.gripper_poses.items()):
        streams.append((name, [pose.time, pose.position, pose.quaternion]))
    for side, felt in recording.wrenches.items():
        streams.append((side, [felt.time, felt.force, felt.torque]))
    for name, columns in streams:
        if not all(np.isfinite(column).all() for column in columns):
            raise BagError(f"{where}: {name}: expected finite numbers throughout, got NaN; a bag cannot hold it")
    if not streams:
        raise BagError(f"{where}: expected at least one stream to write, got none")


def _messages(recording: Recording) -> Iterator[Message]:
    """Yield every message of a recording, topic by topic."""
    times = [stream.time for group in _streams(recording) for stream in group.values() if len(stream.time)]
    begin, end = min(float(time[0]) for time in times), max(float(time[-1]) for time in times)
    kinds: tuple[Kind, Kind] = ("object_poses", "gripper_poses")
    yield _nanoseconds(begin), SCENE_TOPIC, SCENE, _scene(recording, begin)
    for time, held in _changes(recording.grasps, begin, end):
        yield _nanoseconds(time), GRASPS_TOPIC, GRASPS, SimpleNamespace(header=_header(time, ""), grasps=held)
    for kind, poses in zip(kinds, (recording.object_poses, recording.gripper_poses), strict=True):
        for name, stream in poses.items():
            yield from _poses(topic_of(kind, name, CONTRACT), stream)
    for side, felt in recording.wrenches.items():
        yield from _wrenches(topic_of("wrenches", side, CONTRACT), f"{side}_ft", felt)


def _streams(recording: Recording) -> tuple[dict[str, PoseStream | WrenchStream], ...]:
    return dict(recording.object_poses), dict(recording.gripper_poses), dict(recording.wrenches)


def _changes(grasps: tuple[Grasp, ...], begin: float, end: float) -> Iterator[tuple[float, list[Any]]]:
    """Yield (time, what is held from then on); the first at the recording's beginning."""
    edges = {begin} | {grasp.start for grasp in grasps} | {grasp.end for grasp in grasps if grasp.end < end}
    for time in sorted(edges):
        yield (
            time,
            [
                SimpleNamespace(gripper=grasp.gripper, object=grasp.object, contact_point=_point(*grasp.contact))
                for grasp in grasps
                if grasp.start <= time and (time < grasp.end or grasp.end >= end)
            ],
        )


def _scene(recording: Recording, time: float) -> SimpleNamespace:
    bodies = [_body(body) for body in recording.bodies.values()]
    return SimpleNamespace(header=_header(time, "world"), bodies=bodies, room=[_point(*p) for p in recording.room])


def _body(body: BodyGeometry) -> SimpleNamespace:
    x, y, theta = body.pose.tolist()
    return SimpleNamespace(
        name=body.name,
        footprint=[_point(*corner) for corner in body.footprint],
        height=body.height,
        nominal_mass=body.nominal_mass,
        movable=body.movable,
        pose=SimpleNamespace(x=x, y=y, theta=theta),
        casters=[_point(*caster) for caster in body.casters],
    )


def _poses(topic: str, stream: PoseStream) -> Iterator[Message]:
    for time, place, turn in zip(stream.time.tolist(), stream.position, stream.quaternion, strict=True):
        x, y, z, w = turn.tolist()
        pose = SimpleNamespace(position=_point(*place), orientation=SimpleNamespace(x=x, y=y, z=z, w=w))
        yield _nanoseconds(time), topic, POSE, SimpleNamespace(header=_header(time, "world"), pose=pose)


def _wrenches(topic: str, frame: str, stream: WrenchStream) -> Iterator[Message]:
    for time, force, torque in zip(stream.time.tolist(), stream.force, stream.torque, strict=True):
        wrench = SimpleNamespace(force=_point(*force), torque=_point(*torque))
        yield _nanoseconds(time), topic, WRENCH, SimpleNamespace(header=_header(time, frame), wrench=wrench)


def _point(x: float, y: float, z: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(x=float(x), y=float(y), z=float(z))


def _header(time: float, frame: str) -> SimpleNamespace:
    seconds, rest = divmod(_nanoseconds(time), NANO)
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=rest), frame_id=frame)


def _nanoseconds(time: float) -> int:
    return round(time * NANO)
