"""A small recording as the contract has it, made of real message instances, and a ROS domain of its own."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose2D, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene

from pbrl_bag import BagWriter

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
SQUARE = ((-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4))
Message = tuple[str, str, Any, int]  # topic, type, instance, log time [ns]


def stamp(seconds: float) -> Time:
    return Time(sec=int(seconds), nanosec=round(seconds % 1.0 * 1e9))


def pose(t: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, frame: str = "world") -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp(t), frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, y, 0.7
    message.pose.orientation.z, message.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


def wrench(t: float, fx: float = 1.0, frame: str = "left_ft") -> WrenchStamped:
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp(t), frame
    message.wrench.force.x, message.wrench.torque.z = fx, 0.25
    return message


def scene() -> Scene:
    table = Body(name="table", height=0.7, nominal_mass=20.0, movable=True, pose=Pose2D(x=1.0, y=0.0, theta=0.1))
    table.footprint = [Point(x=x, y=y) for x, y in SQUARE]
    message = Scene(bodies=[table], room=[Point(x=x, y=y) for x, y in ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0))])
    message.header.frame_id = "world"
    return message


def grasps(t: float, *sides: str, name: str = "table") -> Grasps:
    message = Grasps(grasps=[Grasp(gripper=side, object=name, contact_point=Point(x=-0.5)) for side in sides])
    message.header.stamp = stamp(t)
    return message


def pushing(seconds: float = 4.0) -> list[Message]:
    """A table held by the left gripper from 1 s to 3 s, drifting along x at 0.1 m/s and turning at 0.2 rad/s."""
    messages: list[Message] = [
        ("/scene", "pbrl_msgs/msg/Scene", scene(), 0),
        ("/grasps", "pbrl_msgs/msg/Grasps", grasps(0.0), 0),
        ("/grasps", "pbrl_msgs/msg/Grasps", grasps(1.0, "left"), 1_000_000_000),
        ("/grasps", "pbrl_msgs/msg/Grasps", grasps(3.0), 3_000_000_000),
    ]
    for i in range(round(seconds * 50)):
        t = i / 50
        messages.append(("/wrist_ft/left", WRENCH, wrench(t, fx=10.0 + t), round(t * 1e9)))
        if i % 3 == 0:
            messages.append(("/ar_tags/table/pose", POSE, pose(t, 0.1 * t, 0.0, 0.2 * t), round(t * 1e9)))
            messages.append(("/ar_tags/left_gripper/pose", POSE, pose(t, 0.1 * t - 0.5), round(t * 1e9)))
    return sorted(messages, key=lambda message: message[3])


def write(folder: Path, messages: list[Message], chunk: int = 10**9) -> Path:
    """Write a bag; a chunk is finished after so many messages."""
    with BagWriter(folder, live=False) as writer:
        for i, (topic, type_name, message, log_time) in enumerate(messages, 1):
            writer.write(topic, type_name, message, log_time)
            if i % chunk == 0:
                writer.flush()
    return folder


@pytest.fixture
def kit() -> SimpleNamespace:
    """The makers above; test modules cannot import one another."""
    return SimpleNamespace(
        pose=pose, wrench=wrench, scene=scene, grasps=grasps, pushing=pushing, write=write, stamp=stamp, square=SQUARE
    )


@pytest.fixture
def push_bag(tmp_path: Path) -> Path:
    return write(tmp_path / "push", pushing())


@pytest.fixture
def ros_domain(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep a test's graph to itself."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
