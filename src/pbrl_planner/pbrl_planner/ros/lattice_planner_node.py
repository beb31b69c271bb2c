"""The lattice planner as a node: the action /plan_cart_path on the newest /global_costmap/costmap (thesis 4.5).

Feedback is each better path's cost and how far from the least it can be; the result says whether a path was found,
proved not to be there, or why none could be looked for. /plan (nav_msgs/Path) and /markers show the path, and what
robot and cart sweep along it. It is planned in a thread; a goal whose place another takes ends with the next better
path, or when its time is over.
"""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMsg
from pbrl_msgs.action import PlanCartPath
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_control.planar import Array
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_planner.cart.navigator import Navigator
from pbrl_planner.cart.outline import motions
from pbrl_planner.cart.query import Outcome, Reply, ask
from pbrl_planner.cart.tracker import CartTracker
from pbrl_planner.costmap import CostField
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import LatticePlan, Motions
from pbrl_planner.ros.conversions import field_from_msg, path_to_msg, pose_in_map
from pbrl_planner.ros.hearing import Hearing
from pbrl_planner.ros.markers import swept
from pbrl_planner.ros.one_goal import OneGoal
from pbrl_planner.ros.running import declare_settings, run_node

LOOKS = 50.0
"""Of the thread's news, a second of the steady clock, while it is planned."""


class LatticePlannerNode(Node):
    """Plans paths of robot and cart.

    Attributes:
        tracker: what is known of where they are.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("lattice_planner_node", **options)
        self._settings = declare_settings(self)
        text = "cells of 5 cm and half the headings: sooner there, through wider doors only"
        self._coarse: bool = declare(self, "coarse", False, text)
        refuse_unknown(self)
        self.tracker = CartTracker()
        diagnostics = Diagnostics(self, lambda: self._last, numbers=lambda: {"plans": self._plans})
        self._hearing = Hearing(self, diagnostics, self.tracker)
        self._field: CostField | None = None
        self._thread = ThreadPoolExecutor(1)
        self._work: Future[Reply] | None = None
        self._waiting: PlanCartPath.Goal | None = None
        self._news: SimpleQueue[LatticePlan] = SimpleQueue()
        self._unwanted = False
        self._asked = 0.0
        self._last, self._plans = "waits for a goal on /plan_cart_path", 0
        self._plan_out = self.create_publisher(PathMsg, "plan", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "markers", COMMANDS)
        diagnostics.subscribe(OccupancyGrid, "global_costmap/costmap", self._on_costmap, LATCHED)
        self._prepared: Future[object] | None = None
        self._looks = self.create_timer(1.0 / LOOKS, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._looks.cancel()
        self._goals = OneGoal(
            self,
            PlanCartPath,
            "plan_cart_path",
            self._want,
            self._cancel,
            lambda why: PlanCartPath.Result(outcome=PlanCartPath.Result.STOPPED, message=why),
        )

    @property
    def thinking(self) -> bool:
        """Whether it is planned, or prepared for that: the thread cannot be stopped at once."""
        return any(each is not None and not each.done() for each in (self._work, self._prepared))

    def destroy_node(self) -> None:
        """Leave the graph; a thread that plans is left to itself."""
        self._unwanted = True
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._goals.destroy()
        super().destroy_node()

    def _on_costmap(self, message: OccupancyGrid) -> None:
        try:
            self._field = field_from_msg(message)
        except PlannerError as error:
            self.get_logger().error(f"/global_costmap/costmap is left aside: {error}", throttle_duration_sec=5.0)
        cart = self.tracker.cart
        # What every plan needs takes seconds: not in the first one.
        if cart is not None and self._field is not None and self._prepared is None:
            self._prepared = self._thread.submit(self._prepare, cart, self._field)
            self._prepared.add_done_callback(self._complain)

    def _want(self, goal: PlanCartPath.Goal) -> None:
        """Plan for a goal, once the thread is done with the one before."""
        self._waiting, self._unwanted = goal, True
        self._looks.reset()
        self._look()

    def _cancel(self) -> None:
        self._waiting, self._unwanted = None, True
        self._looks.reset()

    def _begin(self, goal: PlanCartPath.Goal) -> None:
        self._asked, self._unwanted = time.monotonic(), False
        now = self.tracker.now(self.get_clock().now().nanoseconds * 1e-9)
        try:
            aim, begin = pose_in_map(goal.goal, "goal"), self._start(goal, now)
        except PlannerError as error:
            self._end(Reply(Outcome.NOT_READY, str(error)))
            return
        field, cart = self._field, self.tracker.cart
        missing = "a costmap on /global_costmap/costmap" if field is None else self.tracker.missing
        if field is None or cart is None or begin is None:
            self._end(Reply(Outcome.NOT_READY, f"not ready: still waiting for {missing or 'a fresh pose of the cart'}"))
            return
        self._work = self._thread.submit(self._plan, now, field, cart, begin, aim)

    def _start(self, goal: PlanCartPath.Goal, now: float) -> Array | None:
        """Return where to plan from (4,), as asked or where robot and cart are; None: not known."""
        if not goal.use_start:
            return self.tracker.state(now)
        return np.append(pose_in_map(goal.start, "start"), float(goal.start_articulation))

    def _plan(self, now: float, field: CostField, cart: Array, begin: Array, aim: Array) -> Reply:
        navigator = Navigator(self._motions(cart), self._settings.planner)

        def improved(each: LatticePlan) -> bool:
            self._news.put(each)
            return self._unwanted

        return ask(navigator, now, field, begin, aim, improved)

    def _prepare(self, cart: Array, field: CostField) -> None:
        Navigator(self._motions(cart), self._settings.planner).prepare(field)

    def _complain(self, prepared: Future[object]) -> None:
        if not prepared.cancelled() and (error := prepared.exception()) is not None:
            self.get_logger().error(f"preparing to plan failed: {error!r}")

    def _motions(self, cart: Array) -> Motions:
        length, width = np.ptp(cart, axis=0)
        return motions(float(length), float(width), self._coarse)

    def _look(self) -> None:
        """Tell what the thread has found; begin with what waits for it."""
        while not self._news.empty():
            self._tell(self._news.get())
        if self._work is not None:
            if not self._work.done():
                return
            work, self._work = self._work, None
            error = work.exception()
            if error is not None:
                self.get_logger().error(f"planning failed: {error!r}")
            if self._waiting is None:
                self._end(Reply(Outcome.NOT_READY, f"planning failed: {error}") if error else work.result())
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._begin(waiting)
        elif self._work is None:
            if self._unwanted:
                self._end(Reply(Outcome.STOPPED, "cancelled"))
            self._looks.cancel()

    def _tell(self, plan: LatticePlan) -> None:
        if self._unwanted:
            return
        feedback = PlanCartPath.Feedback(epsilon=float(plan.epsilon), cost=plan.cost / 1000.0)
        feedback.expansions, feedback.seconds = plan.expansions, float(plan.seconds)
        self._goals.tell(feedback)

    def _end(self, reply: Reply) -> None:
        if not self._goals.active:
            return
        if self._unwanted:
            reply = Reply(Outcome.STOPPED, "cancelled")
        spent = time.monotonic() - self._asked
        result = PlanCartPath.Result(outcome=reply.outcome.value, message=reply.message, seconds=spent)
        if reply.plan is not None:
            now = self.get_clock().now().nanoseconds * 1e-9
            result.path = path_to_msg(reply.poses, now)
            result.epsilon, result.cost = float(reply.plan.epsilon), reply.plan.cost / 1000.0
            result.expansions = reply.plan.expansions
            self._plan_out.publish(result.path.path)
            if self.tracker.body is not None:
                self._markers.publish(swept(self.tracker.body, reply.poses, result.path.path.header.stamp))
        self._last = f"{reply.outcome.name.lower().replace('_', ' ')} after {spent:.2f} s: {reply.message}"
        self._plans += reply.plan is not None
        self.get_logger().info(self._last)
        self._goals.end(result, reply.outcome is Outcome.FOUND)


def main() -> None:
    """Run the node until it is told to stop."""
    run_node(
        "lattice_planner_node", LatticePlannerNode, lambda node: isinstance(node, LatticePlannerNode) and node.thinking
    )


if __name__ == "__main__":
    main()
