"""How different laboratories record a push: other topics, other frames, motion capture, transforms, another clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tf2_msgs.msg import TFMessage

Array = NDArray[np.float64]
Message = tuple[str, str, Any, int]
"""Topic, type, message, and when it was heard [ns]."""
POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
ODOMETRY, TRANSFORMS, ARRAY = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseArray"
ROBOT = "robot"
"""Frame of a hand that is told in the robot's own."""


@dataclass(frozen=True)
class Lab:
    """How somebody records.

    Attributes:
        table, hand, wrench: topics. A table or hand on /tf is told by its frame after a "#"; a number there is its
            place in an array. What is called odometry is one.
        world: frame of the poses.
        sensor: frame of the wrench.
        moved: pose (x, y, yaw) [m, rad] of the hand's frame of reference in `world`; its name is `ROBOT`.
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


def stamp(when: int) -> Time:
    """Return nanoseconds as a stamp."""
    return Time(sec=when // 1_000_000_000, nanosec=when % 1_000_000_000)


def fixed_frame(lab: Lab) -> list[Message]:
    """Return what tells where the hand's frame of reference is, where it is another than the table's."""
    if lab.moved is None:
        return []
    x, y, yaw = lab.moved
    turn = np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])
    return [("/tf_static", TRANSFORMS, _transform(_stamped(0, np.array([x, y, 0.0]), turn, lab.world), ROBOT), 0)]


def table_seen(lab: Lab, position: Array, quaternion: Array, when: int, heard: int | None = None) -> Message:
    """Return how a laboratory tells where the table was at a time [ns].

    Args:
        lab: whose.
        position: (3,) [m].
        quaternion: (4,) x y z w.
        when: on the clock of the sensor.
        heard: on the same; None: at once.
    """
    told = _stamped(when + round(lab.ahead * 1e9), position, quaternion, lab.world)
    return seen(lab.table, told, when if heard is None else heard)


def hand_seen(lab: Lab, position: Array, quaternion: Array, when: int, heard: int | None = None) -> Message:
    """Return how a laboratory tells where the hand was at a time; as `table_seen`."""
    frame = lab.world
    if lab.moved is not None:
        x, y, yaw = lab.moved
        back = Rotation.from_euler("z", -yaw)
        position = back.apply(position - [x, y, 0.0])
        quaternion, frame = (back * Rotation.from_quat(quaternion)).as_quat(), ROBOT
    told = _stamped(when + round(lab.ahead * 1e9), position, quaternion, frame)
    return seen(lab.hand, told, when if heard is None else heard)


def seen(topic: str, told: PoseStamped, heard: int) -> Message:
    """Return a pose as a topic's name says that it is told; see `Lab`."""
    name, _, child = topic.partition("#")
    if child.isdigit():
        others = [
            _stamped(0, np.array([2.0 + i, 1.0, 0.0]), np.array([0, 0, 0, 1.0]), "").pose for i in range(int(child))
        ]
        return name, ARRAY, PoseArray(header=told.header, poses=[*others, told.pose]), heard
    if child:
        return name, TRANSFORMS, _transform(told, child), heard
    if "odom" in name:
        message = Odometry(header=told.header)
        message.pose.pose = told.pose
        return name, ODOMETRY, message, heard
    return name, POSE, told, heard


def _stamped(when: int, position: Array, quaternion: Array, frame: str) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp(when), frame
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = map(float, position)
    turn.x, turn.y, turn.z, turn.w = map(float, quaternion)
    return message


def _transform(told: PoseStamped, child: str) -> TFMessage:
    one = TransformStamped(header=told.header, child_frame_id=child)
    at, turn = told.pose.position, told.pose.orientation
    one.transform.translation.x, one.transform.translation.y, one.transform.translation.z = at.x, at.y, at.z
    one.transform.rotation = turn
    return TFMessage(transforms=[one])
