"""Builds a Recording from messages as they come: from a bag, or live on a running graph."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pbrl_bag.batches import Batch
from pbrl_bag.clocks import clock_notes
from pbrl_bag.decoding import poses_in, wrench_in
from pbrl_bag.errors import BagError
from pbrl_bag.geometry import bodies_of_mapping, bodies_of_scene, corners
from pbrl_bag.grasps import GraspChange, change_in, grasps_from_changes, grasps_from_mapping
from pbrl_bag.joint_efforts import JointSamples, wrench_from_efforts
from pbrl_bag.mapping import EffortSource, FramePose, Mapping, PoseSource, WrenchSource
from pbrl_bag.roles import CONTRACT, Kind, Role, roles_of, topic_of
from pbrl_bag.samples import Samples
from pbrl_bag.streams import Limits, check_turns, pose_stream, read_only, wrench_stream
from pbrl_bag.types import Array, BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bag.validation import nearest

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
NEWTONS = {"N": 1.0, "lbf": 4.4482216152605, "kgf": 9.80665}
NEWTON_METRES = {"N m": 1.0, "lbf in": 0.1129848290276167}


class RecordingBuilder:
    """Collects messages by topic and makes a checked Recording of them.

    Args:
        mapping: which topic plays which role; the contract's own topics if left out.
    """

    def __init__(self, mapping: Mapping | None = None):
        self.mapping = mapping or CONTRACT
        self.notes: list[str] = []
        self._topics: dict[str, tuple[Role, ...]] = {}
        self._samples: dict[tuple[Kind, str], Samples] = {}
        self._joints: dict[str, JointSamples] = {}
        self._descriptions: dict[str, str] = {}
        self._changes: list[GraspChange] = []
        self._scene: tuple[dict[str, BodyGeometry], Array] | None = None

    def wants(self, topic: str) -> bool:
        """Tell whether a topic plays a role, so that its messages are worth decoding."""
        if topic not in self._topics:
            self._topics[topic] = roles_of(topic, self.mapping)
        return bool(self._topics[topic])

    def add(self, topic: str, stamp_message: Any, heard: float | None = None) -> None:
        """Take one message; topics without a role are ignored.

        Args:
            topic: where it was heard.
            stamp_message: the decoded message, a real instance or any object with the same attributes.
            heard: when it was heard [s], on one clock for all topics, if known; clocks are compared by it.

        Raises:
            BagError: its type or frame does not fit the topic's role.
        """
        if not self.wants(topic):
            return
        try:
            self._take(topic, stamp_message, heard)
        except (AttributeError, TypeError, ValueError, ArithmeticError) as error:
            raise BagError(
                f"{topic}: expected a message with the fields of its type, got another {type(stamp_message).__name__}: "
                f"{error}; give another topic in a mapping"
            ) from error

    def _take(self, topic: str, stamp_message: Any, heard: float | None) -> None:
        """Give a message to every role of its topic."""
        for role in self._topics[topic]:
            if role.kind == "grasps":
                self._changes.append(change_in(topic, stamp_message))
            elif role.kind == "scene":
                self._add_scene(topic, stamp_message)
            elif role.kind == "description":
                self._descriptions[topic] = str(getattr(stamp_message, "data", ""))
            elif isinstance(role.source, EffortSource):
                self._joints.setdefault(role.name, JointSamples(topic, role.source)).add(stamp_message, heard)
            elif isinstance(role.source, WrenchSource):
                self._add_wrench(topic, role, role.source, stamp_message, heard)
            elif isinstance(role.source, PoseSource):
                self._add_pose(topic, role, role.source, stamp_message, heard)

    def takes(self, topic: str, batch: Batch) -> bool:
        """Tell whether a batch of a topic is what every role of the topic is filled with."""
        expected = PoseSource if batch.kind == "pose" else WrenchSource
        return self.wants(topic) and all(isinstance(role.source, expected) for role in self._topics[topic])

    def add_batch(self, topic: str, batch: Batch, heard: Array | None = None) -> None:
        """Take many messages that `takes` says yes to, heard at times (n,) [s]; the same as `add` one by one.

        Raises:
            BagError: their frame does not fit the topic's role.
        """
        first = float(batch.time[0])
        for role in self._topics[topic]:
            values = batch.values.copy()
            if isinstance(role.source, WrenchSource):
                self._check_wrench_frame(topic, role, first, batch.frame)
                if role.source.ignore_torque:
                    values[:, 3:] = np.nan
                samples = self.samples("wrenches", role.name, topic, role.source)
            elif isinstance(role.source, PoseSource):
                self._check_pose_frame(topic, role.source, first, batch.frame)
                if role.source.ignore_orientation:
                    values[:, 3:] = np.nan
                samples = self.samples(role.kind, role.name, topic, role.source)
            samples.extend(np.column_stack([batch.time, values]), heard)

    def samples(self, kind: Kind, name: str, label: str, source: PoseSource | WrenchSource) -> Samples:
        """Return the samples of a role, to be added to; empty at first."""
        return self._samples.setdefault((kind, name), Samples(label, source))

    def build(self, path: Path | str = "", *, complete: bool = True, since: float = -np.inf) -> Recording:
        """Check what was collected and return it as a Recording.

        Args:
            path: where it came from, for errors and for `Recording.path`.
            complete: whether everything has to be there that is needed to learn from it. Otherwise what is missing
                is told in `Recording.notes`, and one stream or one body is enough.
            since: what was let go of before that need not be complete [s].

        Raises:
            BagError: a topic is missing, a stream is malformed; the message names topic, time and field.
        """
        path = Path(path)
        seen = {samples.label for (kind, _), samples in self._samples.items() if kind != "wrenches"}
        notes = self.notes + clock_notes(self._lags(), seen)
        objects = self._poses("object_poses", notes)
        grippers = self._poses("gripper_poses", notes)
        wrenches = self._wrenches(notes)
        streams: list[PoseStream | WrenchStream] = [*objects.values(), *grippers.values(), *wrenches.values()]
        times = [stream.time for stream in streams]
        times += [samples.time for samples in self._joints.values() if len(samples)]
        start, end = self._span(path, times, complete=complete)
        bodies, room = self._geometry(path, objects, complete=complete)
        grasps = self._grasps(path, start, end, complete=complete)
        wrenches |= self._efforts(path, grasps, notes)
        if not complete:
            notes += self._left_out(objects, wrenches)
        for name in sorted(set(objects) - set(bodies)):
            notes.append(f"body {name!r} is seen but has no geometry: it cannot be learned about")
        recording = Recording(path, bodies, objects, grippers, wrenches, grasps, room, tuple(notes))
        if complete:
            self._check_complete(recording, since)
        return recording

    def _lags(self) -> dict[str, Array]:
        """Return when messages were heard less their stamps [s], by topic; wrenches, which are most, come first."""
        streams = sorted(self._samples.items(), key=lambda each: (each[0][0] != "wrenches", each[0]))
        both: list[Samples | JointSamples] = [*self._joints.values(), *(samples for _, samples in streams)]
        return {samples.label: np.concatenate([np.empty(0), *samples.lags]) for samples in both}

    def _left_out(self, objects: dict[str, PoseStream], wrenches: dict[str, WrenchStream]) -> list[str]:
        """Say which kinds of what a recording is made of are missing."""
        geometry = bool(self._scene or self.mapping.bodies)
        there = {
            "pose of an object": bool(objects),
            "wrench": bool(wrenches),
            "geometry of a body": geometry,
            "word on who holds what": bool(self._changes or self.mapping.grasps),
        }
        return [f"there is no {what} in it" for what, known in there.items() if not known]

    def _add_scene(self, topic: str, message: Any) -> None:
        if not (hasattr(message, "bodies") and hasattr(message, "room")):
            raise BagError(f"{topic}: expected pbrl_msgs/Scene, got {type(message).__name__}")
        self._scene = (bodies_of_scene(topic, message), corners(message.room))

    def _add_wrench(self, topic: str, role: Role, source: WrenchSource, message: Any, heard: float | None) -> None:
        sample = wrench_in(topic, message)
        self._check_wrench_frame(topic, role, sample.time, sample.frame)
        torque = (np.nan,) * 3 if source.ignore_torque else sample.torque
        self.samples("wrenches", role.name, topic, source).add(sample.time, (*sample.force, *torque), heard)

    def _check_wrench_frame(self, topic: str, role: Role, time: float, frame: str) -> None:
        contract = f"{role.name}_ft"
        if role.name not in self.mapping.wrenches and frame != contract:
            raise BagError(
                f"{topic}: t = {time:.6f} s: header.frame_id: expected {contract!r}, got {frame!r}; "
                "say in a mapping in which axes it is given"
            )

    def _add_pose(self, topic: str, role: Role, source: PoseSource, message: Any, heard: float | None) -> None:
        samples = self.samples(role.kind, role.name, topic, source)
        for sample in poses_in(topic, message, source.child_frame, source.index):
            self._check_pose_frame(topic, source, sample.time, sample.frame)
            turn = (np.nan,) * 4 if source.ignore_orientation else sample.quaternion
            samples.add(sample.time, (*sample.position, *turn), heard)

    def _check_pose_frame(self, topic: str, source: PoseSource, time: float, frame: str) -> None:
        expected = source.frame or self.mapping.world
        if frame != expected:
            raise BagError(
                f"{topic}: t = {time:.6f} s: header.frame_id: expected {expected!r}, got {frame!r}; "
                "say in a mapping where that frame is (`frames`, `frame`)"
            )

    def _poses(self, kind: Kind, notes: list[str]) -> dict[str, PoseStream]:
        """Return the checked pose streams of one kind, in world."""
        limits = Limits(self.mapping.max_speed, self.mapping.max_turn_rate)
        streams = {}
        for (found, name), samples in sorted(self._samples.items()):
            if found == kind and len(samples) and isinstance(samples.source, PoseSource):
                rows = samples.array(8)
                check_turns(samples.label, rows[:, 0], rows[:, 4:8])
                position, quaternion = self._to_world(rows[:, 1:4], rows[:, 4:8], samples)
                streams[name] = pose_stream(samples.label, rows[:, 0], position, quaternion, limits, notes)
        return streams

    def _to_world(self, position: Array, quaternion: Array, samples: Samples) -> tuple[Array, Array]:
        """Turn poses from the units and frame of their source to metres in world, offset included."""
        source = samples.source
        assert isinstance(source, PoseSource)
        position = position * METRES[source.unit]
        frame = self.mapping.frames.get(source.frame or self.mapping.world, FramePose())
        if source.offset != FramePose():
            if np.isnan(quaternion).any() and any(source.offset.position):
                raise BagError(f"{samples.label}: offset: needs the orientation, which is not observed; leave it out")
            position, quaternion = _compose(position, quaternion, source.offset)
        return _place(frame, position, quaternion) if frame != FramePose() else (position, quaternion)

    def _wrenches(self, notes: list[str]) -> dict[str, WrenchStream]:
        """Return the checked wrench streams by gripper, in N and N m, in sensor or world axes."""
        streams = {}
        for (kind, name), samples in sorted(self._samples.items()):
            source = samples.source
            if kind != "wrenches" or not len(samples) or not isinstance(source, WrenchSource):
                continue
            rows = samples.array(7)
            force = rows[:, 1:4] * (source.sign * NEWTONS[source.unit])
            torque = rows[:, 4:7] * (source.sign * NEWTON_METRES[source.torque_unit])
            if source.axes in self.mapping.frames:
                turn = Rotation.from_quat(self.mapping.frames[source.axes].quaternion)
                force, torque = turn.apply(force), turn.apply(torque)
            axes = "sensor" if source.axes == "sensor" else "world"
            streams[name] = wrench_stream(samples.label, rows[:, 0], force, torque, source.exerted_on, axes, notes)
        return streams

    def _efforts(self, path: Path, grasps: Sequence[Grasp], notes: list[str]) -> dict[str, WrenchStream]:
        """Return the wrenches that joint efforts stand in for, by gripper."""
        streams = {}
        for side, samples in sorted(self._joints.items()):
            topic = samples.source.description
            if not len(samples):
                raise BagError(
                    f"{path}: {samples.label}: expected joints {', '.join(samples.source.joints)}, got none of them; "
                    f"it has {_listing(sorted(samples.positions))}"
                )
            if topic is not None and topic not in self._descriptions:
                raise BagError(
                    f"{path}: joint_efforts.{side}: description: expected topic {topic!r}, got no message of it; "
                    "say `urdf: FILE` in its place"
                )
            text = self._descriptions[topic] if topic is not None else samples.source.urdf_text()
            where = topic or str(samples.source.urdf)
            own = [grasp for grasp in grasps if grasp.gripper == side]
            streams[side] = wrench_from_efforts(samples, text, own, notes, where)
        return streams

    def _span(self, path: Path, times: Sequence[Array], *, complete: bool) -> tuple[float, float]:
        """Return times of the first and last sample [s]."""
        if not times and not complete and (self._scene or self.mapping.bodies):
            return (self._changes[0].time, self._changes[-1].time) if self._changes else (0.0, 0.0)
        if not times:
            raise self._missing(path, "object_poses", next(iter(self.mapping.object_poses), "<object>"))
        return (
            min(float(time[0]) for time in times),
            max([float(time[-1]) for time in times] + [change.time for change in self._changes[-1:]]),
        )

    def _geometry(
        self, path: Path, poses: dict[str, PoseStream], *, complete: bool
    ) -> tuple[dict[str, BodyGeometry], Array]:
        """Return bodies and room; what the mapping says goes before what /scene says."""
        bodies, room = self._scene or ({}, read_only(np.empty((0, 2))))
        bodies = bodies | bodies_of_mapping(self.mapping.bodies, poses, str(path))
        if not bodies and complete:
            raise self._missing(path, "scene", "")
        return bodies, read_only(np.array(self.mapping.room)) if self.mapping.room else room

    def _grasps(self, path: Path, start: float, end: float, *, complete: bool) -> tuple[Grasp, ...]:
        """Return who held what, when."""
        topic = topic_of("grasps", "", self.mapping)
        if self.mapping.grasps:
            return grasps_from_mapping(self.mapping.grasps, start, end)
        if not self._changes and complete:
            raise self._missing(path, "grasps", "")
        return grasps_from_changes(topic, self._changes, end)

    def _check_complete(self, recording: Recording, since: float) -> None:
        """Raise a BagError where something that was held after `since` lacks what is needed to learn from it."""
        for grasp in (each for each in recording.grasps if each.end > since):
            if grasp.object not in recording.bodies:
                raise BagError(
                    f"{recording.path}: t = {grasp.start:.6f} s: gripper {grasp.gripper!r} holds {grasp.object!r}, "
                    f"which has no geometry; {nearest(grasp.object, sorted(recording.bodies))}"
                )
            if grasp.object not in recording.object_poses:
                raise self._missing(recording.path, "object_poses", grasp.object)
            if grasp.gripper not in recording.wrenches:
                raise self._missing(recording.path, "wrenches", grasp.gripper)
            in_sensor_axes = recording.wrenches[grasp.gripper].frame == "sensor"
            if in_sensor_axes and grasp.gripper not in recording.gripper_poses:
                raise self._missing(recording.path, "gripper_poses", grasp.gripper)

    def _missing(self, path: Path, kind: Kind, name: str) -> BagError:
        """Return the error that a role is not filled."""
        topic = topic_of(kind, name, self.mapping)
        role = f"{kind}.{name}" if name else kind
        heard = sorted(self._topics)
        there = f"the recording has {_listing(heard)}" if heard else "the recording has no topics"
        expected = f"topic {topic!r} ({role})" if topic else f"a source of {role}"
        return BagError(f"{path}: expected {expected}, got no message of it; {there}; record it or give a mapping")


def _listing(names: list[str], most: int = 8) -> str:
    """Return names as a list that stays on one line."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _compose(position: Array, quaternion: Array, offset: FramePose) -> tuple[Array, Array]:
    """Return poses of a frame that sits at `offset` in the frames given."""
    seen = ~np.isnan(quaternion).any(axis=1)
    position, quaternion = position.copy(), quaternion.copy()
    if seen.any():
        turn = Rotation.from_quat(quaternion[seen])
        position[seen] += turn.apply(np.array(offset.position))
        quaternion[seen] = (turn * Rotation.from_quat(offset.quaternion)).as_quat()
    return position, quaternion


def _place(frame: FramePose, position: Array, quaternion: Array) -> tuple[Array, Array]:
    """Return in world what was given in `frame`."""
    turn = Rotation.from_quat(frame.quaternion)
    seen = ~np.isnan(quaternion).any(axis=1)
    quaternion = quaternion.copy()
    if seen.any():
        quaternion[seen] = (turn * Rotation.from_quat(quaternion[seen])).as_quat()
    return turn.apply(position) + np.array(frame.position), quaternion
