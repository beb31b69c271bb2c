"""A running graph: what is heard is kept, told on, and followed by the page, which connects again by itself."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point, Pose2D, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile

from pbrl_bag import BagError
from pbrl_bringup.browser import Browser
from pbrl_bringup.graph import free_domain
from pbrl_bringup.ros.view_listener import ViewListener
from pbrl_bringup.view.live import MEMORY, Growing, LiveGraph
from pbrl_bringup.view.server import make_app

sys.path.insert(0, str(Path(__file__).parent))
from view_kit import OUTLINE, serving


def at(kind: type, time: float, frame: str) -> Any:
    message = kind()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = int(time), round(time % 1 * 1e9)
    return message


def tag(time: float, x: float) -> PoseStamped:
    message = at(PoseStamped, time, "world")
    message.pose.position.x, message.pose.orientation.w = x, 1.0
    return message


def felt(time: float, force: float) -> WrenchStamped:
    message = at(WrenchStamped, time, "left_ft")
    message.wrench.force.x = force
    return message


def scene() -> Scene:
    corners = [Point(x=float(x), y=float(y)) for x, y in OUTLINE]
    message = at(Scene, 0.0, "world")
    message.bodies = [Body(name="table", footprint=corners, height=0.7, movable=True, pose=Pose2D())]
    return message


def tell(graph: LiveGraph, start: float, end: float) -> None:
    for time in np.arange(start, end, 0.05).tolist():
        graph.hear("/ar_tags/table/pose", tag(time, 0.1 * time))
        graph.hear("/ar_tags/left_gripper/pose", tag(time, 0.1 * time - 0.7))
        graph.hear("/wrist_ft/left", felt(time, 5.0))


def told() -> LiveGraph:
    graph = LiveGraph("graph")
    graph.hear("/scene", scene())
    tell(graph, 10.0, 12.0)
    held = at(Grasps, 11.0, "")
    held.grasps = [Grasp(gripper="left", object="table")]
    graph.hear("/grasps", held)
    return graph


def test_what_is_heard_is_what_is_shown() -> None:
    data = told().data()
    assert data["begin"] == 0.0 and data["end"] == pytest.approx(1.95) and data["origin"] == 10.0
    table = data["streams"]["objects"][0]
    assert len(table["time"]) == 40 and np.allclose(table["x"], 0.1 * (10.0 + np.array(table["time"])), atol=1e-4)
    assert data["grasps"][0]["open"] and data["grasps"][0]["start"] == 1.0
    assert np.allclose(data["streams"]["forces"][0]["low"][0], -5.0)


def test_memory_is_bounded_and_old_samples_go() -> None:
    stream = Growing()
    for k in range(20_000):
        stream.add(0.1 * k, (float(k),))
    stream.add(5.0, (0.0,))
    stream.add(3000.0, (float("nan"),))
    assert stream.time[-1] == pytest.approx(1999.9) and stream.time[-1] - stream.time[0] <= 1.1 * MEMORY + 0.1
    time, rows = stream.since(1999.0, 1)
    assert len(time) == len(rows) == 10 and np.allclose(rows[:, 0], time * 10)


def test_a_clock_that_begins_anew_begins_the_page_anew() -> None:
    graph = told()
    tell(graph, 1.0, 2.0)
    data = graph.data()
    assert data["origin"] == 1.0 and data["end"] == pytest.approx(0.95) and data["objects"][0]["outline"]


def test_events_tell_what_is_new_and_only_that() -> None:
    graph = told()

    async def heard() -> list[str]:
        events = graph.events()
        found = [await anext(events)]
        tell(graph, 12.0, 12.5)
        found.append(await anext(events))
        graph.hear("/scene", scene())
        found.append(await anext(events))
        return found

    retry, streams, still = asyncio.run(heard())
    assert retry.startswith("retry:") and still.startswith("event: still")
    update = json.loads(streams.split("data: ")[1])
    times = update["streams"]["objects"][0]["time"]
    assert times[-1] == pytest.approx(2.45) and times[0] >= 0.0 and update["end"] == pytest.approx(2.45)


def test_a_message_that_does_not_fit_is_an_error_and_changes_nothing() -> None:
    graph = told()
    with pytest.raises(BagError):
        graph.hear("/scene", SimpleNamespace())
    graph.hear("/unknown", SimpleNamespace())
    assert len(graph.data()["objects"]) == 1


@pytest.fixture
def browser() -> Iterator[Browser]:
    with Browser() as one:
        yield one


def test_the_page_follows_and_comes_back(browser: Browser) -> None:
    graph = told()
    clock = "parseFloat(document.querySelector('.clock')?.textContent)"
    with serving(make_app(graph)) as address:
        port = int(address.rstrip("/").rpartition(":")[2])
        browser.open(address)
        browser.wait(f"{clock} > 1.8")
        tell(graph, 12.0, 14.0)
        browser.wait(f"{clock} > 3.8")
        across = "parseFloat(document.querySelector('.body').getAttribute('transform').split('(')[1])"
        browser.wait(f"Math.abs({across} - 1.395) < 1e-3")  # it is drawn after the clock is told
        browser.press("Home")
        tell(graph, 14.0, 15.0)
        browser.wait("document.querySelector('.clock').textContent.includes('of 3.9') === false")
        assert browser.run(clock) == 0.0, "who looks at the beginning is not carried off"
        browser.click("#follow")
        browser.wait(f"{clock} > 4.8")
    browser.wait("document.querySelector('#state')?.textContent.includes('trying again')")
    tell(graph, 15.0, 16.0)
    with serving(make_app(graph), port):
        browser.wait(f"{clock} > 5.8")
        browser.wait("document.querySelector('#state').textContent.startsWith('live')")
    assert not [each for each in browser.complaints if "ERR_" not in each], "the server was away; nothing else"


@pytest.mark.parametrize("robot", ["", "/robot_1"])
def test_it_hears_a_graph_over_ros(robot: str) -> None:
    graph, latched = LiveGraph("graph"), QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    arrived = threading.Event()

    def hear(topic: str, message: Any) -> None:
        graph.hear(topic, message)
        data = graph.data()
        if data["objects"] and data["objects"][0]["outline"] and data["streams"]["objects"][0]:
            arrived.set()

    with free_domain() as domain:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = rclpy.create_node("talker", context=context)
        try:
            node.create_publisher(Scene, f"{robot}/scene", latched).publish(scene())
            poses = node.create_publisher(PoseStamped, f"{robot}/ar_tags/table/pose", 10)
            wrong = node.create_publisher(PoseStamped, f"{robot}/wrist_ft/left", 10)
            with ViewListener(graph.wants, hear, domain, robot):
                for k in range(600):
                    poses.publish(tag(20.0 + 0.05 * k, 1.0))
                    wrong.publish(tag(20.0 + 0.05 * k, 1.0))
                    if arrived.wait(0.05):
                        break
        finally:
            node.destroy_node()
            rclpy.shutdown(context=context)
    assert arrived.is_set() and graph.data()["streams"]["objects"][0]["x"][0] == 1.0
