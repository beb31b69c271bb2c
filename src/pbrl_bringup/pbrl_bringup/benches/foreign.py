"""A push as five other laboratories would have recorded it: roles are proposed, and it is fitted like the native.

A sixth has no wrist sensor: the efforts of its arm stand in for one, and its fit agrees as far as it claims to know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from bullet_sim.scene import load_scene
from pbrl_bag import Recording, read_recording
from pbrl_bag.decoding import nanoseconds
from pbrl_bag.encoding import Encoder
from pbrl_bag.foreign_bag import known_types
from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import files_of_bag
from pbrl_bag.proposing import mapping_text, propose
from pbrl_bag.reader import Decoder
from pbrl_bag.types import BodyGeometry
from pbrl_bringup.benches.foreign_efforts import by_efforts
from pbrl_bringup.benches.foreign_labs import LABS, WRENCH, Lab, Message, fixed_frame, hand_seen, stamp, table_seen
from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.simulate import simulate_push
from pbrl_bringup.terminal import progress
from pbrl_control.push_plan import load_plan
from pbrl_model.fitting.fit import FitOptions, fit_recording
from pbrl_model.posterior import Posterior

Storage = Literal["mcap", "sqlite", "ros1"]
SCENE, PLAN = "locked_caster", "turn_table"
ANGLES = ("wheel_theta",)
"""Parameters that go round, and that a locked wheel leaves open."""
STORAGES: dict[str, Storage] = {
    "other topics": "mcap",
    "transforms": "sqlite",
    "odometry": "ros1",
    "other frames": "sqlite",
    "two clocks": "mcap",
}
"""How each laboratory keeps its bags, all written by another library than ours."""
RIGHT, APART = 4, 0.5
"""Bags whose roles are to be proposed rightly; how far a mean may be from the native one, in its deviations."""
WITHOUT_SENSOR = "transforms"
"""Whose push is told by an arm's efforts as well."""
AGREES = 2.0
"""Deviations of its own, wider posterior that a fit by efforts may be off the native one."""
CLOSE, AT_ONCE = 0.005, 0.1
"""Poses [m] and times [s] that agree; what a picture takes on its way cannot be told from a clock that is late."""


@dataclass(frozen=True)
class Retold:
    """What became of one bag.

    Attributes:
        lab: whose.
        storage: of the bag.
        right: whether table, hand and wrench are what they were in the native recording.
        begins, ends: what the grasp that was found begins and ends later than the native one, by the poses' clock [s].
        apart: how far each mean is from that of the native recording over the same seconds, in its standard deviations,
            by parameter.
        as_told: the same from the native recording over the seconds that its own topic tells.
    """

    lab: str
    storage: str
    right: bool
    begins: float
    ends: float
    apart: dict[str, float]
    as_told: dict[str, float]


@dataclass(frozen=True)
class ByEfforts:
    """What became of the bag without a wrist sensor.

    Attributes:
        right: whether the arm's joints, its hand and the description were proposed.
        off: root mean square by which the force at the hand is off while it holds [N].
        told: what the mapping's reader says of that, one standard deviation [N].
        apart: how far each mean is from the native one over the same seconds, in standard deviations of its own.
        wider: its standard deviation over the native one's, by parameter.
        notes: what the reader says.
    """

    right: bool
    off: float
    told: float
    apart: dict[str, float]
    wider: dict[str, float]
    notes: tuple[str, ...]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Record a push, retell it five ways, map and fit each."""
    bag = simulate_push(load_scene(SCENE), load_plan(PLAN), seed, out / "native").bag
    native = read_recording(bag)
    body = native.grasps[0].object
    own = fit_recording(native, FitOptions(seed=seed)).objects[body].posterior
    chosen = list(STORAGES)[: 1 if quick else None]
    found = []
    with progress("bags of other laboratories", total=len(chosen)) as bar:
        for number, name in enumerate(chosen):
            messages = retold(bag, native, LABS[name])
            path = write(out / name.replace(" ", "_"), STORAGES[name], messages)
            found.append(judged(name, path, native, own, seed))
            bar(number + 1)
    efforts = judged_by_efforts(bag, native, out, seed)
    worst = max(max(each.apart.values(), default=np.inf) for each in found)
    as_told = max(max(each.as_told.values(), default=np.inf) for each in found)
    agree = sum(max(each.apart.values(), default=np.inf) <= APART for each in found)
    proposed = sum(each.right for each in found)
    rows = [
        at_least(f"bags whose roles are proposed rightly, of {len(found)}", proposed, "1", 1 if quick else RIGHT),
        at_least(
            f"bags whose fit is the native one's over the same seconds, means within {APART:g} deviations",
            agree,
            f"of {len(found)}",
            len(found),
            furthest=worst,
            furthest_over_the_seconds_that_the_native_topic_tells=as_told,
        ),
    ]
    rows += [
        at_least("bag with joint efforts and no wrench: arm, hand and description proposed", efforts.right, "1", 1),
        at_most(
            "its fit beside the native one's, furthest mean in its own, wider deviations",
            max(efforts.apart.values(), default=np.inf),
            "1",
            AGREES,
            force_off_newtons=efforts.off,
            wider_at_most=max(efforts.wider.values(), default=np.inf),
        ),
    ]
    details = {"bags": [asdict(each) for each in found], "efforts": asdict(efforts), "native": own.summary()}
    return Measured(rows, details)


def retold(bag: Path, native: Recording, lab: Lab) -> list[Message]:
    """Return what a laboratory would have recorded of the first grasp's object, hand and wrench, in order."""
    grasp = native.grasps[0]
    messages = fixed_frame(lab)
    for file in map(McapFile, files_of_bag(bag)):
        decoder = Decoder(file)
        for raw in file.messages():
            told = {
                f"/ar_tags/{grasp.object}/pose": table_seen,
                f"/ar_tags/{grasp.gripper}_gripper/pose": hand_seen,
            }.get(raw.topic)
            if told is not None:
                message = decoder.decode(raw)
                at, turn = message.pose.position, message.pose.orientation
                place, quaternion = np.array([at.x, at.y, at.z]), np.array([turn.x, turn.y, turn.z, turn.w])
                messages.append(told(lab, place, quaternion, nanoseconds(message.header.stamp), raw.log_time))
            elif raw.topic == f"/wrist_ft/{grasp.gripper}":
                message = decoder.decode(raw)
                felt = WrenchStamped()
                felt.header.stamp, felt.header.frame_id = stamp(nanoseconds(message.header.stamp)), lab.sensor
                for kind in ("force", "torque"):
                    for axis in "xyz":
                        setattr(getattr(felt.wrench, kind), axis, getattr(getattr(message.wrench, kind), axis))
                messages.append((lab.wrench, WRENCH, felt, raw.log_time))
    first = min(message[3] for message in messages if message[3])
    return sorted(((*message[:3], max(message[3], first)) for message in messages), key=lambda message: message[3])


def write(place: Path, storage: Storage, messages: Sequence[Message]) -> Path:
    """Write messages with another library than ours, and return the bag."""
    encoder, ours = Encoder(), known_types()
    connections: dict[str, Any] = {}
    if storage == "ros1":
        store, path = get_typestore(Stores.ROS1_NOETIC), place.with_suffix(".bag")
        with Ros1Writer(path) as old:
            for topic, kind, message, when in messages:
                if topic not in connections:
                    connections[topic] = old.add_connection(topic, kind, typestore=store)
                old.write(connections[topic], when, ours.cdr_to_ros1(encoder.encode(kind, message), kind))
        return path
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite" else StoragePlugin.MCAP
    with Ros2Writer(place, version=9, storage_plugin=plugin) as new:
        for topic, kind, message, when in messages:
            if topic not in connections:
                connections[topic] = new.add_connection(topic, kind, typestore=ours)
            new.write(connections[topic], when, encoder.encode(kind, message))
    return place


def judged(lab: str, path: Path, native: Recording, own: Posterior, seed: int) -> Retold:
    """Map a bag as its user would, told the table's size and mass, fit it, and compare."""
    proposal = propose(path)
    bodies = list(proposal.mapping.object_poses) if proposal.mapping is not None else []
    if len(bodies) != 1:
        return Retold(lab, STORAGES[lab], False, np.nan, np.nan, {}, {})
    geometry = native.bodies[own.object]
    mapping = path.with_name(f"{path.stem}.yaml")
    mapping.write_text(completed(mapping_text(proposal, str(path), {bodies[0]: sides(geometry)}), geometry))
    recording = read_recording(path, mapping)
    right = same(recording, bodies[0], native)
    if not (right and recording.grasps):
        return Retold(lab, STORAGES[lab], right, np.nan, np.nan, {}, {})
    grasp, told = recording.grasps[0], native.grasps[0]
    options = FitOptions(seed=seed)
    learned = fit_recording(recording, options).objects[bodies[0]].posterior
    # A grasp is found in the poses: where their clock is put right to some 0.04 s only, it is as late as they.
    late = float(np.median(recording.object_poses[bodies[0]].time - native.object_poses[own.object].time))
    seconds = replace(told, start=grasp.start - late, end=grasp.end - late)
    there = fit_recording(replace(native, grasps=(seconds,)), options).objects[own.object].posterior
    begins, ends = seconds.start - told.start, seconds.end - told.end
    return Retold(lab, STORAGES[lab], right, begins, ends, apart(learned, there), apart(learned, own))


def judged_by_efforts(bag: Path, native: Recording, out: Path, seed: int) -> ByEfforts:
    """Tell the push by the efforts of the arm that made it, with no sensor at its wrist, map and fit it."""
    lab, told = LABS[WITHOUT_SENSOR], native.grasps[0]
    messages = by_efforts(bag, retold(bag, native, lab), lab.wrench, told.gripper, seed)
    path = write(out / "efforts", "sqlite", messages)
    proposal = propose(path)
    source = proposal.mapping.joint_efforts.get("left") if proposal.mapping is not None else None
    if proposal.mapping is None or source is None:
        return ByEfforts(False, np.nan, np.nan, {}, {}, ())
    right = source.tip == f"{told.gripper}_ft" and {f"LJ{k}" for k in range(1, 8)} <= set(source.joints)
    body, geometry = next(iter(proposal.mapping.object_poses)), native.bodies[told.object]
    mapping = out / "efforts.yaml"
    mapping.write_text(completed(mapping_text(proposal, str(path), {body: sides(geometry)}), geometry))
    recording = read_recording(path, mapping)
    felt, truth, grasp = recording.wrenches["left"], native.wrenches[told.gripper], recording.grasps[0]
    held = (felt.time > grasp.start) & (felt.time < grasp.end)
    there = np.column_stack([np.interp(felt.time[held], truth.time, column) for column in truth.force.T])
    off = felt.force[held] - there
    assert felt.covariance is not None, "efforts say how far off they are"
    seconds = replace(told, start=grasp.start, end=grasp.end)
    own = fit_recording(replace(native, grasps=(seconds,)), FitOptions(seed=seed)).objects[told.object].posterior
    learned = fit_recording(recording, FitOptions(seed=seed)).objects[body].posterior
    wider = {
        name: float(each["sd"]) / float(own.summary()[name]["sd"])
        for name, each in learned.summary().items()
        if name not in ANGLES
    }
    return ByEfforts(
        right,
        float(np.sqrt(np.mean(np.sum((off - off.mean(axis=0)) ** 2, axis=1) / 3.0))),
        float(np.sqrt(np.trace(felt.covariance[:3, :3]) / 3.0)),
        apart(own, learned),
        wider,
        recording.notes,
    )


def apart(one: Posterior, other: Posterior) -> dict[str, float]:
    """Return how far the means of a posterior are from those of another, in the other's deviations, by parameter."""
    means, those = one.summary(), other.summary()
    return {
        name: abs(float(means[name]["mean"]) - float(each["mean"])) / float(each["sd"])
        for name, each in those.items()
        if name not in ANGLES
    }


def sides(geometry: BodyGeometry) -> tuple[float, float]:
    """Return length and width of a body [m]."""
    length, width = np.ptp(geometry.footprint, axis=0)
    return float(length), float(width)


def completed(text: str, geometry: BodyGeometry) -> str:
    """Return a proposed mapping with what its user knows of the body beside its sides."""
    text = text.replace("height: 0.7 #", f"height: {geometry.height} #")
    return text.replace("# nominal_mass: 20.0 #", f"nominal_mass: {geometry.nominal_mass} #")


def same(recording: Recording, body: str, native: Recording) -> bool:
    """Tell whether table, hand and wrench are where and when they were, whatever they are called."""
    grasp = native.grasps[0]
    pairs = [(recording.object_poses[body], native.object_poses[grasp.object])]
    pairs += [(each, native.gripper_poses[grasp.gripper]) for each in recording.gripper_poses.values()]
    poses = all(
        one.position.shape == other.position.shape
        and np.abs(one.position - other.position).max() < CLOSE
        and np.abs(one.time - other.time).max() < AT_ONCE
        for one, other in pairs
    )
    force = native.wrenches[grasp.gripper].force
    wrenches = [each.force for each in recording.wrenches.values()]
    return poses and len(pairs) == 2 and len(wrenches) == 1 and np.array_equal(wrenches[0], force)
