"""A node's diagnostics: level, sentence and numbers follow from what it heard, and come once a second."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from pbrl_bag.ros.diagnostics import SILENT, Diagnostics

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    made = Node("watched", context=context, namespace="/robot_1", enable_rosout=False)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {each.key: each.value for each in status.values}


def test_what_is_needed_and_never_came_is_waited_for(node: Node) -> None:
    told = Diagnostics(node)
    scene = told.input("/scene", stream=False)
    told.input("/odom")
    told.input("/object_models", needed=False, stream=False)
    status = told.status(time.monotonic())
    assert (status.level, status.message) == (DiagnosticStatus.WARN, "waits for /scene, /odom")
    assert status.name == "robot_1/watched"
    scene.heard()
    assert told.status(time.monotonic()).message == "waits for /odom"


def test_rate_and_age_are_those_of_what_was_heard(node: Node) -> None:
    told = Diagnostics(node)
    odometry = told.input("/odom")
    begin = time.monotonic()
    told.status(begin)
    for _ in range(30):
        odometry.heard()
    status = told.status(begin + 2.0)
    assert (status.level, status.message) == (DiagnosticStatus.OK, "ok")
    assert float(values(status)["/odom rate [Hz]"]) == pytest.approx(15.0)
    assert float(values(status)["/odom age [s]"]) == pytest.approx(2.0, abs=0.5)
    assert float(values(told.status(begin + 4.0))["/odom rate [Hz]"]) == 0.0, "since it was asked last"


def test_a_stream_that_ceased_is_an_error_and_what_comes_seldom_is_not(node: Node) -> None:
    told = Diagnostics(node)
    told.input("/odom").heard()
    told.input("/scene", stream=False).heard()
    told.input("/object_models", needed=False).heard()
    now = time.monotonic()
    assert told.status(now + 0.9 * SILENT).level == DiagnosticStatus.OK
    status = told.status(now + 10.0)
    assert (status.level, status.message) == (DiagnosticStatus.ERROR, "nothing of /odom for 10 s")
    assert "/scene rate [Hz]" not in values(status)


def test_trouble_comes_before_all_else_and_numbers_are_told(node: Node) -> None:
    state = SimpleNamespace(trouble="a hand lost the cart", doing="waits for a goal on /goal_pose")
    told = Diagnostics(node, lambda: state.doing, lambda: state.trouble, lambda: {"plans": 3, "load": 0.123456})
    odometry = told.input("/odom")
    assert (told.status(0.0).level, told.status(0.0).message) == (DiagnosticStatus.ERROR, state.trouble)
    assert values(told.status(0.0)) | {"plans": "3", "load": "0.123"} == values(told.status(0.0))
    state.trouble = ""
    assert told.status(0.0).message == "waits for /odom", "what never came is more than waiting for a goal"
    odometry.heard()
    assert (told.status(0.0).level, told.status(0.0).message) == (DiagnosticStatus.OK, state.doing)


def test_it_is_told_on_the_usual_topic_of_what_came_in_the_namespace(node: Node) -> None:
    taken: list[Odometry] = []
    told = Diagnostics(node)
    told.subscribe(Odometry, "odom", taken.append, QoSProfile(depth=10))
    told.subscribe(TFMessage, "/tf_static", taken.append, LATCHED, needed=False)
    other = Node("other", context=node.context, enable_rosout=False)
    heard: list[DiagnosticArray] = []
    other.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    out = other.create_publisher(Odometry, "/robot_1/odom", 10)
    executor = SingleThreadedExecutor(context=node.context)
    for each in (node, other):
        executor.add_node(each)
    deadline = time.monotonic() + 30.0
    while not (taken and heard and heard[-1].status[0].level == DiagnosticStatus.OK):
        out.publish(Odometry())
        executor.spin_once(timeout_sec=0.1)
        assert time.monotonic() < deadline, "nothing came"
    executor.shutdown()
    other.destroy_node()
    assert [status.name for status in heard[-1].status] == ["robot_1/watched"]
    said = values(heard[-1].status[0])
    assert float(said["/odom rate [Hz]"]) > 0.0
    assert said["/tf_static age [s]"] == "never heard" and "/tf_static rate [Hz]" not in said


def test_a_node_that_has_a_namesake_says_so_until_it_is_gone(node: Node) -> None:
    told = Diagnostics(node)
    assert told.status(time.monotonic()).level != DiagnosticStatus.ERROR
    other = Node("watched", context=node.context, namespace="/robot_1", enable_rosout=False)
    status = told.status(time.monotonic())
    assert (status.level, "2 nodes are called /robot_1/watched" in status.message) == (DiagnosticStatus.ERROR, True)
    other.destroy_node()
    assert told.status(time.monotonic()).level != DiagnosticStatus.ERROR
