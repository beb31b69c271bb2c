"""The action `/reach_goal`: at most one goal is under way, a new one takes its place."""

from __future__ import annotations

from collections.abc import Callable

from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus as NamoStatusMsg
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.ros.conversions import goal_from_pose2d


class GoalServer:
    """Offers the action.

    A goal's callback is run only when there is a result: an rclpy executor runs a coroutine that waits round and round,
    which would take a core for as long as the robot is under way. Until then clients see the goal as accepted.

    Args:
        node: that offers it.
        wanted: is told of a new goal (3,) [m, rad] and its seed.
        cancelled: is told that the goal under way is no longer wanted.
    """

    def __init__(self, node: Node, wanted: Callable[[Array, int], None], cancelled: Callable[[], None]) -> None:
        self._node, self._wanted, self._cancelled = node, wanted, cancelled
        self._handle: ServerGoalHandle | None = None
        self._status = NamoStatusMsg()
        self._server = ActionServer(
            node,
            ReachGoal,
            "reach_goal",
            execute_callback=lambda _: ReachGoal.Result(),
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
        )

    def tell(self, status: NamoStatusMsg) -> None:
        """Give feedback; and the result, where the executive has ended."""
        self._status = status
        if self._handle is None:
            return
        self._handle.publish_feedback(ReachGoal.Feedback(status=status))
        if status.finished:
            self._end(status.success, status.sentence)

    def replaced(self, why: str) -> None:
        """Abort the goal under way, if any: another one that did not come by this action has taken its place."""
        if self._handle is not None:
            self._end(False, why)

    def destroy(self) -> None:
        """Leave the graph."""
        self._server.destroy()

    def _on_goal(self, request: ReachGoal.Goal) -> GoalResponse:
        try:
            goal_from_pose2d(request.goal)
        except NamoError as error:
            self._node.get_logger().error(f"refused: {error}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        self.replaced("another goal was given")
        self._handle = handle
        self._wanted(goal_from_pose2d(handle.request.goal), int(handle.request.seed))

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        if self._handle is None or handle.goal_id != self._handle.goal_id:
            return CancelResponse.REJECT
        self._cancelled()
        return CancelResponse.ACCEPT

    def _end(self, success: bool, message: str) -> None:
        handle, self._handle = self._handle, None
        assert handle is not None
        result = ReachGoal.Result(success=success, message=message, status=self._status)

        def carry_out(ended: ServerGoalHandle) -> ReachGoal.Result:
            if success:
                ended.succeed()
            elif ended.is_cancel_requested and self._status.state != "Failed":
                ended.canceled()
            else:
                ended.abort()
            return result

        handle.execute(carry_out)
