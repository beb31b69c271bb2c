"""Node around `PushExecutive`: one push plan, or an object moved along a trajectory; /push/status says where it is.

With `trajectory` the object is grasped, moved as /object_models says that it can be moved, and let go. What has been
learned of it when the grip closes counts; without a model the trajectory is followed as it is wanted.

With `fetch` the robot drives there first, from anywhere in the room, and tests the grip before it moves anything; with
`grips:=sampled` it grasps where what was learned lets it, not where the plan says.
"""

from __future__ import annotations

import sys
from functools import partial

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import Grasps, ObjectModel, ObjectModels, Scene
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rclpy.client import Client
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from pbrl_bag.errors import BagError
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.stopping import init_until_signal, spin_until
from pbrl_control.constraints.belief import ClassBelief
from pbrl_control.constraints.classes import Freedom
from pbrl_control.course import Course, SegmentCourse
from pbrl_control.errors import ControlError
from pbrl_control.fetching import FetchExecutive, GivenGrips, SampledGrasps, grasp_model
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.installed import params_folder
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.loop import Executive
from pbrl_control.percept import BodyShape, Grip, Percept, Tag, gripper_tag, object_planar
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, GripperRequest, Phase, PushCommand, PushExecutive
from pbrl_control.push_plan import load_plan
from pbrl_control.ros.conversions import (
    bodies_from_msg,
    expected_to_msg,
    grips_from_msg,
    posture_from_msg,
    tag_from_msg,
    twist_to_msg,
    wrench_from_msg,
)
from pbrl_control.ros.floor_conversions import fixed_from_msg, odometry_from_msg, room_from_msg
from pbrl_control.ros.qos import COMMANDS, LATCHED, NEWEST
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.trajectories.course import TrajectoryCourse
from pbrl_control.trajectories.trajectory_plan import load_trajectory
from pbrl_model.errors import ModelError
from pbrl_model.ros.conversions import posterior_from_msg


class PushNode(Node):
    """Drives up to an object, grasps, moves and releases it, as a plan says.

    Attributes:
        ended: completes with the last command when the push has ended and `exit_when_done` is set.
    """

    def __init__(self) -> None:
        super().__init__("push_node")
        plan = declare(self, "plan", "turn_table", "name of a plan in config/params/pushes, or a path")
        trajectory = declare(
            self, "trajectory", "", "in place of a plan: name of one in config/params/trajectories, or a path"
        )
        fetch = declare(self, "fetch", False, "drive to the object first, from anywhere in the room")
        text = "of a fetch: plan, as it says; sampled, as the object's model allows"
        grips = declare(self, "grips", "plan", text, choices=("plan", "sampled"))
        self._exit = declare(self, "exit_when_done", False, "end with exit code 0 when done, 1 when failed")
        rate = declare(self, "rate", 50.0, "ticks a second, on the node's clock [Hz]", (20.0, 200.0))
        refuse_unknown(self)
        if grips == "sampled" and not fetch:
            raise ControlError("grips: expected plan, or sampled together with fetch:=true, got sampled alone")
        self._course: TrajectoryCourse | None = None
        self._plan, self._task = self._load(plan, trajectory)
        self._hands = tuple(side for side in SIDES if any(grip.gripper == side for grip in self._plan.grips))
        self._sampled = SampledGrasps(hands=(self._hands,)) if grips == "sampled" else None
        self._fetch: FetchExecutive | None = None  # made when the robot's description comes
        self._executive: Executive | None = None if fetch else PushExecutive(self._plan, self._task)
        self.ended: Future = Future()
        self._posture: Posture | None = None
        self._tags: dict[str, Tag] = {}
        self._tag_topics: set[str] = set()
        self._wrenches: dict[str, Array] = {}
        self._grips: dict[str, Grip] = {}
        self._bodies: dict[str, BodyShape] = {}
        self._scene: Scene | None = None
        self._floor: tuple[Array | None, dict[str, Array]] | None = None
        self._learned: ObjectModel | None = None
        self._place: Array | None = None  # (3,) of the object in `world`, of its last tag
        self._share = 1.0
        self._phase = self._failure = ""
        self._diagnostics = Diagnostics(self, lambda: self._phase, lambda: self._failure)
        self._subscribe()
        if fetch:
            self._subscribe_to_the_floor()
        self._status = self.create_publisher(String, "push/status", LATCHED)
        self._twist = self.create_publisher(TwistStamped, "object_twist_command", COMMANDS)
        self._expected = {
            side: self.create_publisher(WrenchStamped, f"expected_grip_wrench/{side}", COMMANDS) for side in self._hands
        }
        self._callers: dict[str, Client] = {
            "grasp": self.create_client(GraspObject, "grasp"),
            "release": self.create_client(ReleaseObject, "release"),
        }
        self.create_timer(1.0 / rate, self._tick)

    def _load(self, plan: str, trajectory: str) -> tuple[GraspPlan, Course]:
        """Return what to grasp, and what to do with it."""
        if trajectory:
            wanted = load_trajectory(trajectory)
            self._course = TrajectoryCourse(wanted)
            return wanted, self._course
        push = load_plan(plan)
        return push, SegmentCourse(push)

    def _subscribe(self) -> None:
        hear = self._diagnostics.subscribe
        hear(Scene, "scene", self._on_scene, LATCHED, refuses=(BagError, ControlError))
        hear(Grasps, "grasps", self._on_grasps, LATCHED)
        hear(Float64, "body_controller/share", self._on_share, NEWEST, needed=False)
        if self._course is not None or self._sampled is not None:
            hear(ObjectModels, "object_models", self._on_models, LATCHED, needed=False)
        for side in self._hands:
            hear(WrenchStamped, f"wrist_ft/{side}", partial(self._on_wrench, side), NEWEST)
        for name in (self._plan.object, *(gripper_tag(side) for side in self._hands)):
            self._listen_to_tag(name)

    def _subscribe_to_the_floor(self) -> None:
        """Listen to what driving needs beyond that."""
        hear = self._diagnostics.subscribe
        hear(String, "robot_description", self._on_description, LATCHED)
        hear(JointState, "joint_states", self._on_joints, NEWEST)
        hear(Odometry, "odom", self._on_odometry, NEWEST)
        for side in SIDES:
            self._listen_to_tag(gripper_tag(side))

    def _listen_to_tag(self, name: str) -> None:
        if name not in self._tag_topics:
            self._tag_topics.add(name)
            self._diagnostics.subscribe(PoseStamped, f"ar_tags/{name}/pose", partial(self._on_tag, name), NEWEST)

    def _on_description(self, message: String) -> None:
        if self._fetch is not None:
            return
        settings = load_section(params_folder("settings") / "body_controller.yaml", ControllerSettings, "settings")
        try:
            kinematics = RobotKinematics(message.data)
        except ControlError as error:
            self.get_logger().error(str(error))
            return
        choice = self._sampled or GivenGrips(self._plan)
        self._fetch = FetchExecutive(self._plan, kinematics, settings, choice=choice, course=self._task)
        self._executive = self._fetch
        self._tell_scene()

    def _on_joints(self, message: JointState) -> None:
        try:
            self._posture = posture_from_msg(message)
        except ControlError as error:
            self.get_logger().error(str(error), once=True)

    def _on_share(self, message: Float64) -> None:
        self._share = message.data

    def _on_odometry(self, message: Odometry) -> None:
        if self._fetch is not None:
            self._fetch.odometry(*odometry_from_msg(message))

    def _on_scene(self, message: Scene) -> None:
        floor = room_from_msg(message), fixed_from_msg(message)  # refuses what is no scene
        self._bodies, self._scene, self._floor = bodies_from_msg(message), message, floor
        self._tell_scene()
        self._take_model()

    def _tell_scene(self) -> None:
        """Tell a fetch what wears no tag, and watch what does."""
        if self._fetch is None or self._scene is None or self._floor is None:
            return
        self._fetch.told(*self._floor)
        for body in self._scene.bodies:
            if body.movable:
                self._listen_to_tag(body.name)

    def _on_models(self, message: ObjectModels) -> None:
        own = [model for model in message.models if model.object == self._plan.object]
        self._learned = own[-1] if own else self._learned
        self._take_model()

    def _take_model(self) -> None:
        """Act on what was learned of the object, once its outline is known too, and where it is if that matters."""
        name = self._plan.object
        shape, learned = self._bodies.get(name), self._learned
        if shape is None or learned is None:
            return
        if self._place is None and "hinge_radius" in learned.parameters:
            return  # about which point it turns is known with the object's first tag
        try:
            belief = ClassBelief.of(posterior_from_msg(learned), shape.footprint, self._place)
            if self._sampled is not None:
                self._sampled.model = grasp_model(Freedom.of(belief.model, self._place))
        except (ControlError, ModelError) as error:
            self.get_logger().error(f"model of {name!r} is left aside: {error}")
            if self._course is not None and self._course.model is None:
                self._course.refused = f"model of {name!r}: {error}"
            return
        if self._course is not None:
            self._course.model, self._course.refused = belief.model, ""
        share = belief.probabilities[belief.model_class]
        self.get_logger().info(f"{name} is taken as {belief.model_class} ({100 * share:.0f} % of the draws)")

    def _on_grasps(self, message: Grasps) -> None:
        self._grips = grips_from_msg(message)

    def _on_wrench(self, side: str, message: WrenchStamped) -> None:
        self._wrenches[side] = wrench_from_msg(message)

    def _on_tag(self, name: str, message: PoseStamped) -> None:
        tag = self._tags[name] = tag_from_msg(message)
        if name == self._plan.object and tag.finite():
            first, self._place = self._place is None, object_planar(tag)
            if first:
                self._take_model()

    def _tick(self) -> None:
        if self._executive is None:
            self.get_logger().info("waiting for /robot_description", once=True)
            return
        now = self.get_clock().now()
        percept = Percept(self._posture, self._tags, self._wrenches, self._grips, self._bodies, self._share)
        command = self._executive.tick(now.nanoseconds * 1e-9, percept)
        for target, twist in command.twists.items():
            self._twist.publish(twist_to_msg(target, twist, now.to_msg()))
        for side, wrench in command.expected.items():
            message = expected_to_msg(self._plan.object, wrench, now.to_msg())
            self._expected[side].publish(message)
        for request in command.requests:
            self._ask(request)
        self._tell(command)

    def _tell(self, command: PushCommand) -> None:
        if command.phase == self._phase:
            return
        self._phase = command.phase
        failed = command.phase == Phase.FAILED
        self._failure = f"failed: {command.status}" if failed else ""
        self._status.publish(String(data=f"failed: {command.status}" if failed else str(command.phase)))
        if failed:  # rclpy remembers a severity for each line of code
            self.get_logger().error(f"failed: {command.status}")
        else:
            self.get_logger().info(f"{command.phase}: {command.status}")
        if command.finished and self._exit and not self.ended.done():
            self.ended.set_result(command)

    def _ask(self, request: GripperRequest) -> None:
        client = self._callers[request.action]
        if not client.service_is_ready():
            sentence = f"no service {client.service_name}; is the simulator or robot running?"
            self._answer(GripperAnswer(request.action, request.side, False, sentence))
            return
        if request.action == "grasp":
            call = client.call_async(GraspObject.Request(gripper=request.side, object=request.object))
        else:
            call = client.call_async(ReleaseObject.Request(gripper=request.side))
        call.add_done_callback(partial(self._on_answer, request))

    def _on_answer(self, request: GripperRequest, call: Future) -> None:
        result = call.result()
        if result is None:
            sentence = f"the {request.action} service gave no result"
            self._answer(GripperAnswer(request.action, request.side, False, sentence))
            return
        distance = float(getattr(result, "distance", 0.0))
        answer = GripperAnswer(request.action, request.side, bool(result.success), str(result.message), distance)
        self._answer(answer)

    def _answer(self, answer: GripperAnswer) -> None:
        if self._executive is not None:
            self._executive.answer(answer)


def main() -> None:
    """Run the node; with `exit_when_done`, end with 0 when the push is done and 1 when it failed."""
    node, code = None, 0
    try:
        stop = init_until_signal()
        node = PushNode()
        spin_until(node, lambda: stop.is_set() or node.ended.done())
        if node.ended.done():
            command = node.ended.result()
            code = int(command.phase == Phase.FAILED)
            if code:
                print(f"push_node: {command.status}", file=sys.stderr)
    except (ControlError, BagError) as error:
        print(f"push_node: {error}", file=sys.stderr)
        code = 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    sys.exit(code)


if __name__ == "__main__":
    main()
