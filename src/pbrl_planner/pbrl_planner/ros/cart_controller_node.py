"""The cart's local controller as a node: the action /follow_cart_path; /cmd_vel and both arms' velocities out.

It ticks 20 times a second of the node's clock, on the newest /local_costmap/costmap, and commands only while there is a
path. When the laser is silent the costmap gets old; when it is, or any other stream, robot and cart stand within
`stop_within` of its last message; before what is in the way they stand, too, and after `patience` the path is given up,
so that it can be planned again. When a hand loses the cart everything stops, and the result says so.
/cart_controller/status says what it is at.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid
from pbrl_msgs.action import FollowCartPath
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import refuse_unknown
from pbrl_control.cart import (
    CartCommand,
    CartController,
    CartPercept,
    CartPlan,
    DriveStatus,
    compile_kernels,
)
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_control.pr2_arms import Pr2Arms
from pbrl_control.ros.conversions import arm_to_msg, seconds
from pbrl_control.ros.qos import COMMANDS, LATCHED, NEWEST
from pbrl_planner.cart.leg import ENDS, Drove
from pbrl_planner.cart.tracker import CartTracker, grip_offset, up_to
from pbrl_planner.costmap import CostField
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import field_from_msg, path_from_msg
from pbrl_planner.ros.hearing import SAID, Hearing
from pbrl_planner.ros.one_goal import OneGoal
from pbrl_planner.ros.running import declare_settings, run_node
from pbrl_planner.ros.saying import Saying

SIDES = ("left", "right")
OUTCOMES = {each: getattr(FollowCartPath.Result, each.name) for each in Drove}


class CartControllerNode(Node):
    """Drives robot and cart along paths.

    Attributes:
        tracker: what is known of where they are.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("cart_controller_node", **options)
        self._settings = declare_settings(self).controller
        refuse_unknown(self)
        compile_kernels(self._settings)  # before anybody can see this node: who sees it may count on its ticks
        self.tracker = CartTracker()
        diagnostics = Diagnostics(self, lambda: self._say.sentence)
        self._hearing = Hearing(self, diagnostics, self.tracker, self._take_hands_anew)
        self._arms: Pr2Arms | None = None
        self._joints: JointState | None = None
        self._costs: CostField | None = None
        self._plan: CartPlan | None = None
        self._controller: CartController | None = None
        self._took: float | None = None
        """How far apart the hands were when both took hold [m]; None: they do not hold one thing."""
        self._sent = np.zeros(4)
        self._blocked: float | None = None
        self._since: float | None = None
        self._cancelled = False
        self._at = 0.0
        self._create_outputs()
        diagnostics.subscribe(String, "robot_description", self._on_description, LATCHED)
        diagnostics.subscribe(JointState, "joint_states", self._on_joints, NEWEST)
        diagnostics.subscribe(OccupancyGrid, "local_costmap/costmap", self._on_costmap, LATCHED)
        self.create_timer(self._settings.period, self._tick)

    def _create_outputs(self) -> None:
        self._base = self.create_publisher(Twist, "cmd_vel", COMMANDS)
        self._out = {
            side: self.create_publisher(Float64MultiArray, f"{side}_arm_velocity_controller/commands", COMMANDS)
            for side in SIDES
        }
        self._goals = OneGoal(
            self,
            FollowCartPath,
            "follow_cart_path",
            self._want,
            self._cancel,
            lambda why: FollowCartPath.Result(outcome=FollowCartPath.Result.STOPPED, message=why),
        )
        self._say = Saying(self, "cart_controller/status", "no path yet")

    def destroy_node(self) -> None:
        """Stand, and leave the graph."""
        if self._controller is not None:
            self._stand()
        self._goals.destroy()
        super().destroy_node()

    # What comes in

    def _on_description(self, message: String) -> None:
        try:
            self._arms = Pr2Arms(message.data)
        except ControlError as error:
            self.get_logger().error(str(error))

    def _on_joints(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            what = f"expected a position a name, {len(message.name)}, got {len(message.position)}"
            self.get_logger().warning(f"/joint_states is left aside: {what}", throttle_duration_sec=SAID)
            return
        self._joints = message

    def _on_costmap(self, message: OccupancyGrid) -> None:
        try:
            self._costs = field_from_msg(message)
        except PlannerError as error:
            self.get_logger().warning(f"/local_costmap/costmap is left aside: {error}", throttle_duration_sec=SAID)

    def _want(self, goal: FollowCartPath.Goal) -> None:
        """Drive along a path from now on; what is commanded now goes on without a jump."""
        self._cancelled = False
        try:
            poses = path_from_msg(goal.path)
            low, high = self._settings.limits.articulation
            poses[:, 3] = np.clip(poses[:, 3], low, high)
            self._plan = CartPlan.timed(poses, self._settings.limits, self._settings.share, self._sent)
        except (PlannerError, ControlError) as error:
            self._end(Drove.REFUSED, f"path: {error}")
            return
        self._controller = self._blocked = self._since = None
        self._at = 0.0

    def _cancel(self) -> None:
        self._cancelled = True

    # Ticks

    def _tick(self) -> None:
        misfit = self._misfit()
        clock = self.get_clock().now().nanoseconds * 1e-9
        if self._plan is None or clock == 0.0:  # zero: a simulated clock that nobody has set yet
            return
        if self._cancelled:
            self._end(Drove.STOPPED, "cancelled")
            return
        now = self.tracker.now(clock)
        try:
            percept = self._percept(now, misfit)
            if percept is None or self.tracker.body is None:
                self._wait(now)
                return
            if self._controller is None:
                self._controller = CartController(self._plan, self.tracker.body, self._settings, self._sent)
            command = self._controller.step(now, percept)
        except ControlError as error:
            self._end(Drove.REFUSED, str(error))
            return
        self._send(command)
        self._heed(now, command)

    def _misfit(self) -> float:
        """Return by how much the hands are not as far apart as when both took hold [m]; NaN: cannot be told."""
        held = self.tracker.held
        if len(held) < len(SIDES) or len(set(held.values())) > 1:
            self._took = None
        elif self._arms is not None and self._joints is not None:
            try:
                apart = self._arms.apart(self._joints.name, self._joints.position)
            except ControlError:
                return math.nan  # the drive says so, if there is one
            self._took = apart if self._took is None else self._took
            return apart - self._took
        return math.nan

    def _take_hands_anew(self) -> None:
        self._took = None

    def _percept(self, now: float, misfit: float) -> CartPercept | None:
        """Return what the controller is given; None: something has never come yet."""
        tracker, pose, costs = self.tracker, self.tracker.pose(now), self._costs
        seen = tracker.sight(now) or tracker.last_sight()
        if pose is None or seen is None or costs is None or self._arms is None or self._joints is None:
            return None
        return CartPercept(
            pose,
            tracker.pose_time(now),
            seen.articulation,
            0.0,
            seen.time,
            costs.time,
            costs,
            ("left" in tracker.held, "right" in tracker.held),
            misfit,
            grip_offset(seen),
            self._arms.state(self._joints.name, self._joints.position),
            up_to(now, seconds(self._joints.header.stamp)),
        )

    def _wait(self, now: float) -> None:
        """Stand until what has never come is there; give up when it lasts too long."""
        missing = self.tracker.missing
        for what, there in (
            ("a costmap on /local_costmap/costmap", self._costs is not None),
            ("/robot_description", self._arms is not None),
            ("/joint_states", self._joints is not None),
        ):
            missing = missing or ("" if there else what)
        self._since = now if self._since is None else self._since
        self._stand()
        self._say(f"waiting for {missing or 'a pose'}")
        if now - self._since > self._settings.patience:
            self._end(Drove.REFUSED, f"expected {missing or 'a pose'}, nothing came for {now - self._since:.0f} s")

    def _send(self, command: CartCommand) -> None:
        self._sent = np.append(command.twist, command.articulation_rate)
        self._base.publish(_twist(command.twist))
        if command.joint_rates is not None:
            for side, rates in zip(SIDES, command.joint_rates, strict=True):
                self._out[side].publish(arm_to_msg(rates))

    def _stand(self) -> None:
        self._sent = np.zeros(4)
        self._base.publish(Twist())
        for side in SIDES:
            self._out[side].publish(arm_to_msg(np.zeros(7)))

    def _heed(self, now: float, command: CartCommand) -> None:
        """Tell what the controller is at, and end where it has."""
        if command.status is not DriveStatus.BLOCKED:
            self._blocked = None
        elif self._blocked is None:
            self._blocked = now
        moving = command.status is DriveStatus.MOVING  # what slows it changes all the time: that is feedback's
        self._say(str(command.status) if moving or not command.reason else f"{command.status}: {command.reason}")
        ended = ENDS.get(command.status)
        # It brakes before it ends: only at rest is there nothing more to send.
        if ended is not None and not np.abs(self._sent).max() > 0.0:
            self._end(ended, command.reason or str(command.status))
            return
        self._goals.tell(self._feedback(now, command))

    def _feedback(self, now: float, command: CartCommand) -> FollowCartPath.Feedback:
        assert self._plan is not None, "called under way"
        error, remaining = np.where(np.isfinite(command.error), command.error, 0.0), self._remaining(command.goal)
        return FollowCartPath.Feedback(
            status=str(command.status),
            reason=command.reason,
            pace=float(command.pace),
            blocked=0.0 if self._blocked is None else now - self._blocked,
            remaining=remaining,
            passed=int(np.searchsorted(self._plan.reached, self._at, side="right")),
            position_error=math.hypot(*error[:2]),
            angle_error=float(np.abs(error[2:]).max()),
        )

    def _remaining(self, aim: Array) -> float:
        """Return how much of the path is left [s], given where on it the controller aims now."""
        assert self._plan is not None, "called under way"
        self._at = self._plan.nearest(aim, self._at - 0.1, self._at + 0.3, self._settings.limits.speeds)
        return self._plan.duration - self._at

    def _end(self, ended: Drove, message: str) -> None:
        """Stand, and say how it ended."""
        self._plan = self._controller = None
        self._stand()
        self._say(f"{ended}: {message}" if ended is not Drove.ARRIVED else str(ended))
        self._goals.end(FollowCartPath.Result(outcome=OUTCOMES[ended], message=message), ended is Drove.ARRIVED)


def _twist(rates: Array) -> Twist:
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = map(float, rates)
    return message


def main() -> None:
    """Run the node until it is told to stop."""
    run_node("cart_controller_node", CartControllerNode)


if __name__ == "__main__":
    main()
