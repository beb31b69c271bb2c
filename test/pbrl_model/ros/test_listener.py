"""The listener: hears a recording's topics as they appear, whatever their quality of service."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message

from pbrl_bag.episodes import cut_episodes
from pbrl_bag.errors import BagError
from pbrl_model.ros.heard import Heard, Message, recording_of
from pbrl_model.ros.listener import RecordingListener

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SENSOR = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
PATIENCE = 20.0  # [s]


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch, domain: int) -> Iterator[Context]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    rclpy.try_shutdown(context=context)


def until(node: Node, condition: Callable[[], bool]) -> None:
    """Let a node work until a condition holds."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        executor.spin_once(timeout_sec=0.005)
    executor.remove_node(node)


def stamped(message: PoseStamped | WrenchStamped, seconds: float, frame: str) -> PoseStamped | WrenchStamped:
    message.header.stamp.sec, message.header.stamp.nanosec = int(seconds), round((seconds % 1) * 1e9)
    message.header.frame_id = frame
    return message


def scene() -> Scene:
    outline = [Point(x=x, y=y) for x, y in ((-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3))]
    message = Scene(bodies=[Body(name="table", footprint=outline, height=0.7, nominal_mass=20.0, movable=True)])
    message.header.frame_id = "world"
    return message


def held(names: list[str], seconds: float) -> Grasps:
    message = Grasps(grasps=[Grasp(gripper="left", object=name, contact_point=Point(x=-0.5)) for name in names])
    message.header.stamp.sec = int(seconds)
    return message


def test_hears_what_makes_a_recording(context: Context) -> None:
    listener = RecordingListener("listener", context)
    listener.start()
    robot = Node("robot", context=context)
    latched = [robot.create_publisher(kind, topic, LATCHED) for kind, topic in ((Scene, "/scene"), (Grasps, "/grasps"))]
    latched[0].publish(scene())
    latched[1].publish(held([], 0.0))
    streams = {
        "/wrist_ft/left": robot.create_publisher(WrenchStamped, "/wrist_ft/left", SENSOR),
        "/ar_tags/table/pose": robot.create_publisher(PoseStamped, "/ar_tags/table/pose", 200),
        "/ar_tags/left_gripper/pose": robot.create_publisher(PoseStamped, "/ar_tags/left_gripper/pose", 200),
    }
    until(robot, lambda: all(stream.get_subscription_count() for stream in streams.values()) and listener.count() >= 2)
    latched[1].publish(held(["table"], 1.0))
    for k in range(100):
        wrench = stamped(WrenchStamped(), k * 0.05, "left_ft")
        pose = stamped(PoseStamped(), k * 0.05, "world")
        pose.pose.position.x, pose.pose.orientation.w = k * 1e-3, 1.0
        streams["/wrist_ft/left"].publish(wrench)
        streams["/ar_tags/table/pose"].publish(pose)
        streams["/ar_tags/left_gripper/pose"].publish(pose)
        heard = 3 + 3 * (k + 1)
        until(robot, lambda heard=heard: listener.count() >= heard)
    recording = listener.recording()
    assert set(recording.bodies) == {"table"} and set(recording.wrenches) == {"left"}
    np.testing.assert_allclose(recording.object_poses["table"].position[:, 0], np.arange(100) * 1e-3)
    assert [(grasp.object, grasp.start) for grasp in recording.grasps] == [("table", 1.0)]
    assert listener.last("/ar_tags/table/pose").pose.position.x == pytest.approx(0.099)
    assert listener.last("/ar_tags/chair/pose") is None
    robot.destroy_node()
    listener.stop()


def test_only_our_own_robot_is_heard_and_by_the_names_of_the_contract(context: Context) -> None:
    listener = RecordingListener("listener", context, namespace="/ours")
    listener.start()
    robots = [Node("robot", context=context, namespace=namespace) for namespace in ("/ours", "/", "/theirs", "/ours_2")]
    for number, robot in enumerate(robots):
        wrench = stamped(WrenchStamped(), 1.0 + number, "left_ft")
        wrench.wrench.force.x = float(number)
        out = robot.create_publisher(WrenchStamped, "wrist_ft/left", LATCHED)
        out.publish(wrench)
    until(robots[0], lambda: listener.count() >= 1)
    listener.discover()  # the others are in the graph by now, too
    assert {topic for topic, _ in robots[0].get_topic_names_and_types()} >= {"/wrist_ft/left", "/ours_2/wrist_ft/left"}
    assert listener.get_subscriptions_info_by_topic("/wrist_ft/left") == []
    assert listener.count() == 1 and listener.last("/wrist_ft/left").wrench.force.x == 0.0
    for robot in robots:
        robot.destroy_node()
    listener.stop()


def test_it_keeps_its_name_where_its_process_is_told_what_the_other_node_is_called(
    monkeypatch: pytest.MonkeyPatch, domain: int
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(args=["--ros-args", "-r", "__node:=mismatch", "-r", "__ns:=/ours"], context=context, domain_id=domain)
    node = Node("mismatch_node", context=context)
    listener = RecordingListener(f"{node.get_name()}_listener", context, namespace=node.get_namespace())
    listener.start()
    assert node.get_fully_qualified_name() == "/ours/mismatch"
    assert listener.get_fully_qualified_name() == "/ours/mismatch_listener"
    listener.stop()
    rclpy.try_shutdown(context=context)


def test_where_the_oldest_holds_went_for_want_of_memory_the_last_ones_are_a_recording() -> None:
    heard, warned = Heard(1_000_000), []
    tags = ("/ar_tags/table/pose", "/ar_tags/left_gripper/pose")
    kinds = {"/wrist_ft/left": WrenchStamped} | dict.fromkeys(tags, PoseStamped)

    def say(topic: str, message: object) -> None:
        warned.extend(heard.add(Message(topic, type(message), serialize_message(message))))

    say("/scene", scene())
    for second in range(0, 120, 2):  # held every other two seconds
        say("/grasps", held(["table"] if second % 4 else [], second))
        for time_ in np.arange(second, second + 2, 0.02).tolist():
            for topic, kind in kinds.items():
                message = stamped(kind(), time_, "left_ft" if kind is WrenchStamped else "world")
                if kind is PoseStamped:
                    message.pose.orientation.w = 1.0
                say(topic, message)
    assert len(warned) == 1 and "the oldest is forgotten" in warned[0]
    recording = recording_of(heard.kept())
    episodes = cut_episodes(recording)
    assert 2 <= len(episodes) < 25 and episodes[-1].end == pytest.approx(119.98)
    assert episodes[0].end > recording.object_poses["table"].time[0]


def hears(heard: Heard, topic: str, message: object) -> list[str]:
    return heard.add(Message(topic, type(message), serialize_message(message)))


def goes(heard: Heard, topic: str, begin: float, end: float, frame: str = "world") -> None:
    """Let a stream have a message every 20 ms."""
    for time_ in np.arange(begin, end, 0.02).tolist():
        message = stamped(WrenchStamped() if frame.endswith("_ft") else PoseStamped(), time_, frame)
        if isinstance(message, PoseStamped):
            message.pose.orientation.w = 1.0
        hears(heard, topic, message)


STREAMS = {"/wrist_ft/left": "left_ft"} | dict.fromkeys(("/ar_tags/table/pose", "/ar_tags/left_gripper/pose"), "world")


def test_what_comes_late_or_twice_is_left_out_and_costs_nothing_else() -> None:
    heard = Heard(10**8)
    hears(heard, "/scene", scene())
    hears(heard, "/grasps", held(["table"], 1.0))
    for topic, frame in STREAMS.items():
        goes(heard, topic, 0.0, 4.0, frame)
        goes(heard, topic, 3.5, 3.6, frame)  # half a second back
        goes(heard, topic, 4.0, 6.0, frame)
    twice = stamped(WrenchStamped(), 5.98, "left_ft")
    twice.wrench.force.x = 3.0
    hears(heard, "/wrist_ft/left", twice)
    hears(heard, "/grasps", held([], 5.0))
    hears(heard, "/grasps", held(["table"], 4.0))
    recording = recording_of(heard.kept())
    for stream in (*recording.wrenches.values(), *recording.object_poses.values()):
        assert len(stream.time) == 300 and np.all(np.diff(stream.time) > 0.0)
    assert [(grasp.start, grasp.end) for grasp in recording.grasps] == [(1.0, 5.0)]


def test_a_body_that_has_left_the_scene_does_not_cost_the_holds_after_it() -> None:
    heard = Heard(10**8)
    hears(heard, "/scene", scene())
    hears(heard, "/grasps", held(["crate"], 1.0))
    hears(heard, "/grasps", held([], 3.0))
    hears(heard, "/grasps", held(["table"], 4.0))
    for topic, frame in STREAMS.items():
        goes(heard, topic, 0.0, 8.0, frame)
    with pytest.raises(BagError, match="crate"):
        recording_of(heard.kept())
    assert [grasp.object for grasp in recording_of(heard.kept(), since=3.5).grasps] == ["crate", "table"]


def test_nothing_heard_is_an_error_that_says_so(context: Context) -> None:
    listener = RecordingListener("listener", context)
    with pytest.raises(BagError, match="got no message"):
        listener.recording()
    listener.stop()
