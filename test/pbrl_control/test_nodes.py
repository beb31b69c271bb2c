"""The nodes, in process, on a clock of our own: no sleeps, nothing depends on how fast they run."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Twist, TwistStamped
from pbrl_msgs.msg import Body, ObjectModel, ObjectModels, Scene
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray, String

from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS, Posture
from pbrl_control.ros.body_controller_node import BodyControllerNode
from pbrl_control.ros.conversions import twist_to_msg
from pbrl_control.ros.push_node import PushNode
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_control.types import PlanarTwist
from pbrl_model.parameters import UNITS

SPINS = 400  # turns of the executor before a test gives up


class World(Node):
    """What the nodes talk to: keeps what it hears, says what it is told to."""

    def __init__(self) -> None:
        super().__init__("world")
        self.base: list[Twist] = []
        self.right: list[Float64MultiArray] = []
        self.status: list[str] = []
        self.shares: list[float] = []
        self.create_subscription(
            Float64, "/body_controller/share", lambda message: self.shares.append(message.data), COMMANDS
        )
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
        self.emergency = self.create_publisher(Bool, "/emergency_stop", LATCHED)
        self.reports: list[str] = []
        self.create_subscription(
            String, "/body_controller/status", lambda message: self.reports.append(message.data), LATCHED
        )

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
def spin_with(request: pytest.FixtureRequest, domain: int) -> Iterator[Callable[[type[Node]], tuple]]:
    """Give a function that makes a node and returns it, the world, and a spinner: `until(condition, act)`."""
    context_args = ["--ros-args", "-p", "use_sim_time:=true", "-p", "push_node:exit_when_done:=true"]
    context_args += getattr(request, "param", [])
    rclpy.init(args=context_args, domain_id=domain)
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


def moved(posture: Posture, turn: int) -> Posture:
    """Return a posture that is not the same at every turn, as a robot's that moves."""
    return replace(posture, left=posture.left + 1e-6 * turn)


@pytest.mark.parametrize("qos", [LATCHED, COMMANDS], ids=["latched", "as by default"])
def test_an_emergency_stop_is_rest_until_it_is_lifted(
    spin_with, push_posture: Posture, root: Path, qos: QoSProfile
) -> None:
    _, world, until = spin_with(BodyControllerNode)
    emergency = world.create_publisher(Bool, "/emergency_stop", qos)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    forward, now = ("base", PlanarTwist(vx=0.3)), [0.0]

    def drive(turn: int) -> None:
        now[0] += 0.02
        world.tell(now[0], moved(push_posture, round(now[0] / 0.02)), forward)

    until(lambda: bool(world.base) and world.base[-1].linear.x > 0.05, drive)
    emergency.publish(Bool(data=True))
    until(lambda: world.base[-1].linear.x == 0.0 and bool(world.reports), drive)
    assert "emergency stop" in world.reports[-1]
    for turn in range(10):
        drive(turn)
    until(lambda: world.base[-1].linear.x == 0.0, drive)
    emergency.publish(Bool(data=False))
    until(lambda: world.base[-1].linear.x > 0.05, drive)
    assert world.reports[-1] == "ok"


def test_a_scene_whose_fence_touches_itself_is_left_aside(spin_with, push_posture: Posture, root: Path) -> None:
    node, world, until = spin_with(BodyControllerNode)
    scene = world.create_publisher(Scene, "/scene", LATCHED)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    until(lambda: node._fence is not None, lambda turn: world.tell(0.02 * turn, push_posture))
    crossed = [Point(x=x, y=y) for x, y in ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.0), (0.0, 2.0))]
    whole = [Point(x=x, y=y) for x, y in ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0), (5.0, 6.0))]
    logged: list[str] = []
    world.create_subscription(Log, "/rosout", lambda message: logged.append(message.msg), 10)
    scene.publish(Scene(bodies=[Body(name="keep_out_0", footprint=crossed, height=3.0)]))
    until(lambda: any("left aside: keep_out_0" in each for each in logged), lambda _: None)
    assert not node._bodies
    scene.publish(Scene(bodies=[Body(name="keep_out_0", footprint=whole, height=3.0)]))
    until(lambda: node._bodies, lambda _: None)
    assert node._fence.stands


def test_joint_positions_that_freeze_stop_the_robot(spin_with, push_posture: Posture, root: Path) -> None:
    _, world, until = spin_with(BodyControllerNode)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    up = ("left_ft", PlanarTwist(vz=0.1))
    until(
        lambda: bool(world.reports) and "frozen" in world.reports[-1],
        lambda turn: world.tell(0.02 * turn, push_posture, up),
    )
    assert world.reports[-1].startswith("joint positions: expected changes as the robot moves")
    until(lambda: world.base[-1].linear.x == 0.0 and not any(world.right[-1].data), lambda turn: None)


def test_with_every_command_it_says_how_much_of_it_is_done(spin_with, push_posture: Posture, root: Path) -> None:
    _, world, until = spin_with(BodyControllerNode)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    far_too_fast, slow = (("left_ft", PlanarTwist(vy=speed)) for speed in (30.0, 0.01))
    until(lambda: len(world.shares) > 5, lambda turn: world.tell(0.02 * turn, moved(push_posture, turn), far_too_fast))
    assert 0.0 <= max(world.shares) < 0.5
    until(lambda: world.shares[-1] > 0.9, lambda turn: world.tell(10.0 + 0.02 * turn, moved(push_posture, turn), slow))
    world.emergency.publish(Bool(data=True))
    until(lambda: world.shares[-1] == 0.0, lambda turn: world.tell(30.0 + 0.02 * turn, moved(push_posture, turn), slow))
    until(lambda: len(world.shares) >= len(world.base), lambda turn: None)  # more: a sign of life now and then


@pytest.mark.parametrize("spin_with", [["-p", "body_controller_node:rate:=100"]], indirect=True)
def test_with_a_rate_it_ticks_between_joint_states_and_not_without_them(
    spin_with, push_posture: Posture, root: Path
) -> None:
    _, world, until = spin_with(BodyControllerNode)
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    forward = ("left_ft", PlanarTwist(vx=0.3))
    until(lambda: len(world.base) > 3, lambda turn: world.tell(0.02 * turn, moved(push_posture, turn), forward))
    said = len(world.base)
    until(lambda: len(world.base) > said + 5, lambda turn: None)
    assert world.base[-1].linear.x > 0.0
    silent = [len(world.base), time.monotonic()]

    def quiet() -> bool:
        if len(world.base) != silent[0]:
            silent[:] = len(world.base), time.monotonic()
        return time.monotonic() - silent[1] > 0.5

    until(quiet, lambda turn: None)
    until(lambda: len(world.base) > silent[0], lambda turn: world.tell(1.0, moved(push_posture, turn), forward))


def test_push_without_a_scene_fails_with_a_sentence(spin_with, push_posture: Posture) -> None:
    node, world, until = spin_with(PushNode)
    until(
        lambda: bool(world.status) and "failed" in world.status[-1], lambda turn: world.tell(1.0 + turn, push_posture)
    )
    assert world.status[0] == "approach"
    assert world.status[-1].startswith("failed: no sight of body 'table_a' in the scene")
    assert node.ended.done()
    assert {message.header.frame_id for message in world.twists} == {"left_ft"}


FETCH = ["-p", "push_node:trajectory:=turn_about_caster", "-p", "push_node:fetch:=true"]


@pytest.mark.parametrize("spin_with", [FETCH, [*FETCH, "-p", "push_node:grips:=sampled"]], indirect=True)
def test_a_fetch_looks_around_and_says_what_it_does_not_see(spin_with, push_posture: Posture, root: Path) -> None:
    node, world, until = spin_with(PushNode)
    world.tell(1.0, push_posture)
    assert node._executive is None, "the robot is not known yet"
    world.description.publish(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    scene = world.create_publisher(Scene, "/scene", LATCHED)
    corners = [Point(x=x, y=y) for x, y in ((-0.4, -0.7), (0.4, -0.7), (0.4, 0.7), (-0.4, 0.7))]
    names = ("table_a", "table_b", "wall")
    scene.publish(Scene(bodies=[Body(name=n, footprint=corners, height=0.77, movable=n != "wall") for n in names]))
    until(
        lambda: bool(world.status) and "failed" in world.status[-1], lambda turn: world.tell(1.0 + turn, push_posture)
    )
    assert world.status[0] == "locate"
    assert "tag 'table_a'; tag 'table_b'; pose of the base (odometry: expected" in world.status[-1]
    assert {message.header.frame_id for message in world.twists} == {"base"}
    assert not any(message.twist.linear.x or message.twist.angular.z for message in world.twists)
    assert node.ended.done()


@pytest.mark.parametrize("spin_with", [FETCH], indirect=True)
def test_a_scene_whose_room_is_none_is_left_aside_before_the_robot_is_known(spin_with, root: Path) -> None:
    node, _, _ = spin_with(PushNode)
    (hear,) = (each.callback for each in node.subscriptions if each.topic_name == "/scene")
    corners = [Point(x=x, y=y) for x, y in ((-0.4, -0.7), (0.4, -0.7), (0.4, 0.7), (-0.4, 0.7))]
    hear(Scene(bodies=[Body(name="table_a", footprint=corners, height=0.77, movable=True)], room=corners[:1]))
    assert node._scene is None
    node._on_description(String(data=(root / "urdf/krang/krang.urdf").read_text()))
    assert node._fetch is not None


@pytest.mark.parametrize("spin_with", [["-p", "push_node:trajectory:=turn_about_caster"]], indirect=True)
def test_a_trajectory_is_followed_as_the_learned_model_allows(spin_with, push_posture: Posture) -> None:
    node, world, until = spin_with(PushNode)
    models = world.create_publisher(ObjectModels, "/object_models", LATCHED)
    scene = world.create_publisher(Scene, "/scene", LATCHED)
    names = {"mass": 33.0, "wheel_x": -0.3, "wheel_y": -0.6, "wheel_theta": 0.0, "mu_x": 0.9, "mu_y": 0.9}
    learned = ObjectModel(object="table_a", model_class="wheel", parameters=list(names), draws=1)
    learned.units, learned.samples = [UNITS[name] for name in names], [-1.0, *list(names.values())[1:]]
    models.publish(ObjectModels(models=[learned]))
    until(lambda: node._learned is not None, lambda turn: world.tell(0.02 * turn, push_posture))
    assert node._course.model is None, "its outline is not known yet"
    corners = [Point(x=x, y=y) for x, y in ((-0.4, -0.7), (0.4, -0.7), (0.4, 0.7), (-0.4, 0.7))]
    scene.publish(Scene(bodies=[Body(name="table_a", footprint=corners, height=0.77)]))
    until(lambda: node._course.refused, lambda turn: world.tell(5.0 + 0.02 * turn, push_posture))
    assert "expected a mass above zero" in node._course.refused
    learned.samples = list(names.values())
    models.publish(ObjectModels(models=[learned]))
    until(lambda: node._course.model is not None, lambda turn: world.tell(10.0 + 0.02 * turn, push_posture))
    assert node._course.model.mass == 33.0
    assert not node._course.refused, "a sound model takes its place"
    learned.samples = [-1.0, *learned.samples[1:]]
    models.publish(ObjectModels(models=[learned]))
    until(lambda: node._learned.samples[0] == -1.0, lambda turn: world.tell(20.0 + 0.02 * turn, push_posture))
    assert node._course.model.mass == 33.0, "what has no mass is left aside"
    learned.samples = [-1.0, *learned.samples[1:]]
    models.publish(ObjectModels(models=[learned]))
    until(lambda: node._learned.samples[0] == -1.0, lambda turn: world.tell(20.0 + 0.02 * turn, push_posture))
    assert node._course.model.mass == 33.0, "what has no mass is left aside"


@pytest.mark.parametrize("spin_with", [["-p", "push_node:trajectory:=turn_about_caster"]], indirect=True)
def test_a_learned_hinge_counts_from_the_first_tag_on(spin_with, push_posture: Posture) -> None:
    node, world, until = spin_with(PushNode)
    models = world.create_publisher(ObjectModels, "/object_models", LATCHED)
    scene = world.create_publisher(Scene, "/scene", LATCHED)
    tags = world.create_publisher(PoseStamped, "/ar_tags/table_a/pose", COMMANDS)
    names = {"mass": 33.0, "anchor_x": -0.3, "anchor_y": 0.0, "hinge_x": 0.2, "hinge_y": 2.0, "hinge_radius": 0.5}
    learned = ObjectModel(object="table_a", model_class="hinge", parameters=list(names), draws=1)
    learned.units, learned.samples = [UNITS[name] for name in names], list(names.values())
    models.publish(ObjectModels(models=[learned]))
    corners = [Point(x=x, y=y) for x, y in ((-0.4, -0.7), (0.4, -0.7), (0.4, 0.7), (-0.4, 0.7))]
    scene.publish(Scene(bodies=[Body(name="table_a", footprint=corners, height=0.77)]))
    until(lambda: node._learned and node._bodies, lambda turn: world.tell(0.02 * turn, push_posture))
    assert node._course.model is None, "where it is has not been seen yet"
    assert not node._course.refused
    message = PoseStamped()
    message.pose.position.x, message.pose.position.y, message.pose.orientation.w = 1.0, 2.0, 1.0

    def see(turn: int) -> None:
        tags.publish(message)
        world.tell(5.0 + 0.02 * turn, push_posture)

    until(lambda: node._course.model is not None, see)
    assert node._course.model.parameters.hinge_radius == 0.5


@pytest.mark.parametrize(
    ("module", "arguments", "complaint"),
    [
        ("push_node", ["-p", "plan:=no_such_plan"], "push plan: expected a path or one of"),
        ("push_node", ["-p", "plan:=3"], "plan: expected str"),
        ("push_node", ["-p", "trajectory:=nowhere"], "trajectory: expected a path or one of straight_and_turn"),
        ("push_node", ["-p", "rate:=14"], "rate: expected 20 to 200"),
        ("body_controller_node", ["-p", "rate:=9"], "rate: expected 0, or 20 to 1000"),
        ("push_node", ["-p", "plam:=turn_table"], "did you mean 'plan'?"),
        ("push_node", ["-p", "grips:=sampled"], "sampled together with fetch:=true"),
        ("push_node", ["-p", "grips:=any", "-p", "fetch:=true"], "grips: expected plan"),
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
