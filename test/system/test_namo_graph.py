"""The way among furniture over DDS: a goal by the action, a plan, the robot sets out; cancelled, it comes to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose2D
from namo_person import Person
from pbrl_msgs.action import ReachGoal
from rclpy.context import Context

from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters

UNDER_WAY = 0.05  # [m] that it has driven when it is cancelled
ON_THE_WAY = ["Look", "GetReady", "Planning", "GetGraspPoint", "NavigateToPoint"]


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

    person.rests(person.way[-1][0])
    assert set(ON_THE_WAY) <= {status.state for status in person.feedback}
    assert {"namo/goal", "namo/regions", "namo/values", "namo/chosen", "namo/planned"} <= person.drawn
