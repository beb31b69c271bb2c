"""The navigator between a planner and a controller that this test plays: what it asks of whom, and what it says."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from pbrl_msgs.action import FollowCartPath, NavigateCart, PlanCartPath
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pbrl_control.ros.qos import LATCHED
from pbrl_planner.ros.cart_navigator_node import CartNavigatorNode
from pbrl_planner.ros.conversions import path_to_msg, pose_to_msg
from pbrl_planner.ros.one_goal import OneGoal

Plan, Follow = PlanCartPath.Result, FollowCartPath.Result
PATH = path_to_msg(np.array([[1.0, 1.5, 0.0, 0.0], [2.0, 1.5, 0.0, 0.0]]), 1.0)
LONG = np.column_stack((np.arange(0.0, 10.01, 0.05), np.full((201, 3), [1.5, 0.0, 0.0])))


def goal(x: float = 2.0, frame: str = "map") -> PoseStamped:
    message = PoseStamped(pose=pose_to_msg(np.array([x, 1.5, 0.0])))
    message.header.frame_id = frame
    return message


class Play:
    """The navigator, and both servers."""

    def __init__(self, stage: Any) -> None:
        self.stage, self.asked, self.given, self.cancelled, self.cleared, self.forgotten = stage, [], [], 0, 0, 0
        node = stage.node
        self.serve_plans()
        self.serve_drives()
        node.create_service(Trigger, "/costmaps/clear", self._clear)
        node.create_service(Trigger, "/costmaps/forget_unseen", self._forget)
        self.node = stage.add(CartNavigatorNode)
        self.status = stage.hear(String, "/cart_navigator/status", LATCHED)
        stage.tell_time()
        stage.until(lambda: self.status)

    @staticmethod
    def _replaced(why: str) -> Any:
        return Plan(outcome=Plan.STOPPED, message=why)

    @staticmethod
    def _stopped(why: str) -> Any:
        return Follow(outcome=Follow.STOPPED, message=why)

    def _cancel(self) -> None:
        self.cancelled += 1

    def _clear(self, _: Any, response: Any) -> Any:
        self.cleared += 1
        response.success = True
        return response

    def _forget(self, _: Any, response: Any) -> Any:
        self.forgotten += 1
        return response

    def until(self, condition: Callable[[], Any]) -> None:
        """Let the clock go on until a condition holds."""

        def tick() -> Any:
            if self.node.get_clock().now().nanoseconds * 1e-9 > self.stage.time - 0.01:  # heard of the last tick
                self.stage.time += 0.05
                self.stage.tell_time()
            return condition()

        self.stage.until(tick)

    def later(self, seconds: float) -> None:
        """Let a time pass at once [s]."""
        self.stage.time += seconds
        self.stage.tell_time()
        self.stage.until(lambda: self.node.get_clock().now().nanoseconds * 1e-9 > self.stage.time - 0.01)

    def says(self, word: str) -> None:
        self.until(lambda: any(word in each.data for each in self.status))

    def answer(self, outcome: int, message: str = "", count: int = 1, poses: Any = None) -> None:
        """Answer the planner's question number `count`."""
        self.until(lambda: len(self.asked) >= count)
        path = PATH if outcome == Plan.FOUND else type(PATH)()
        path = path if poses is None else path_to_msg(poses, 1.0)
        self.planner.end(Plan(outcome=outcome, message=message, path=path), outcome == Plan.FOUND)

    def driving(self, **fields: Any) -> None:
        self.driver.tell(FollowCartPath.Feedback(**fields))

    def ended(self, outcome: int, message: str = "") -> None:
        self.driver.end(Follow(outcome=outcome, message=message), outcome == Follow.ARRIVED)

    def serve_plans(self) -> None:
        node = self.stage.node
        self.planner = OneGoal(node, PlanCartPath, "/plan_cart_path", self.asked.append, lambda: None, self._replaced)

    def serve_drives(self) -> None:
        node = self.stage.node
        self.driver = OneGoal(node, FollowCartPath, "/follow_cart_path", self.given.append, self._cancel, self._stopped)

    def close(self) -> None:
        self.planner.destroy()
        self.driver.destroy()


@pytest.fixture
def play(stage: Any) -> Any:
    made = Play(stage)
    yield made
    made.close()


def test_a_goal_from_rviz_is_planned_driven_and_reached(play: Play) -> None:
    play.stage.send("/goal_pose", goal())
    play.answer(Plan.FOUND)
    play.until(lambda: play.given)
    assert play.asked[0].goal.pose.position.x == 2.0 and len(play.given[0].path.path.poses) == 2
    play.says("driving")
    play.ended(Follow.ARRIVED)
    play.says("arrived: at the goal")
    assert len(play.asked) == 1 and play.cancelled == 0


def test_the_action_tells_how_it_goes_and_how_it_ended(play: Play) -> None:
    told: list = []
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal()), told.append)
    play.answer(Plan.NO_PATH, "no path: somebody stands in the door")
    play.says("waiting: no path: somebody stands in the door")
    play.answer(Plan.FOUND, count=2)
    assert play.forgotten == 1, "what nobody saw of late is not in the second answer"
    play.until(lambda: play.given)
    play.driving(status="on the way", remaining=3.0)
    play.until(lambda: told and told[-1].remaining == 3.0)
    assert told[-1].state == "driving" and (told[-1].plans, told[-1].failures) == (2, 1)
    play.ended(Follow.ARRIVED)
    play.until(lambda: results)
    assert results[0].success and (results[0].plans, results[0].failures) == (2, 1) and results[0].seconds > 1.9


def test_who_stands_before_something_looks_for_a_way_round(play: Play) -> None:
    play.stage.send("/goal_pose", goal())
    play.answer(Plan.FOUND)
    play.until(lambda: play.given)
    for _ in range(30):
        play.later(0.1)
        play.driving(blocked=1.0, reason="something is in the way")
    play.says("something is in the way")
    assert len(play.asked) == 1, "not yet"
    play.driving(blocked=2.5)
    play.until(lambda: len(play.asked) == 2)
    play.answer(Plan.FOUND, count=2)
    play.until(lambda: len(play.given) == 2)
    play.ended(Follow.ARRIVED)
    play.says("arrived")


def under_way(play: Play, condition: Callable[[], Any], passed: int, blocked: float = 0.0) -> None:
    """Drive on until a condition holds, and tell how many poses lie behind, and for how long it has stood [s]."""

    told = [0.0]

    def drive() -> Any:
        if play.stage.time > told[0] + 0.2:  # more than that would only be in the way of the clock
            told[0] = play.stage.time
            play.driving(status="on the way", passed=passed, blocked=blocked, reason="something is in the way")
        return condition()

    play.until(drive)


def after(play: Play, seconds: float) -> Callable[[], bool]:
    end = play.stage.time + seconds
    return lambda: play.stage.time > end


def test_on_the_way_a_better_path_is_taken_on_from_a_place_ahead(play: Play) -> None:
    play.stage.send("/goal_pose", goal(10.0))
    play.answer(Plan.FOUND, poses=LONG)
    play.until(lambda: play.given)
    under_way(play, lambda: len(play.asked) == 2, 41)
    begin = play.asked[1].start.pose.position
    assert play.asked[1].use_start and begin.x > LONG[40, 0] + 5.0 * 0.35, "nobody is there before it is planned"
    assert play.asked[1].goal.pose.position.x == 10.0
    round_it = np.array([[begin.x, 1.5, 0.0, 0.0], [begin.x + 1.0, 2.0, 0.0, 0.0], [10.0, 1.5, 0.0, 0.0]])
    play.answer(Plan.FOUND, count=2, poses=round_it)
    play.until(lambda: len(play.given) == 2)
    told = [each.pose.position for each in play.given[1].path.path.poses]
    assert told[0].x == pytest.approx(LONG[40, 0]) and (told[-2].y, told[-1].x) == (2.0, 10.0)
    assert max(b.x - a.x for a, b in pairwise(told[:-2])) < 0.06, "without a gap"
    play.ended(Follow.ARRIVED)
    play.says("arrived")


def test_a_better_path_that_comes_too_late_or_is_the_same_changes_nothing(play: Play) -> None:
    play.stage.send("/goal_pose", goal(10.0))
    play.answer(Plan.FOUND, poses=LONG)
    play.until(lambda: play.given)
    under_way(play, lambda: len(play.asked) == 2, 11)
    begin = play.asked[1].start.pose.position.x
    play.answer(Plan.FOUND, count=2, poses=LONG[LONG[:, 0] >= begin - 1e-6])
    under_way(play, lambda: len(play.asked) == 3, 21)
    under_way(play, after(play, 1.0), 190)
    play.answer(Plan.FOUND, count=3, poses=np.array([[begin, 1.5, 0.0, 0.0], [10.0, 2.5, 0.0, 0.0]]))
    under_way(play, after(play, 17.0), 195)
    play.ended(Follow.ARRIVED)
    play.says("arrived")
    assert len(play.given) == 1 and len(play.asked) == 3, "near the end nothing is asked"


def test_without_a_path_for_long_it_goes_back_along_where_it_came_waits_and_asks_again(play: Play) -> None:
    play.stage.send("/goal_pose", goal(10.0))
    play.answer(Plan.FOUND, poses=LONG)
    play.until(lambda: play.given)
    under_way(play, after(play, 1.0), 101)
    question = 1
    while not any("going back to make way" in each.data for each in play.status):
        question += 1
        said = len(play.status)
        under_way(play, lambda question=question: len(play.asked) >= question, 101, 5.0)
        play.answer(Plan.GOAL_OCCUPIED, f"somebody stands at the goal, {question}", count=question)
        play.until(lambda said=said: any("at the goal" in each.data for each in play.status[said:]))
    play.until(lambda: len(play.given) == 2)
    back = np.array([each.pose.position.x for each in play.given[1].path.path.poses])
    assert back[0] == pytest.approx(LONG[100, 0]) and back[0] - back[-1] == pytest.approx(2.5, abs=0.06)
    assert (np.diff(back) < 0.0).all()
    under_way(play, after(play, 0.5), len(back))
    play.ended(Follow.ARRIVED)
    play.says("waiting for who wants to get by")
    play.later(8.1)
    while len(play.given) == 2:
        question += 1
        play.until(lambda question=question: len(play.asked) >= question)
        play.answer(Plan.NO_PATH, "still shut", count=question)
        play.until(lambda question=question: len(play.asked) > question or len(play.given) == 3)
    further = np.array([each.pose.position.x for each in play.given[2].path.path.poses])
    assert further[0] == pytest.approx(back[-1], abs=0.06) and (np.diff(further) < 0.0).all(), "not forth again"
    play.ended(Follow.ARRIVED)
    play.later(8.1)
    play.answer(Plan.FOUND, count=question + 1)
    play.until(lambda: len(play.given) == 4)


def test_while_there_is_no_other_path_what_is_left_of_it_is_gone_on_with(play: Play) -> None:
    play.stage.send("/goal_pose", goal(10.0))
    play.answer(Plan.FOUND, poses=LONG)
    play.until(lambda: play.given)
    under_way(play, after(play, 1.0), 101)
    play.ended(Follow.REPLAN, "somebody is in the way")
    play.answer(Plan.NO_PATH, count=2)
    play.until(lambda: len(play.given) == 2)
    left = [each.pose.position.x for each in play.given[1].path.path.poses]
    assert left == pytest.approx(LONG[100:, 0].tolist()) and play.cleared == 1
    play.ended(Follow.ARRIVED)
    play.says("arrived")


def test_a_path_that_is_given_up_is_planned_again_on_cleared_costmaps(play: Play) -> None:
    play.stage.send("/goal_pose", goal())
    play.answer(Plan.FOUND)
    play.until(lambda: play.given)
    play.ended(Follow.REPLAN, "plan: too far off")
    play.answer(Plan.FOUND, count=2)
    play.until(lambda: len(play.given) == 2)
    assert play.cleared == 1


@pytest.mark.parametrize(
    ("outcome", "message"), [(Follow.GRIP_LOST, "the right one has lost it"), (Follow.REFUSED, "no path at all")]
)
def test_what_nobody_can_go_on_from_is_said(play: Play, outcome: int, message: str) -> None:
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal()))
    play.answer(Plan.FOUND)
    play.until(lambda: play.given)
    play.ended(outcome, message)
    play.until(lambda: results)
    assert not results[0].success and message in results[0].message
    play.says(message)


def test_a_goal_off_the_map_or_in_another_frame_is_refused(play: Play) -> None:
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal(90.0)))
    play.answer(Plan.GOAL_OFF_MAP, "goal: expected it on the map")
    play.until(lambda: results)
    assert not results[0].success and "on the map" in results[0].message
    play.stage.send("/goal_pose", goal(frame="odom"))
    play.says("got 'odom'")
    assert len(play.asked) == 1


def test_a_new_goal_stops_the_drive_and_takes_its_place(play: Play) -> None:
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal()))
    play.answer(Plan.FOUND)
    play.until(lambda: play.given)
    play.says("driving")
    play.stage.send("/goal_pose", goal(1.5))
    play.until(lambda: results and play.cancelled)
    assert not results[0].success and "/goal_pose" in results[0].message
    play.ended(Follow.STOPPED, "cancelled")
    play.answer(Plan.FOUND, count=2)
    play.until(lambda: len(play.given) == 2)
    assert play.asked[1].goal.pose.position.x == 1.5
    play.ended(Follow.ARRIVED)
    play.says("arrived")


def test_without_a_path_for_too_long_it_gives_up(play: Play) -> None:
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal()))
    for count in range(1, 100):
        play.until(lambda count=count: len(play.asked) >= count or results)
        if results:
            break
        play.answer(Plan.UNDECIDED, "neither", count=count)
        play.later(10.0)
    assert not results[0].success and "no path for" in results[0].message and "neither" in results[0].message


def test_a_planner_or_controller_that_is_gone_is_named(play: Play) -> None:
    results = play.stage.ask(NavigateCart, "/navigate_cart", NavigateCart.Goal(goal=goal()))
    play.until(lambda: play.asked)
    play.planner.destroy()
    play.says("is lattice_planner_node running?")
    play.serve_plans()
    play.answer(Plan.FOUND, count=2)
    play.until(lambda: play.given)
    play.driver.destroy()
    play.until(lambda: results)
    play.serve_drives()
    assert not results[0].success and "is cart_controller_node running?" in results[0].message
