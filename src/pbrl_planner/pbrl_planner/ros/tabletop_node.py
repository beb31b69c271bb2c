"""Tidies a table with one arm: the action /tidy, with an objective as a file or as text.

It hears `/scene`, `/robot_description`, `/tf_static`, `/joint_states` and the camera's pictures (or, with `camera:=""`,
`/ar_tags/<item>/pose`), and moves the arm on `/ball_arm_position_controller/commands`. What pushes do is learned first
where it is not known, and all along; `/tabletop/status` (std_msgs/String) says what is being done, `/markers` shows the
plan.
"""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from pbrl_msgs.action import Tidy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_control.planar import Array
from pbrl_control.ros.qos import COMMANDS
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.desk_hearing import DeskHearing
from pbrl_planner.ros.desk_markers import planned
from pbrl_planner.ros.one_goal import OneGoal
from pbrl_planner.ros.running import run_node
from pbrl_planner.ros.saying import Saying
from pbrl_planner.tabletop import (
    FORWARD_MODELS,
    Desk,
    DeskExecutive,
    Ended,
    Ending,
    Knowledge,
    NextPush,
    Objective,
    State,
    TabletopSettings,
    Task,
    Teaching,
    Tidying,
    TidyingSettings,
)

TICK = 0.01
"""[s] of the node's clock."""
OUTPUT = "ball_arm_position_controller/commands"


@dataclass
class _Goal:
    """What is wanted, and what was done for it."""

    objective: Objective
    enough: float
    seed: int
    taught: int = 0


class TabletopNode(Node):
    """One goal at a time.

    Raises:
        BagError: a wrong parameter.
        PlannerError: a file of models that is none.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("tabletop_node", **options)
        camera = declare(self, "camera", "overhead_0", "overhead camera; empty: poses on /ar_tags/<item>/pose")
        kind = declare(self, "forward_model", "tables", "what pushes do is known as", choices=FORWARD_MODELS)
        model = declare(self, "model", "", "JSON of what pushes do; read at the start, written when it was learned")
        self._think = declare(self, "think", 2.0, "time for a plan [s]", (0.05, 600.0))
        refuse_unknown(self)
        self._planning = TabletopSettings()
        self._known = Knowledge(kind, self._planning.travels, file=Path(model) if model else None)
        self._goal: _Goal | None = None
        self._thought: Future[NextPush | Ended] | None = None
        self._newest: Future[NextPush | Ended] | None = None  # that the thinker was given, wanted still or not
        self._thinker = ThreadPoolExecutor(1)
        self._executive: DeskExecutive | None = None
        diagnostics = Diagnostics(self, lambda: self._say.sentence)
        self._hearing = DeskHearing(self, diagnostics, camera, self._on_look)
        self._arm = self.create_publisher(Float64MultiArray, OUTPUT, COMMANDS)
        self._drawing = self.create_publisher(MarkerArray, "markers", COMMANDS)
        self._goals = OneGoal(
            self, Tidy, "tidy", self._on_goal, self._cancel, lambda why: Tidy.Result(message=why, cost=math.nan)
        )
        self.create_timer(TICK, self._tick)
        self._say = Saying(self, "tabletop/status", "waits for a goal on /tidy")

    @property
    def thinking(self) -> bool:
        """Whether a search is under way that cannot be stopped."""
        return self._newest is not None and not self._newest.done()

    def destroy_node(self) -> None:
        """Leave the graph."""
        self._thinker.shutdown(wait=False, cancel_futures=True)
        self._goals.destroy()
        super().destroy_node()

    # Goals

    def _on_goal(self, request: Tidy.Goal) -> None:
        try:
            missing = self._hearing.missing()
            if missing:
                raise PlannerError(f"expected to have heard {missing}; is the simulator, or the robot, running?")
            desk = self._hearing.desk()
            objective = objective_of(desk, request.objective)
            if self._executive is None:
                self._executive = DeskExecutive(self._hearing.arm())
        except PlannerError as error:
            self._refuse(str(error))
            return
        self._goal = _Goal(objective, float(request.enough), int(request.seed))
        self._thought = None
        learn = request.teach or not self._known.is_taught(desk)
        task: Task = self._known.lessons(desk) if learn else self._tidying(self._goal)
        assert self._hearing.joints is not None
        self._executive.begin(task, self._now(), self._hearing.joints)

    def _refuse(self, why: str) -> None:
        self._goal = None
        self._cancel()  # the goal before was told that this one takes its place: nobody waits for it any more
        self._say(why)
        self._goals.end(Tidy.Result(message=why, cost=math.nan), False)

    def _cancel(self) -> None:
        if self._executive is not None and self._hearing.joints is not None:
            self._executive.cancel(self._now(), self._hearing.joints)

    def _tidying(self, goal: _Goal) -> Tidying:
        settings = TidyingSettings(enough=goal.enough, think=self._think)
        return Tidying(goal.objective, self._known.model, seed=goal.seed, settings=settings, planning=self._planning)

    # What is due

    def _on_look(self, stamp: float, poses: Any) -> None:
        if self._executive is not None:
            self._executive.see(stamp, poses, len(self._hearing.desk().items))

    def _tick(self) -> None:
        executive, joints, now = self._executive, self._hearing.joints, self._now()
        complaint = self._hearing.live.complaint(now)
        if executive is None or joints is None:
            return
        if executive.task is not None and complaint:
            executive.halt(Ended(Ending.SILENT, f"{complaint}; is the robot running?"))
        self._think_or_answer(executive, now, joints)
        angles = executive.tick(now, joints)
        if angles is not None:
            self._arm.publish(Float64MultiArray(data=angles.tolist()))
        if self._goal is not None:
            self._report(executive, now, joints)

    def _think_or_answer(self, executive: DeskExecutive, now: float, joints: Array) -> None:
        if executive.question is not None and self._thought is None and executive.task is not None:
            self._newest = self._thought = self._thinker.submit(executive.task.next, dict(executive.question))
        if self._thought is not None and self._thought.done():
            thought, self._thought = self._thought, None
            try:
                executive.answer(thought.result(), now, joints)
            except PlannerError as error:
                executive.answer(Ended(Ending.BEST, str(error)), now, joints)

    def _report(self, executive: DeskExecutive, now: float, joints: Array) -> None:
        """Say how it stands; at the end of teaching tidying begins."""
        goal, task = self._goal, executive.task
        assert goal is not None
        if executive.ended is None:
            if task is not None:
                self._tell(executive.state, task, goal)
            return
        ended, done = executive.ended, executive.last_task
        if isinstance(done, Teaching) and ended.ending is Ending.TAUGHT:
            goal.taught += done.pushes
            self._known.take_in(done)
            self._keep()
            executive.begin(self._tidying(goal), now, joints)
            return
        self._goal = None
        self._keep()
        result = Tidy.Result(
            success=ended.ending.success, message=f"{ended.ending.value}: {ended.reason}", cost=math.nan
        )
        if isinstance(done, Tidying):
            result.cost, result.pushes, result.replans = done.cost, done.pushes, max(done.replans, 0)
        self._say(result.message)
        self._goals.end(result, result.success)

    def _keep(self) -> None:
        """Write down what is known of pushes; each that was made has added to it."""
        try:
            self._known.write()
        except PlannerError as error:
            self.get_logger().error(str(error))

    def _tell(self, state: State, task: Task, goal: _Goal) -> None:
        feedback = Tidy.Feedback(state=state.value, pushes=goal.taught + task.pushes, cost=math.nan)
        words = f"{state.value}; {feedback.pushes} pushes"
        if isinstance(task, Tidying):
            feedback.replans = max(task.replans, 0)
            if math.isfinite(task.cost):
                feedback.cost = task.cost
            if task.plan is not None and state is State.PUSHING:
                self._drawing.publish(planned(task.desk, task.plan.layouts, self.get_clock().now().to_msg()))
        else:
            words += ", learning"
        if self._say.is_new(words):
            self._say(words)
            self._goals.tell(feedback)

    # Small things

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9


def objective_of(desk: Desk, told: str) -> Objective:
    """Return the objective that a goal names: a file, one of the workspace, or the text itself.

    Raises:
        PlannerError: there is none, or it makes no sense.
    """
    if "\n" in told or "terms" in told:
        return Objective.from_text(desk, told, "objective")
    path = Path(told)
    if not path.is_file():
        try:
            folder = Path(get_package_share_directory("pbrl_config")) / "objectives"
        except PackageNotFoundError:
            folder = Path("objectives")
        known = sorted(each.stem for each in folder.glob("*.yaml"))
        if told not in known:
            raise PlannerError(f"objective: expected a file, YAML text, or one of {', '.join(known)}, got {told!r}")
        path = folder / f"{told}.yaml"
    return Objective.from_file(desk, path)


def main() -> None:
    """Run the node until it is told to stop."""
    run_node("tabletop_node", TabletopNode, busy=lambda node: node.thinking)


if __name__ == "__main__":
    main()
