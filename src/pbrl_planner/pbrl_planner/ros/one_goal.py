"""An action of which one goal at most is under way; a new one takes its place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node


class OneGoal:
    """Offers an action.

    A goal's callback is run only when there is a result: an rclpy executor runs a coroutine that waits round and round,
    which would take a core for as long as the goal is under way. Until then clients see the goal as accepted.

    Args:
        node: that offers it.
        kind: of action.
        name: of it.
        wanted: is told of a new goal, when the one before has been told that it was replaced.
        cancelled: is told that the goal under way is no longer wanted; ends it soon.
        stopped: makes the result of a goal whose place another takes, from why.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        wanted: Callable[[Any], None],
        cancelled: Callable[[], None],
        stopped: Callable[[str], Any],
    ) -> None:
        self._kind, self._wanted, self._cancelled, self._stopped = kind, wanted, cancelled, stopped
        self._handle: ServerGoalHandle | None = None
        self._server = ActionServer(
            node,
            kind,
            name,
            execute_callback=lambda _: kind.Result(),
            goal_callback=lambda _: GoalResponse.ACCEPT,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
        )

    @property
    def active(self) -> bool:
        """Whether a goal is under way."""
        return self._handle is not None

    def tell(self, feedback: Any) -> None:
        """Give feedback to whoever wants the goal under way, if there is one."""
        if self._handle is not None:
            self._handle.publish_feedback(feedback)

    def end(self, result: Any, success: bool) -> None:
        """End the goal under way, if there is one."""
        handle, self._handle = self._handle, None
        if handle is None:
            return

        def carry_out(ended: ServerGoalHandle) -> Any:
            if success:
                ended.succeed()
            elif ended.is_cancel_requested:
                ended.canceled()
            else:
                ended.abort()
            return result

        handle.execute(carry_out)

    def replaced(self, why: str) -> None:
        """Abort the goal under way, if any: another one that did not come by this action has taken its place."""
        if self._handle is not None:
            self.end(self._stopped(why), False)

    def destroy(self) -> None:
        """Leave the graph."""
        self._server.destroy()

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        self.replaced("another goal was given")
        self._handle = handle
        self._wanted(handle.request)

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        if self._handle is None or handle.goal_id != self._handle.goal_id:
            return CancelResponse.REJECT
        self._cancelled()
        return CancelResponse.ACCEPT
