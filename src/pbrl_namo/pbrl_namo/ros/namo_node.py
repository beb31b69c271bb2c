"""Node around `NamoExecutive`: brings the robot to a goal, moving what is in the way (thesis figure 42).

Goals come by the action /reach_goal, by RViz on /goal_pose, or with the parameter `goal` at the start; the last one
counts. /namo/status says where it is, /markers draws what it thinks. Nothing is commanded before the first goal and
after the end. It ticks on the node's clock, simulated or not; where that clock stands still it goes on with looking
after whoever is needed, on a steady clock: while the joint states, the body controller or the grippers' service are
gone the robot rests, and what is held is let go when they are back.

Plans, grasps and models are thought of in a process of its own, which is given all that was heard while something was
held, and which compiles ahead what they call.
"""

from __future__ import annotations

import math
import time
from functools import partial

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from pbrl_msgs.msg import NamoStatus, ObjectModels, Scene
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from pbrl_bag.liveness import Liveness
from pbrl_bag.names import relative
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.running import run_node
from pbrl_bag.ros.stopping import spin_in_order
from pbrl_control.errors import ControlError
from pbrl_control.installed import params_folder
from pbrl_control.kinematics import SIDES, RobotKinematics
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, GripperRequest
from pbrl_control.ros.conversions import expected_to_msg, twist_to_msg
from pbrl_control.ros.floor_conversions import fixed_from_msg, room_from_msg
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_model.ros.listener import MEMORY, RecordingListener
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import NamoExecutive, OpenByFreeSpace, Order, State, status_of
from pbrl_namo.executive.jobs import Belief
from pbrl_namo.executive.step import rest
from pbrl_namo.executive.table import ENDED
from pbrl_namo.ros.conversions import goal_from_pose, goal_from_text, masses_from_msg, status_to_msg
from pbrl_namo.ros.goal_server import GoalServer
from pbrl_namo.ros.hearing import JOINT_STATES, SHARE, Hearing
from pbrl_namo.ros.markers import Drawing, draw
from pbrl_namo.ros.thinker import NodeThinker
from pbrl_namo.ros.told_models import ToldModels

GONE = 1.0
"""Silence after which somebody counts as gone [s]."""
LOOKS = 10.0
"""Of whoever is needed, a second of the steady clock."""
TOLD = 0.5
"""Between two messages of status while the state stays the same [s]."""
STUCK_CLOCK = 0.3
"""Without a tick for so long [s of the steady clock], the node's clock stands still: a look is a tick, too."""

GRASP_SERVICE = "/grasp"


class NamoNode(Node):
    """Navigation among movable obstacles."""

    def __init__(self) -> None:
        super().__init__("namo_node")
        goal = declare(self, "goal", "", '"x y" or "x y theta" in world [m, rad], at once; empty: wait for one')
        rate = declare(self, "rate", 50.0, "ticks a second, on the node's clock [Hz]", (20.0, 200.0))
        self._seed = declare(self, "seed", 0, "seed of every draw, for goals that bring none", (0, 2**31 - 1))
        memory = declare(self, "memory", MEMORY, "most that is kept of what was heard [MB]", (10.0, 4000.0))
        refuse_unknown(self)
        self._first = goal_from_text(goal) if goal else None
        self._settings = load_section(
            params_folder("settings") / "body_controller.yaml", ControllerSettings, "settings"
        )
        self._listener = RecordingListener(f"{self.get_name()}_listener", self.context, memory, self.get_namespace())
        self._thinker = NodeThinker(self._listener.kept)
        self._kinematics: RobotKinematics | None = None
        self._executive: NamoExecutive | None = None
        self._beliefs: dict[str, Belief] = {}
        self._scene: Scene | None = None
        self._floor: tuple[Array | None, dict[str, Array], dict[str, float]] | None = None
        self._models: ObjectModels | None = None
        self._told_models = ToldModels()
        self._goals: GoalServer | None = None  # offered when the robot is known: who sees it may send goals
        self._state: State | None = None
        self._paused = ""
        self._ticked = self._told = -math.inf
        self._drawing = Drawing()
        diagnostics = Diagnostics(self, self._doing, self._trouble)
        self._live = Liveness((JOINT_STATES, SHARE, GRASP_SERVICE), GONE)
        self._hearing = Hearing(self, diagnostics, self._on_scene, self._on_odometry, self._live.heard)
        diagnostics.subscribe(String, "robot_description", self._on_description, LATCHED)
        diagnostics.subscribe(ObjectModels, "object_models", self._on_models, LATCHED, needed=False)
        self._create_outputs()
        self._listener.start()
        self.create_timer(1.0 / rate, self._tick)
        self.create_timer(1.0 / LOOKS, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _doing(self) -> str:
        if self._executive is None:
            return "waits for a goal, /reach_goal or /goal_pose"
        return f"{self._state or 'begins'}: {self._executive.sentence}"

    def _trouble(self) -> str:
        if self._paused:
            return f"rests: {self._paused}"
        failed = self._executive is not None and self._executive.state == State.FAILED
        return f"failed: {self._executive.reason}" if failed and self._executive is not None else ""

    def destroy_node(self) -> None:
        """Let listener and thinker go with the node."""
        self._thinker.close()
        self._listener.stop()
        if self._goals is not None:
            self._goals.destroy()
        super().destroy_node()

    def _create_outputs(self) -> None:
        self._status = self.create_publisher(NamoStatus, "namo/status", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "markers", COMMANDS)
        self._twist = self.create_publisher(TwistStamped, "object_twist_command", COMMANDS)
        self._expected = {
            side: self.create_publisher(WrenchStamped, f"expected_grip_wrench/{side}", COMMANDS) for side in SIDES
        }
        self._callers: dict[str, Client] = {
            "grasp": self.create_client(GraspObject, relative(GRASP_SERVICE)),
            "release": self.create_client(ReleaseObject, "release"),
        }

    # What comes in

    def _on_description(self, message: String) -> None:
        if self._kinematics is not None:
            return
        try:
            self._kinematics = RobotKinematics(message.data)
        except ControlError as error:
            self.get_logger().error(str(error))
            return
        self._goals = GoalServer(self, self._aim, self._cancel)
        self.create_subscription(PoseStamped, "goal_pose", self._on_goal_pose, COMMANDS)
        if self._first is not None:
            self._aim(self._first, self._seed)

    def _on_goal_pose(self, message: PoseStamped) -> None:
        try:
            goal = goal_from_pose(message)
        except NamoError as error:
            self.get_logger().error(f"refused: {error}")
            return
        if self._goals is not None:
            self._goals.replaced("another goal was given on /goal_pose")
        self._aim(goal, self._seed)

    def _on_scene(self, message: Scene) -> None:
        """Take in a scene; raises ControlError, and keeps the one before, where it has no room as it should."""
        self._floor = room_from_msg(message), fixed_from_msg(message), masses_from_msg(message)
        self._scene = message
        self._tell_scene()
        self._take_models()

    def _on_odometry(self, stamp: float, pose: Array) -> None:
        if self._executive is not None:
            self._executive.odometry(stamp, pose)

    def _on_models(self, message: ObjectModels) -> None:
        self._models = message
        self._take_models()

    def _take_models(self) -> None:
        """Believe what others have learned, once outlines are known too."""
        if self._models is None or self._scene is None:
            return
        models, self._models = self._models.models, None
        for name, belief in self._told_models.news(models, self._scene, self._believed, self.get_logger().error):
            self._beliefs[name] = belief
            if self._executive is not None:
                self._executive.believe(name, belief)

    def _believed(self, name: str) -> Belief | None:
        beliefs = self._beliefs if self._executive is None else self._executive.mission.beliefs
        return beliefs.get(name)

    def _tell_scene(self) -> None:
        if self._executive is not None and self._floor is not None:
            self._executive.told(*self._floor)

    # Goals

    def _aim(self, goal: Array, seed: int) -> None:
        """Set out for a goal, at once or, under way, at the next tick."""
        assert self._kinematics is not None
        now = time.monotonic()
        if self._executive is not None and self._executive.state not in ENDED:
            self._executive.aim(goal, seed)
            return
        if self._executive is not None:
            self._beliefs.update(self._executive.mission.beliefs)
        self._executive = NamoExecutive(
            goal,
            self._kinematics,
            self._thinker,
            opening=OpenByFreeSpace(),
            controller=self._settings,
            beliefs=self._beliefs,
            seed=seed,
        )
        self._state, self._paused = None, ""
        self._live.begin(now)
        self._tell_scene()
        self.get_logger().info(f"goal: {goal[0]:.2f} {goal[1]:.2f} {goal[2]:.2f}")

    def _cancel(self) -> None:
        if self._executive is not None:
            self._executive.cancel()

    # Ticks

    def _tick(self) -> None:
        now = self.get_clock().now()
        if self._executive is None or now.nanoseconds == 0:  # zero: a simulated clock that nobody has set yet
            return
        self._ticked = time.monotonic()
        seconds = now.nanoseconds * 1e-9
        percept = self._hearing.percept(seconds)
        order = self._executive.tick(seconds, percept)
        ends = order.state in ENDED and order.state != self._state
        # An end commands nothing: said once, the robot need not go on until its controller's watchdog stops it.
        for target, twist in (rest(percept) if ends else order.twists).items():
            self._twist.publish(twist_to_msg(target, twist, now.to_msg()))
        for side, wrench in order.expected.items():
            self._expected[side].publish(expected_to_msg(self._executive.plan.object, wrench, now.to_msg()))
        for request in order.requests:
            self._ask(request)
        if order.state != self._state:
            self._enter(order)

    def _enter(self, order: Order) -> None:
        self._state = order.state
        self._tell()
        if order.state == State.FAILED:  # rclpy remembers a severity for each line of code
            self.get_logger().error(f"{order.state}: {order.status}")
        else:
            self.get_logger().info(f"{order.state}: {order.status}")

    def _look(self) -> None:
        """Look after whoever is needed, tell how things are, and tick where the node's clock stands still."""
        if self._executive is None:
            return
        now = time.monotonic()
        if self._callers["grasp"].service_is_ready():
            self._live.heard(GRASP_SERVICE, now)
        gone = self._live.complaint(now) if self._executive.state not in ENDED else ""
        if gone:
            self._executive.pause(gone)
        elif self._paused:
            self._executive.resume()
        self._paused = gone
        if now - self._ticked > STUCK_CLOCK:
            self._tick()
        if now - self._told >= TOLD:
            self._tell()

    def _tell(self) -> None:
        """Publish status and markers; the action's feedback or result."""
        assert self._executive is not None
        self._told = time.monotonic()
        status, stamp = status_of(self._executive), self.get_clock().now().to_msg()
        message = status_to_msg(status, self._executive.mission.account, stamp)
        self._status.publish(message)
        if self._goals is not None:
            self._goals.tell(message)
        drawn = draw(status, self._executive.mission.planned.move, self._thinker.floor)
        self._markers.publish(self._drawing.update(drawn, stamp))

    # Grippers

    def _ask(self, request: GripperRequest) -> None:
        client = self._callers[request.action]
        if not client.service_is_ready():
            self._no_answer(request, f"no service {client.service_name}; is the simulator or robot running?")
            return
        if request.action == "grasp":
            call = client.call_async(GraspObject.Request(gripper=request.side, object=request.object))
        else:
            call = client.call_async(ReleaseObject.Request(gripper=request.side))
        call.add_done_callback(partial(self._on_answer, request))

    def _on_answer(self, request: GripperRequest, call: Future) -> None:
        result = call.result()
        if result is None:
            self._no_answer(request, f"the {request.action} service gave no result")
            return
        distance = float(getattr(result, "distance", 0.0))
        self._answer(GripperAnswer(request.action, request.side, bool(result.success), str(result.message), distance))

    def _no_answer(self, request: GripperRequest, sentence: str) -> None:
        self._answer(GripperAnswer(request.action, request.side, False, sentence))

    def _answer(self, answer: GripperAnswer) -> None:
        if self._executive is not None:
            self._executive.answer(answer)


def main() -> None:
    """Run the node until it is told to stop; errors at start are one line and exit code 2."""
    run_node(
        "namo_node",
        NamoNode,
        (
            ControlError,
            NamoError,
        ),
        spin=spin_in_order,
    )


if __name__ == "__main__":
    main()
