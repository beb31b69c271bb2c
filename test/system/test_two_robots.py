"""Two robots in one ROS domain, each in a namespace: each does what it is asked, unheard by the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Vector3
from pbrl_msgs.srv import PushObject
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from pbrl_bag import describe, read_recording
from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs

ROBOTS = ("/first", "/fleet/second")
STREAMS = ("/wrist_ft/left", "/ar_tags/table_a/pose", "/ar_tags/left_gripper/pose", "/grasps", "/scene")
PATIENCE = 120.0  # [s]


class Yard:
    """Both robots, and somebody who asks them for pushes."""

    def __init__(self, domain: int, folder: Path, programs: dict[str, Programs]) -> None:
        self.folder, self.programs = folder, programs
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("user", context=self._context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.told: dict[str, dict[str, str]] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._tell, 10)

    def _tell(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.told[status.name] = {each.key: each.value for each in status.values}

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            for each in self.programs.values():
                each.check()
            assert time.monotonic() < deadline, "did not happen"
            self._executor.spin_once(timeout_sec=0.02)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def yard(tmp_path: Path, nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Yard]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain, ExitStack() as stack:
        programs = {}
        for number, robot in enumerate(ROBOTS):
            settings = {
                "hand.rate": "0.0",
                "hand.seed": str(number),
                "recorder.output": str(tmp_path / f"bag_{number}"),
            }
            graph = with_parameters(load_graph("hand"), settings)
            graph = graph.model_copy(update={"nodes": {name: graph.nodes[name] for name in ("hand", "recorder")}})
            programs[robot] = stack.enter_context(running_graph(graph, tmp_path / f"logs_{number}", domain, robot))
        one = Yard(domain, tmp_path, programs)
        yield one
        one.close()


def test_two_robots_push_side_by_side(yard: Yard) -> None:
    clients = {robot: yard.node.create_client(PushObject, f"{robot}/push") for robot in ROBOTS}
    yard.until(lambda: all(client.service_is_ready() for client in clients.values()))
    heard = [robot + stream for robot in ROBOTS for stream in STREAMS]
    yard.until(lambda: all(yard.node.count_subscribers(topic) for topic in heard))
    # That this node knows the recorders does not say that the simulators do; a latched message that has arrived does.
    counts = [f"{robot[1:]}/recorder" for robot in ROBOTS]
    yard.until(lambda: all(int(yard.told.get(name, {}).get("messages", "0")) for name in counts))
    calls = []
    for number, client in enumerate(clients.values()):
        way = Vector3(x=1.0) if number == 0 else Vector3(x=1.0, y=0.3)
        push = PushObject.Request(object="table_a", direction=way, speed=0.06, duration=1.0 + number)
        push.contact_point = Point(x=-0.375, y=0.0)
        calls.append(client.call_async(push))
    yard.until(lambda: all(call.done() for call in calls))
    assert [call.result().message for call in calls] == ["done", "done"]
    yard.until(lambda: yard.told.keys() >= {f"{robot[1:]}/{name}" for robot in ROBOTS for name in ("hand", "recorder")})

    lengths = []
    for number, robot in enumerate(ROBOTS):
        yard.programs[robot].stop("recorder")
        bag = yard.folder / f"bag_{number}"
        names = {topic.name for topic in describe(bag).topics}
        assert {robot + stream for stream in (*STREAMS, "/clock")} <= names
        assert all(name.startswith(f"{robot}/") for name in names), "what is another's or everybody's is not recorded"
        recording = read_recording(bag)
        assert any(robot in note for note in recording.notes)
        assert [grasp.object for grasp in recording.grasps] == ["table_a"]
        lengths.append(recording.grasps[0].end - recording.grasps[0].start)
        moved = np.ptp(recording.object_poses["table_a"].position[:, :2], axis=0)
        assert np.hypot(*moved) > 0.02
    assert lengths[1] > lengths[0] + 0.9, "each did its own push"
