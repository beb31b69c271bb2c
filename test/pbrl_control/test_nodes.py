"""The nodes, in process, on a clock of our own: no sleeps, nothing depends on how fast they run."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS, Posture
from pbrl_control.ros.body_controller_node import BodyControllerNode
from pbrl_control.ros.conversions import twist_to_msg
from pbrl_control.ros.push_node import PushNode
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_control.types import PlanarTwist

SPINS = 400  # turns of the executor before a test gives up


class World(Node):
    """What the nodes talk to: keeps what it hears, says what it is told to."""

    def __init__(self) -> None:
        super().__init__("world")
        self.base: list[Twist] = []
        self.right: list[Float64MultiArray] = []
        self.status: list[str] = []
        self.twists: list[TwistStamped] = []
        self.create_subscription(Twist, "/cmd_vel", self.base.append, COMMANDS)
        self.create_subscription(
            Float64MultiArray, "/right_arm_velocity_controller/commands", self.right.append, COMMANDS
        )
        self.create_subscription(String, "/push/status", lambda message: self.status.append(message.data), LATCHED)
        self.create_subscription(TwistStamped, "/object_twist_command", self.twists.append, COMMANDS)
        self.clock = self.create_publisher(Clock, "/clock", 10)
        self.joints = self.create_publisher(JointState, "/joint_states", 10)
        self.description = self.create_publisher(String, "/robot_description", LATCHED)
        self.twist = self.create_publisher(TwistStamped, "/object_twist_command", COMMANDS)

    def tell(self, now: float, posture: Posture, twist: tuple[str, PlanarTwist] | None = None) -> None:
        """Say what time it is, where the joints are, and a command."""
        stamp = Time(sec=int(now), nanosec=round((now - int(now)) * 1e9))
        self.clock.publish(Clock(clock=stamp))
        names = [*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"]]
        message = JointState(name=names, position=posture.vector().tolist())
        message.header.stamp = stamp
        if twist is not None:
            self.twist.publish(twist_to_msg(*twist, stamp))
        self.joints.publish(message)


@pytest.fixture
def spin_with() -> Iterator[Callable[[type[Node]], tuple]]:
    """Give a function that makes a node and returns it, the world, and a spinner: `until(condition, act)`."""
    context_args = ["--ros-args", "-p", "use_sim_time:=true", "-p", "push_node:exit_when_done:=true"]
    rclpy.init(args=context_args, domain_id=1 + os.getpid() % 100)
    executor, nodes = SingleThreadedExecutor(), []

    def make(kind: type[Node]) -> tuple:
        nodes.extend([kind(), World()])
        for node in nodes:
            executor.add_node(node)

        def until(condition: Callable[[], bool], act: Callable[[int], None]) -> None:
            for turn in range(SPINS):
                act(turn)
                for _ in range(8):
                    executor.spin_once(timeout_sec=0.005)
                if condition():
                    return
            raise AssertionError(f"not so after {SPINS} turns")

        return nodes[0], nodes[1], until

    yield make
    for node in nodes:
        node.destroy_node()
    executor.shutdown()
    rclpy.try_shutdown()


def test_controller_obeys_and_stops_when_commands_cease(spin_with, push_posture: Posture, root: Path) -> None:
    _, world, until = spin_with(BodyControllerNode)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    forward = ("left_ft", PlanarTwist(vx=0.3))
    until(
        lambda: bool(world.base) and abs(world.base[-1].linear.x) > 0.01 and len(world.right) > 20,
        lambda turn: world.tell(0.02 * turn, push_posture, forward),
    )
    assert any(np.abs(message.data).max() > 0.05 for message in world.right), "the idle arm stows"
    start = world.get_clock().now().nanoseconds * 1e-9
    until(
        lambda: world.base[-1].linear.x == 0.0,
        lambda turn: world.tell(start + 30.0 + 0.02 * turn, push_posture),
    )
    said = len(world.base)
    world.tell(start + 60.0, push_posture)
    assert len(world.base) - said <= 1, "with nothing commanded it leaves the drives to others"


def test_push_without_a_scene_fails_with_a_sentence(spin_with, push_posture: Posture) -> None:
    node, world, until = spin_with(PushNode)
    until(
        lambda: bool(world.status) and "failed" in world.status[-1], lambda turn: world.tell(1.0 + turn, push_posture)
    )
    assert world.status[0] == "approach"
    assert world.status[-1].startswith("failed: no sight of body 'table_a' in the scene")
    assert node.ended.done()
    assert {message.header.frame_id for message in world.twists} == {"left_ft"}


@pytest.mark.parametrize(
    ("module", "arguments", "complaint"),
    [
        ("push_node", ["-p", "plan:=no_such_plan"], "push plan: expected a path or one of"),
        ("push_node", ["-p", "plan:=3"], "plan: expected str"),
        ("push_node", ["-p", "rate:=1"], "rate: expected 10 to 200"),
        ("push_node", ["-p", "plam:=turn_table"], "did you mean 'plan'?"),
        ("body_controller_node", ["-p", "settings:=no_such_file.yaml"], "expected a readable YAML file"),
        ("body_controller_node", ["-p", "settings:=3"], "settings: expected str"),
        ("body_controller_node", ["-p", "setings:=x.yaml"], "did you mean 'settings'?"),
    ],
)
def test_a_mistake_at_start_is_one_line_and_exit_code_2(module: str, arguments: list[str], complaint: str) -> None:
    command = [sys.executable, "-m", f"pbrl_control.ros.{module}", "--ros-args", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert complaint in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
