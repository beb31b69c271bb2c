"""The way among furniture over DDS: a goal by the action, a plan, the robot sets out; cancelled, it comes to rest."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry
from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray

from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_control.ros.floor_conversions import odometry_from_msg

LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE = 120.0  # [s]
UNDER_WAY = 0.05  # [m] that it has driven when it is cancelled
STOPPING, RESTING = 0.6, 0.4  # [s] of simulated time: until it has to rest, and for which that is looked at
AT_REST = 0.004  # [m] that odometry may wander meanwhile
ON_THE_WAY = ["Look", "GetReady", "Planning", "GetGraspPoint", "NavigateToPoint"]


class Person(Node):
    """Sends a goal, and keeps what is told of it."""

    def __init__(self, context: Context, programs: Programs) -> None:
        super().__init__("person", context=context, enable_rosout=False)
        self.told: list[NamoStatus] = []
        self.feedback: list[NamoStatus] = []
        self.way: list[tuple[float, np.ndarray]] = []
        self.drawn: set[str] = set()
        self._programs = programs
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self)
        self.client = ActionClient(self, ReachGoal, "/reach_goal")
        self.create_subscription(NamoStatus, "/namo/status", self.told.append, LATCHED)
        self.create_subscription(Odometry, "/odom", lambda message: self.way.append(odometry_from_msg(message)), 10)
        self.create_subscription(MarkerArray, "/markers", self._draw, 50)

    def _draw(self, message: MarkerArray) -> None:
        self.drawn |= {marker.ns for marker in message.markers}

    def states(self) -> list[str]:
        """States in their order, each stay once."""
        states = [status.state for status in self.told]
        return [state for k, state in enumerate(states) if k == 0 or state != states[k - 1]]

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Let messages come until a condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"{what}: {[(each.state, each.sentence) for each in self.told[-3:]]}"
            self._spinner.spin_once(timeout_sec=0.05)
            self._programs.check()

    def result(self, future: Any, what: str) -> Any:
        """Wait for an answer and return it."""
        self.until(future.done, what)
        return future.result()

    def leave(self) -> None:
        """Leave the graph."""
        self._spinner.shutdown()
        self.client.destroy()
        self.destroy_node()


@pytest.fixture
def person(tmp_path: Path, nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Person]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = with_parameters(load_graph("namo"), {"sim.seed": "3"})
    with free_domain() as domain, running_graph(graph, tmp_path / "logs", domain) as programs:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        someone = Person(context, programs)
        yield someone
        someone.leave()
        rclpy.try_shutdown(context=context)


def test_a_goal_is_set_out_for_and_cancelled(person: Person) -> None:
    person.until(person.client.server_is_ready, "nobody offers /reach_goal")
    assert person.told == [], "nothing is done before there is a goal"
    goal = ReachGoal.Goal(goal=Pose2D(x=5.0, y=0.0, theta=math.nan), seed=1)
    handle = person.result(
        person.client.send_goal_async(goal, lambda message: person.feedback.append(message.feedback.status)), "the goal"
    )
    assert handle.accepted
    person.until(lambda: person.told and person.told[-1].state in ("NavigateToPoint", "Failed"), "not set out")
    assert [state for state in person.states() if state != "Paused"][-3:] == ON_THE_WAY[-3:], person.told[-1].sentence
    chosen = person.told[-1]
    assert (chosen.region, chosen.target_region, chosen.regions, chosen.plans) == (0, 1, 2, 1)
    assert chosen.object in chosen.opening_object
    begin = person.way[-1][1][:2]
    person.until(lambda: math.dist(person.way[-1][1][:2], begin) > UNDER_WAY, "it does not drive")

    assert person.result(handle.cancel_goal_async(), "the cancelling").goals_canceling
    ended = person.result(handle.get_result_async(), "the result")
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert (ended.result.success, ended.result.message) == (False, "cancelled")
    assert ended.result.status.state == "Cancelled"
    person.until(lambda: person.told[-1].finished, "the status")
    assert person.told[-1].state == "Cancelled"

    stopped = person.way[-1][0] + STOPPING
    person.until(lambda: person.way[-1][0] > stopped + RESTING, "the clock stands still")
    places = np.array([pose[:2] for when, pose in person.way if when > stopped])
    assert len(places) > 5
    assert np.ptp(places, axis=0).max() < AT_REST
    assert set(ON_THE_WAY) <= {status.state for status in person.feedback}
    assert {"namo/goal", "namo/regions", "namo/values", "namo/chosen", "namo/planned"} <= person.drawn
