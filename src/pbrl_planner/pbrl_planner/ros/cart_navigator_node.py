"""Brings robot and cart to a goal: from RViz on /goal_pose, or by the action /navigate_cart; the last one counts.

It asks /plan_cart_path, hands the path to /follow_cart_path, and asks again where something stays in the way, a path
was given up, or there was none: people leave. Meanwhile what is left of the path is gone on with as soon as that is
free. Where there is none for long it goes back along where it came, to make way for whom it may shut in. While it
drives it looks for a better path, from a place ahead on the one that is driven. /cart_navigator/status
(std_msgs/String) says where it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from pbrl_msgs.action import FollowCartPath, NavigateCart, PlanCartPath
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import refuse_unknown
from pbrl_control.planar import Array
from pbrl_control.ros.qos import COMMANDS
from pbrl_planner.cart.ahead import join_ahead, joined
from pbrl_planner.cart.leg import ENDED, Drove, Leg, LegState, Order
from pbrl_planner.cart.query import Outcome
from pbrl_planner.cart.trail import Headway, Trail
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import MAP, path_from_msg, path_to_msg, pose_in_map, pose_to_msg
from pbrl_planner.ros.one_goal import OneGoal
from pbrl_planner.ros.running import declare_settings, run_node
from pbrl_planner.ros.saying import NOTHING_TO_CLEAR, Saying

TICK = 0.1
"""[s] of the node's clock."""
NO_PLANNER = "no action /plan_cart_path; is lattice_planner_node running?"
NO_CONTROLLER = "no action /follow_cart_path; is cart_controller_node running?"
ENDS = {getattr(FollowCartPath.Result, each.name): each for each in Drove}


@dataclass
class _Drive:
    """A path that is driven.

    Attributes:
        poses: (n, 4) of it [m, rad].
        handle: the action's, once it is accepted.
        wanted: whether it still is.
        passed: how many of its poses lie behind.
    """

    poses: Array
    handle: Any = None
    wanted: bool = True
    passed: int = 0

    def stop(self) -> None:
        self.wanted = False
        if self.handle is not None:
            self.handle.cancel_goal_async()


class CartNavigatorNode(Node):
    """One goal at a time."""

    def __init__(self, **options: Any) -> None:
        super().__init__("cart_navigator_node", **options)
        told = declare_settings(self)
        self._settings, self._limits = told.navigation, told.controller.limits
        # A better path is there by then, and what takes it on has a moment more.
        self._lead, self._join = told.planner.time_limit + 1.0, 0
        refuse_unknown(self)
        self._goal: PoseStamped | None = None
        self._leg: Leg | None = None
        self._number = 0
        self._drive: _Drive | None = None
        self._left: Array | None = None
        self._trail, self._headway = Trail(), Headway()
        self._mending = False
        self._epsilon = self._remaining = 0.0
        self._planner = ActionClient(self, PlanCartPath, "plan_cart_path")
        self._driver = ActionClient(self, FollowCartPath, "follow_cart_path")
        self._mend = {
            Order.CLEAR: self.create_client(Trigger, "costmaps/clear"),
            Order.FORGET: self.create_client(Trigger, "costmaps/forget_unseen"),
        }
        self._goals = OneGoal(
            self,
            NavigateCart,
            "navigate_cart",
            lambda request: self._aim(request.goal),
            self._cancel,
            lambda why: NavigateCart.Result(success=False, message=why),
        )
        diagnostics = Diagnostics(self, lambda: self._say.sentence, self._trouble, self._numbers)
        diagnostics.subscribe(PoseStamped, "goal_pose", self._on_goal_pose, COMMANDS, needed=False)
        self.create_timer(TICK, self._tick)
        self._say = Saying(self, "cart_navigator/status", "waiting for a goal on /goal_pose")

    def _trouble(self) -> str:
        if not self._planner.server_is_ready():
            return NO_PLANNER
        return "" if self._driver.server_is_ready() else NO_CONTROLLER

    def _numbers(self) -> dict[str, object]:
        return {"epsilon of the plan": self._epsilon, "remaining [s]": self._remaining}

    def destroy_node(self) -> None:
        """Leave the graph."""
        self._goals.destroy()
        self._planner.destroy()
        self._driver.destroy()
        super().destroy_node()

    # Goals

    def _on_goal_pose(self, message: PoseStamped) -> None:
        self._goals.replaced("another goal was given on /goal_pose")
        self._aim(message)

    def _aim(self, goal: PoseStamped) -> None:
        """Set out for a goal; until there is a path to it the robot stands."""
        self._number += 1
        self._stop()
        self._goal, self._leg = goal, Leg(self._settings, self._now())
        try:
            x, y, heading = pose_in_map(goal, "goal")
        except PlannerError as error:
            self._leg.refuse(str(error))
            self._end()
            return
        self._say(f"goal: {x:.2f} {y:.2f} {heading:.2f}")
        self._tick()

    def _cancel(self) -> None:
        if self._leg is not None:
            self._leg.refuse("cancelled")
            self._end()

    def _end(self) -> None:
        """Stop what is driven, if it is not there, and say how it ended."""
        leg = self._leg
        assert leg is not None
        self._number += 1  # whatever is answered from now on is not wanted any more
        self._stop()
        result = NavigateCart.Result(success=leg.state is LegState.ARRIVED, message=leg.sentence)
        result.plans, result.failures, result.seconds = leg.plans, leg.failures, self._now() - leg.began
        self._say(f"{leg.state}: {leg.sentence}")
        self._goals.end(result, leg.state is LegState.ARRIVED)

    def _stop(self) -> None:
        drive, self._drive = self._drive, None
        if drive is not None:
            drive.stop()

    # What is due

    def _tick(self) -> None:
        leg = self._leg
        if leg is None or leg.state in ENDED:
            return
        self._look_after_others(leg)
        if not self._mending:
            self._do(leg.tick(self._now()))
        self._say(f"{leg.state}: {leg.sentence}")
        feedback = NavigateCart.Feedback(state=str(leg.state), sentence=leg.sentence)
        feedback.plans, feedback.failures = leg.plans, leg.failures
        feedback.epsilon, feedback.remaining = self._epsilon, self._remaining
        self._goals.tell(feedback)

    def _look_after_others(self, leg: Leg) -> None:
        """Go on where whoever was to answer is gone: an answer will not come any more."""
        if leg.asked and not self._planner.server_is_ready():
            self._number += 1
            self._do(leg.planned(self._now(), Outcome.NOT_READY, NO_PLANNER))
        if self._drive is not None and not self._driver.server_is_ready():
            self._drive = None
            self._do(leg.drove(self._now(), Drove.REFUSED, NO_CONTROLLER))
        if self._mending and not any(each.service_is_ready() for each in self._mend.values()):
            self._mending = False

    def _do(self, order: Order, path: Any = None) -> None:
        if order is Order.PLAN:
            self._ask()
        elif order is Order.FOLLOW:
            self._follow(path)
        elif order is Order.REFINE:
            self._ask_ahead()
        elif order is Order.SWITCH:
            self._switch(path)
        elif order is Order.GO_ON:
            self._go_on()
        elif order is Order.BACK:
            self._go_back()
        elif order in self._mend:
            self._mend_costmaps(order)
        elif order is Order.END:
            self._end()

    # The planner

    def _ask_ahead(self) -> None:
        """Ask for a path from a place ahead; where there is none, the one that is driven will do to its end."""
        leg, drive = self._leg, self._drive
        assert leg is not None
        join = None if drive is None else join_ahead(drive.poses, drive.passed, self._lead, self._limits)
        if drive is None or join is None:
            leg.nothing_ahead(self._now())
            return
        self._join = join
        begin = PoseStamped(pose=pose_to_msg(drive.poses[join, :3]))
        begin.header.frame_id = MAP
        self._ask(PlanCartPath.Goal(use_start=True, start=begin, start_articulation=float(drive.poses[join, 3])))

    def _switch(self, path: Any) -> None:
        """Drive on to where the better path begins, and along it from there; if that is not behind by now."""
        if self._drive is None:
            return
        try:
            found = joined(self._drive.poses, self._drive.passed, self._join, path_from_msg(path))
        except PlannerError as error:
            self.get_logger().warning(f"a better path was left aside: {error}")
            return
        if found is not None:
            self._follow(path_to_msg(found, self._now()))

    def _ask(self, question: PlanCartPath.Goal | None = None) -> None:
        assert self._goal is not None and self._leg is not None
        question = question or PlanCartPath.Goal()
        question.goal = self._goal
        if not self._planner.server_is_ready():
            self._do(self._leg.planned(self._now(), Outcome.NOT_READY, NO_PLANNER))
            return
        sent = self._planner.send_goal_async(question, feedback_callback=partial(self._on_better, self._number))
        sent.add_done_callback(partial(self._on_asked, self._number))

    def _on_better(self, number: int, message: Any) -> None:
        if number == self._number:
            self._epsilon = float(message.feedback.epsilon)

    def _on_asked(self, number: int, future: Future) -> None:
        handle = future.result()
        if handle is not None:
            handle.get_result_async().add_done_callback(partial(self._on_planned, number))

    def _on_planned(self, number: int, future: Future) -> None:
        if number != self._number or self._leg is None:
            return
        result = future.result().result
        self._do(self._leg.planned(self._now(), Outcome(result.outcome), result.message), result.path)

    # The controller

    def _follow(self, path: Any) -> None:
        assert self._leg is not None
        if not self._driver.server_is_ready():
            self._do(self._leg.drove(self._now(), Drove.REFUSED, NO_CONTROLLER))
            return
        # Of another path that is driven nothing more is wanted: the controller lets this one take its place.
        try:
            drive = self._drive = _Drive(path_from_msg(path))
        except PlannerError as error:
            self._do(self._leg.drove(self._now(), Drove.REFUSED, f"the planner's path: {error}"))
            return
        sent = self._driver.send_goal_async(
            FollowCartPath.Goal(path=path), feedback_callback=partial(self._on_driving, drive)
        )
        sent.add_done_callback(partial(self._on_followed, drive))

    def _go_on(self) -> None:
        """Drive what is left of the path that was given up: the controller waits until it is free."""
        assert self._left is not None, "called after a drive was given up"
        self._follow(path_to_msg(self._left, self._now()))

    def _go_back(self) -> None:
        """Drive back along what was driven; what is blocked on the old path is not wanted any more."""
        assert self._leg is not None
        poses = self._trail.back(self._settings.way_back)
        if poses is None:
            self._stop()
            self._leg.nothing_behind()
        else:
            self._follow(path_to_msg(poses, self._now()))

    def _on_followed(self, drive: _Drive, future: Future) -> None:
        drive.handle = future.result()
        if drive.handle is None:
            return
        drive.handle.get_result_async().add_done_callback(partial(self._on_drove, drive))
        if not drive.wanted:
            drive.stop()

    def _on_driving(self, drive: _Drive, message: Any) -> None:
        if drive is not self._drive or self._leg is None:
            return
        feedback = message.feedback
        for pose in () if self._leg.backing else drive.poses[drive.passed : int(feedback.passed)]:
            self._trail.at(pose)
            if self._headway.at(pose):
                self._leg.got_on()
        self._remaining, drive.passed = float(feedback.remaining), int(feedback.passed)
        self._do(self._leg.driving(self._now(), float(feedback.blocked), feedback.reason))

    def _on_drove(self, drive: _Drive, future: Future) -> None:
        if drive is not self._drive or self._leg is None:
            return
        self._drive, self._left = None, drive.poses[max(drive.passed - 1, 0) :]
        result = future.result().result
        self._do(self._leg.drove(self._now(), ENDS[result.outcome], result.message))

    def _mend_costmaps(self, order: Order) -> None:
        """Have the costmaps' node do what is ordered; nothing is planned before it has, if it is there."""
        if self._mend[order].service_is_ready():
            self._mending = True
            asked = self._mend[order].call_async(Trigger.Request())
            asked.add_done_callback(partial(self._on_mended, order, self._number))

    def _on_mended(self, order: Order, number: int, future: Future) -> None:
        self._mending = False
        answer = future.result()
        something = answer is not None and answer.success and answer.message != NOTHING_TO_CLEAR
        if order is Order.FORGET and something and number == self._number and self._leg is not None:
            self._leg.forgot(self._now())

    # Small things

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9


def main() -> None:
    """Run the node until it is told to stop."""
    run_node("cart_navigator_node", CartNavigatorNode)


if __name__ == "__main__":
    main()
