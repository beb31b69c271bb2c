"""The planner's action: found, proved not to be there, off the map, in something; each said in words."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMsg
from pbrl_msgs.action import PlanCartPath
from rcl_interfaces.msg import Log
from visualization_msgs.msg import MarkerArray

from pbrl_control.planar import Array
from pbrl_control.ros.qos import LATCHED
from pbrl_planner.cart.navigator import Navigator
from pbrl_planner.costmap import LETHAL, CostField
from pbrl_planner.ros.conversions import path_from_msg, pose_to_msg
from pbrl_planner.ros.lattice_planner_node import LatticePlannerNode

Result = PlanCartPath.Result


def floor(rows: int = 60, columns: int = 150) -> CostField:
    """A free floor of 7.5 by 3 m."""
    return CostField(np.zeros((rows, columns), np.uint8), 0.05, (0.0, 0.0), 1.0)


def at(*pose: float, frame: str = "map") -> PoseStamped:
    message = PoseStamped(pose=pose_to_msg(np.array(pose)))
    message.header.frame_id = frame
    return message


class Planning:
    def __init__(self, stage: Any) -> None:
        self.stage, self.told = stage, []
        self.node = stage.add(LatticePlannerNode, coarse=True)
        self.plans = stage.hear(PathMsg, "/plan", LATCHED)
        self.markers = stage.hear(MarkerArray, "/markers")

    def on(self, field: CostField) -> None:
        self.stage.track(self.node.tracker)
        self.stage.tell_floor("/global_costmap/costmap", field)

    def ask(self, goal: PoseStamped, start: Array | None = None, bend: float = 0.0) -> Any:
        request = PlanCartPath.Goal(goal=goal, use_start=start is not None, start_articulation=bend)
        if start is not None:
            request.start = at(*start)
        results = self.stage.ask(PlanCartPath, "/plan_cart_path", request, self.told.append)
        self.stage.until(lambda: results)
        return results[0]


@pytest.fixture
def planning(stage: Any) -> Planning:
    return Planning(stage)


def test_before_anything_is_known_it_says_what_is_missing(planning: Planning) -> None:
    done = planning.ask(at(3.0, 1.5, 0.0))
    assert done.outcome == Result.NOT_READY and "/global_costmap/costmap" in done.message


def test_it_is_busy_while_it_prepares_and_says_where_that_fails(
    planning: Planning, monkeypatch: pytest.MonkeyPatch
) -> None:
    enough, logged = threading.Event(), planning.stage.hear(Log, "/rosout")

    def fail(_: Navigator, __: CostField) -> None:
        enough.wait(60.0)
        raise MemoryError("no room for that")

    monkeypatch.setattr(Navigator, "prepare", fail)
    try:
        planning.on(floor())
        planning.stage.until(lambda: planning.node._prepared is not None)
        assert planning.node.thinking, "Python would wait for its thread"
    finally:
        enough.set()
    planning.stage.until(lambda: any("no room for that" in each.msg for each in logged))
    assert not planning.node.thinking


def test_each_question_has_its_answer(planning: Planning) -> None:
    walled = floor()
    walled.cells[:, 90:92] = LETHAL
    planning.on(walled)

    done = planning.ask(at(2.5, 1.5, 0.0))
    assert done.outcome == Result.FOUND, done.message
    poses = path_from_msg(done.path)
    assert np.hypot(*(poses[0, :2] - [1.0, 1.5])) < 0.06 and np.hypot(*(poses[-1, :2] - [2.5, 1.5])) < 0.04
    assert 1.0 <= done.epsilon <= 1.1 and done.cost > 4.0 and done.expansions > 0 and done.seconds > 0.0
    assert [each.epsilon for each in planning.told] == sorted((e.epsilon for e in planning.told), reverse=True)
    assert planning.told[-1].cost >= done.cost and planning.told[-1].epsilon >= done.epsilon
    planning.stage.until(lambda: planning.plans and planning.markers)
    assert len(planning.plans[0].poses) == len(poses) and planning.plans[0].header.frame_id == "map"
    points = np.array([[p.x, p.y] for p in planning.markers[0].markers[0].points])
    assert points[:, 0].max() == pytest.approx(poses[-1, 0] + 1.65, abs=0.01), "the cart's front, where it ends"

    behind = planning.ask(at(5.1, 1.5, 0.0))
    assert behind.outcome == Result.NO_PATH and "searched" in behind.message, behind.message
    off = planning.ask(at(8.0, 1.5, 0.0))
    assert off.outcome == Result.GOAL_OFF_MAP and "(8.00, 1.50)" in off.message
    taken = planning.ask(at(4.5, 1.5, 0.0))
    assert taken.outcome == Result.GOAL_OCCUPIED and "goal" in taken.message
    begin = planning.ask(at(2.5, 1.5, 0.0), np.array([0.1, 0.1, 0.0]))
    assert begin.outcome == Result.START_OCCUPIED
    nowhere = planning.ask(at(2.5, 1.5, 0.0), np.array([-1.0, 1.5, 0.0]))
    assert nowhere.outcome == Result.START_OFF_MAP and "start" in nowhere.message
    assert all(not each.path.path.poses for each in (behind, off, taken, begin, nowhere))
    frame = planning.ask(at(2.5, 1.5, 0.0, frame="odom"))
    assert frame.outcome == Result.NOT_READY and "'odom'" in frame.message
    bad = at(2.5, 1.5, 0.0)
    bad.pose.orientation.w = 3.0
    assert "quaternion" in planning.ask(bad).message


def test_a_costmap_of_another_resolution_is_planned_on(planning: Planning) -> None:
    fine = floor()
    planning.on(CostField(np.kron(fine.cells, np.ones((2, 2), np.uint8)), 0.025, fine.origin, 1.0))
    done = planning.ask(at(2.5, 1.5, 0.0), np.array([1.0, 1.5, 0.0]))
    assert done.outcome == Result.FOUND, done.message


def test_who_asks_again_is_answered_last_and_the_first_is_told(planning: Planning) -> None:
    planning.on(floor())
    first = planning.stage.ask(PlanCartPath, "/plan_cart_path", PlanCartPath.Goal(goal=at(2.6, 1.0, 0.3)))
    done = planning.ask(at(2.5, 1.5, 0.0))
    assert done.outcome == Result.FOUND
    planning.stage.until(lambda: first)
    assert first[0].outcome in (Result.STOPPED, Result.FOUND)
