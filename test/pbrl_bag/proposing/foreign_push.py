"""One push as different laboratories would record it: other topics, other frames, motion capture, transforms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped, WrenchStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
ODOMETRY, TRANSFORMS, ARRAY = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseArray"
CONTACT = (-0.6, 0.1)
SECONDS, CLOSED, OPENED = 8.0, 1.0, 7.0
Message = tuple[str, str, Any, int]


@dataclass(frozen=True)
class Lab:
    """How somebody records.

    Attributes:
        table, hand, wrench: topics; a table or hand on /tf is told by its frame after a "#"; a number there is its
            place in an array.
        world: frame of the poses.
        sensor: frame of the wrench.
        moved: pose (x, y, yaw) of the hand's frame of reference in `world`; its name is "robot".
        ahead: what the clock that stamps table and hand is ahead of the sensor's [s].
    """

    table: str
    hand: str
    wrench: str
    world: str = "world"
    sensor: str = "sensor"
    moved: tuple[float, float, float] | None = None
    ahead: float = 0.0


LABS = {
    "other topics": Lab("/vicon/table_7/pose", "/vicon/right_wrist/pose", "/ati/right/wrench", world="vicon"),
    "transforms": Lab("/tf#desk", "/tf#left_gripper_tool", "/ft_sensor/left", world="map", sensor="left_tool0"),
    "odometry": Lab("/cart/odom_pose", "/left_hand/pose", "/left_wrench", world="lab"),
    "other frames": Lab("/tags/crate", "/l_gripper_tcp", "/wrench", world="ceiling", moved=(1.0, -2.0, 0.7)),
    "array": Lab("/tracker/bodies#1", "/tracker/tool_left", "/ft", world="tracker"),
    "two clocks": Lab("/optitrack/bench/pose", "/optitrack/left_hand/pose", "/netft/left", world="opti", ahead=37.25),
    "one hand": Lab("/mocap/sofa/pose", "/mocap/gripper/pose", "/robotiq_ft_wrench", world="mocap"),
}


def stamp(t: float) -> Time:
    return Time(sec=int(t), nanosec=round(t % 1.0 * 1e9))


def pose_at(t: float) -> np.ndarray:
    """Where the table is (3,) at a time: it stands, is pushed round, and stands again."""
    along = np.clip(t - CLOSED - 0.5, 0.0, OPENED - CLOSED - 1.0)
    return np.array([0.5 + 0.12 * along, 0.3 * math.sin(0.4 * along), 0.15 * along])


def hand_at(t: float) -> np.ndarray:
    """Where the hand is (3,): it comes, holds, and goes."""
    x, y, yaw = pose_at(t)
    away = max(CLOSED - t, t - OPENED, 0.0)
    c, s = math.cos(yaw), math.sin(yaw)
    px, py = CONTACT[0] - 0.2 * away, CONTACT[1]
    return np.array([x + c * px - s * py, y + s * px + c * py, yaw])


def in_frame(pose: np.ndarray, frame: tuple[float, float, float]) -> np.ndarray:
    c, s = math.cos(frame[2]), math.sin(frame[2])
    dx, dy = pose[0] - frame[0], pose[1] - frame[1]
    return np.array([c * dx + s * dy, -s * dx + c * dy, pose[2] - frame[2]])


def stamped(t: float, pose: np.ndarray, frame: str) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp(t), frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = float(pose[0]), float(pose[1]), 0.7
    message.pose.orientation.z, message.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    return message


def transform(t: float, pose: np.ndarray, parent: str, child: str) -> TFMessage:
    told = stamped(t, pose, parent)
    one = TransformStamped(header=told.header, child_frame_id=child)
    at, turn = one.transform.translation, one.transform.rotation
    at.x, at.y, at.z = told.pose.position.x, told.pose.position.y, told.pose.position.z
    turn.z, turn.w = told.pose.orientation.z, told.pose.orientation.w
    return TFMessage(transforms=[one])


def _seen(topic: str, t: float, pose: np.ndarray, frame: str, ahead: float = 0.0) -> Message:
    when = round(t * 1e9)
    t += ahead
    name, _, child = topic.partition("#")
    if child.isdigit():
        told = stamped(t, pose, frame)
        others = [stamped(t, np.array([2.0 + i, 1.0, 0.0]), frame).pose for i in range(int(child))]
        return name, ARRAY, PoseArray(header=told.header, poses=[*others, told.pose]), when
    if child:
        return name, TRANSFORMS, transform(t, pose, frame, child), when
    if "odom" in name:
        told = stamped(t, pose, frame)
        message = Odometry(header=told.header)
        message.pose.pose = told.pose
        return name, ODOMETRY, message, when
    return name, POSE, stamped(t, pose, frame), when


def recorded(lab: Lab) -> list[Message]:
    """Return the messages of the push as a laboratory records it, with things around that play no role."""
    messages: list[Message] = []
    frame = lab.world if lab.moved is None else "robot"
    if lab.moved is not None:
        messages.append(("/tf_static", TRANSFORMS, transform(0.0, np.array(lab.moved), lab.world, "robot"), 0))
    for i in range(round(SECONDS * 100)):
        t = i / 100
        felt = WrenchStamped()
        felt.header.stamp, felt.header.frame_id = stamp(t), lab.sensor
        felt.wrench.force.x = 15.0 + math.sin(t) if CLOSED < t < OPENED else 0.0
        felt.wrench.torque.z = 0.3
        messages.append((lab.wrench, WRENCH, felt, round(t * 1e9)))
        if i % 4 == 0:
            messages.append(_seen(lab.table, t, pose_at(t), lab.world, lab.ahead))
            hand = hand_at(t) if lab.moved is None else in_frame(hand_at(t), lab.moved)
            messages.append(_seen(lab.hand, t, hand, frame, lab.ahead))
            messages.append(_seen("/chair/pose", t, np.array([3.0, 1.0, 0.2]), lab.world))
            messages.append(_seen("/tf#base_link", t, np.array([0.3 * t, 0.0, 0.0]), lab.world))
    return sorted(messages, key=lambda message: message[3])
