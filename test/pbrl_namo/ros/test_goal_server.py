"""The action: one goal at a time, each with one result; who is no longer wanted is told so."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose2D
from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from pbrl_bringup.graph import free_domain
from pbrl_namo.ros.goal_server import GoalServer

PATIENCE = 20.0  # [s]
FINISHED = {"finished": True}


@dataclass
class Both:
    """Server and client in one process, each spun in turn."""

    context: Context
    goals: list[tuple[np.ndarray, int]] = field(default_factory=list)
    cancels: int = 0
    told: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.node, self.other = Node("server", context=self.context), Node("client", context=self.context)
        self.spinner = EventsExecutor(context=self.context)
        self.mine = SingleThreadedExecutor(context=self.context)
        self.spinner.add_node(self.node)
        self.mine.add_node(self.other)
        self.server = GoalServer(self.node, lambda goal, seed: self.goals.append((goal, seed)), self._cancel)
        self.client = ActionClient(self.other, ReachGoal, "/reach_goal")

    def _cancel(self) -> None:
        self.cancels += 1

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, "did not happen"
            self.spinner.spin_once(timeout_sec=0.005)
            self.mine.spin_once(timeout_sec=0.005)

    def send(self, x: float = 1.0, y: float = 2.0, theta: float = math.nan, seed: int = 0) -> Any:
        """Send a goal; return its handle."""
        self.until(self.client.server_is_ready)
        goal = ReachGoal.Goal(goal=Pose2D(x=x, y=y, theta=theta), seed=seed)
        future = self.client.send_goal_async(
            goal, feedback_callback=lambda message: self.told.append(message.feedback.status.sentence)
        )
        self.until(future.done)
        return future.result()

    def result(self, future: Any) -> Any:
        self.until(future.done)
        return future.result()

    def close(self) -> None:
        self.spinner.shutdown()
        self.mine.shutdown()
        self.server.destroy()
        self.client.destroy()
        self.node.destroy_node()
        self.other.destroy_node()


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Iterator[Both]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        pair = Both(context)
        yield pair
        pair.close()
        rclpy.try_shutdown(context=context)


def test_a_goal_is_told_of_and_gets_its_result(both: Both) -> None:
    handle = both.send(seed=7)
    assert handle.accepted
    ((goal, seed),) = both.goals
    np.testing.assert_array_equal(goal, [1.0, 2.0, math.nan])
    assert seed == 7
    both.server.tell(NamoStatus(state="Planning", sentence="thinking"))
    both.until(lambda: both.told == ["thinking"])
    both.server.tell(NamoStatus(state="Done", sentence="there", success=True, **FINISHED))
    found = both.result(handle.get_result_async())
    assert found.status == GoalStatus.STATUS_SUCCEEDED
    assert (found.result.success, found.result.message, found.result.status.state) == (True, "there", "Done")
    both.server.tell(NamoStatus(state="Done", sentence="still there", success=True, **FINISHED))
    assert not both.send(x=math.nan).accepted, "no place"
    assert len(both.goals) == 1


def test_a_failure_is_told_with_its_reason(both: Both) -> None:
    handle = both.send()
    both.server.tell(NamoStatus(state="Failed", sentence="no way", **FINISHED))
    found = both.result(handle.get_result_async())
    assert (found.status, found.result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert found.result.message == "no way"


def test_a_cancelled_goal_ends_when_all_is_let_go_and_not_before(both: Both) -> None:
    handle = both.send()
    result = handle.get_result_async()
    assert len(both.result(handle.cancel_goal_async()).goals_canceling) == both.cancels == 1
    both.server.tell(NamoStatus(state="ReleaseAndCancel", sentence="opening"))
    both.until(lambda: both.told == ["opening"])
    assert not result.done()
    both.server.tell(NamoStatus(state="Cancelled", sentence="cancelled", **FINISHED))
    found = both.result(result)
    assert (found.status, found.result.message) == (GoalStatus.STATUS_CANCELED, "cancelled")


def test_a_gripper_that_does_not_open_makes_a_cancelled_goal_a_failed_one(both: Both) -> None:
    handle = both.send()
    both.result(handle.cancel_goal_async())
    both.server.tell(NamoStatus(state="Failed", sentence="cancelled; still held", **FINISHED))
    assert both.result(handle.get_result_async()).status == GoalStatus.STATUS_ABORTED


def test_a_new_goal_takes_the_place_of_the_one_before(both: Both) -> None:
    first = both.send(x=1.0)
    result = first.get_result_async()
    second = both.send(x=2.0)
    found = both.result(result)
    assert (found.status, found.result.message) == (GoalStatus.STATUS_ABORTED, "another goal was given")
    assert [goal[0] for goal, _ in both.goals] == [1.0, 2.0]
    assert both.cancels == 0, "who is replaced does not end the one who replaces him"
    assert not both.result(first.cancel_goal_async()).goals_canceling
    both.server.replaced("by a person")
    assert both.result(second.get_result_async()).result.message == "by a person"
    both.server.replaced("there is nothing to replace")
