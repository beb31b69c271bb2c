"""A small recording, as messages and as bags of every storage: what hostile bags are made from."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose2D, PoseStamped, WrenchStamped
from mcap.writer import CompressionType, Writer
from nav_msgs.msg import Path as PathMsg
from pbrl_msgs.msg import Body, Grasp, Grasps, Mismatch, MismatchEffect, Mismatches, ObjectModel, ObjectModels, Scene
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_bag import BagWriter
from pbrl_bag.encoding import Encoder
from pbrl_bag.schema import message_definition
from pbrl_bringup.benches.foreign_labs import Message

SIDES = ((-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4))
POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"


def stamp_at(seconds: float) -> Time:
    """Return seconds as a stamp."""
    return Time(sec=int(seconds), nanosec=round(seconds % 1.0 * 1e9))


def push(seconds: float = 1.6, rate: float = 25.0) -> list[Message]:
    """Return a table held by the left gripper, drifting and turning, with what is known of it and drawn beside it."""
    messages: list[Message] = [
        ("/scene", "pbrl_msgs/msg/Scene", _scene(), 0),
        ("/grasps", "pbrl_msgs/msg/Grasps", _grasps(0.0), 0),
        ("/grasps", "pbrl_msgs/msg/Grasps", _grasps(0.3, "left"), 300_000_000),
        ("/grasps", "pbrl_msgs/msg/Grasps", _grasps(1.3), 1_300_000_000),
        ("/object_models", "pbrl_msgs/msg/ObjectModels", models(), 400_000_000),
        ("/mismatches", "pbrl_msgs/msg/Mismatches", mismatches(), 500_000_000),
        ("/plan", "nav_msgs/msg/Path", _plan(), 600_000_000),
        ("/markers", "visualization_msgs/msg/MarkerArray", _markers(), 600_000_000),
    ]
    for k in range(round(seconds * rate)):
        t = k / rate
        messages.append(("/wrist_ft/left", WRENCH, _wrench(t), round(t * 1e9)))
        if k % 2 == 0:
            messages.append(("/ar_tags/table/pose", POSE, _pose(t, 0.1 * t, 0.2 * t), round(t * 1e9)))
            messages.append(("/ar_tags/left_gripper/pose", POSE, _pose(t, 0.1 * t - 0.5, 0.0), round(t * 1e9)))
    return sorted(messages, key=lambda message: message[3])


def ours(folder: Path, messages: Sequence[Message]) -> Path:
    """Write a bag as the recorder does and return its folder."""
    with BagWriter(folder, live=False) as writer:
        for topic, kind, message, when in messages:
            writer.write(topic, kind, message, when)
    return folder


def plain_mcap(messages: Sequence[tuple[str, str, bytes, int]]) -> bytes:
    """Return an MCAP of encoded messages with nothing packed and no checksum, so that what is changed is read."""
    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.NONE, use_chunking=False, enable_crcs=False)
    writer.start(profile="ros2")
    channels: dict[str, int] = {}
    for topic, kind, data, when in messages:
        if topic not in channels:
            schema = writer.register_schema(kind, "ros2msg", message_definition(kind).encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        writer.add_message(channels[topic], when, data, when)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def encoded(messages: Sequence[Message]) -> list[tuple[str, str, bytes, int]]:
    """Return messages with their bytes."""
    encoder = Encoder()
    return [(topic, kind, encoder.encode(kind, message), when) for topic, kind, message, when in messages]


def _scene() -> Scene:
    table = Body(name="table", height=0.7, nominal_mass=20.0, movable=True, pose=Pose2D(x=1.0, y=0.0, theta=0.1))
    table.footprint = [Point(x=x, y=y) for x, y in SIDES]
    message = Scene(bodies=[table], room=[Point(x=x, y=y) for x, y in ((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0))])
    message.header.frame_id = "world"
    return message


def _grasps(t: float, *sides: str) -> Grasps:
    message = Grasps(grasps=[Grasp(gripper=side, object="table", contact_point=Point(x=-0.5)) for side in sides])
    message.header.stamp = stamp_at(t)
    return message


def _pose(t: float, x: float, yaw: float) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp_at(t), "world"
    message.pose.position.x, message.pose.position.z = x, 0.7
    message.pose.orientation.z, message.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


def _wrench(t: float) -> WrenchStamped:
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp_at(t), "left_ft"
    message.wrench.force.x, message.wrench.torque.z = 10.0 + t, 0.25
    return message


def models() -> ObjectModels:
    """Return what may have been learned of the table."""
    names, units = ["mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y"], ["kg", "m", "m", "rad", "1", "1"]
    values = [20.0, -0.4, 0.3, 0.1, 0.05, 0.1]
    model = ObjectModel(object="table", model_class="wheel", parameters=names, units=units, mean=values)
    model.sd, model.draws, model.samples = [0.1] * 6, 4, values * 4
    model.log_evidence, model.heldout_rmse = 12.0, 0.01
    message = ObjectModels(models=[model])
    message.header.frame_id = "world"
    return message


def mismatches() -> Mismatches:
    """Return what may have been found to be left out of it."""
    effect = MismatchEffect(
        effect="tether", probability=0.9, parameters=["tether_x"], units=["m"], mean=[1.0], sd=[0.1]
    )
    effect.where_frame, effect.where, effect.when = "world", [Point(x=1.0)], [0.2, 0.9]
    found = Mismatch(object="table", model_class="wheel", p_value=0.01, size=3.0, diagnosed=True, effects=[effect])
    found.report = '{"mismatch": true, "unknown": false, "effects": [], "alternatives": []}'
    return Mismatches(mismatches=[found])


def _plan() -> PathMsg:
    message = PathMsg(poses=[_pose(0.0, x, 0.0) for x in (0.0, 1.0, 2.0)])
    message.header.frame_id = "world"
    return message


def _markers() -> MarkerArray:
    marker = Marker(ns="plan", id=1, type=Marker.LINE_STRIP, points=[Point(x=x) for x in (0.0, 1.0)])
    marker.header.frame_id, marker.pose.orientation.w = "world", 1.0
    return MarkerArray(markers=[marker])
