"""Node around `BodyController`: /object_twist_command in, /cmd_vel and arm velocities out.

It ticks with every /joint_states message, so at that topic's rate and on its clock, simulated or not; or, with `rate`,
so many times a second of the wall clock with the newest one, for a robot or a simulator that runs in real time; with
`priority` before everything else that the machine does. When joint states cease nothing is sent any more, and base and
arms stop by their own watchdogs. While /emergency_stop (std_msgs/Bool) is true the robot rests, whatever is commanded;
/body_controller/status says why it rests, and /body_controller/share with every command, how much of the asked twist is
done by it.
"""

from __future__ import annotations

import gc
import math
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, WrenchStamped
from pbrl_msgs.msg import Grasps, Scene
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray, String

from pbrl_bag.errors import BagError
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.running import run_node
from pbrl_bag.ros.stopping import spin_in_order
from pbrl_control.controller import BodyController
from pbrl_control.errors import ControlError
from pbrl_control.fence import Fence
from pbrl_control.installed import params_folder
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.limits import LONGEST
from pbrl_control.percept import BodyShape, Grip, Percept, Tag, gripper_tag, holds_of
from pbrl_control.planar import Array
from pbrl_control.realtime import take_priority
from pbrl_control.ros.conversions import (
    arm_to_msg,
    base_to_msg,
    bodies_from_msg,
    expected_from_msg,
    grips_from_msg,
    movable_from_msg,
    posture_from_msg,
    seconds,
    tag_from_msg,
    twist_from_msg,
    wrench_from_msg,
)
from pbrl_control.ros.floor_conversions import fixed_from_msg
from pbrl_control.ros.qos import COMMANDS, LATCHED, NEWEST
from pbrl_control.sensor_watch import SensorWatch
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.types import BodyCommand, BodyState, Hold
from pbrl_control.watchdog import Watchdog
from pbrl_control.whole_body.prepare import compile_kernels

JOINTS = "joint positions"
TAGS = "tags"
SIGN_OF_LIFE = 0.2  # [s of the wall clock] between two while nothing is commanded
UNMATCHED = SubscriptionEventCallbacks(use_default_callbacks=False)
"""Says nothing where a publisher does not match: another subscription hears it."""
SLOWEST = 20.0  # [Hz] of ticks: base and arms stop 0.1 s after a command
STIRS = 0.02  # [rad/s] of a joint, at which its position has to change


class BodyControllerNode(Node):
    """Whole-body control of what the grippers hold."""

    def __init__(self) -> None:
        super().__init__("body_controller_node")
        path = declare(self, "settings", "", "YAML of gains and limits; empty: body_controller.yaml as installed")
        rate = f"ticks a second of the wall clock [Hz], {SLOWEST:g} at least; 0: with every /joint_states"
        self._rate: float = declare(self, "rate", 0.0, rate, (0.0, 1000.0))
        if 0.0 < self._rate < SLOWEST:
            raise BagError(f"rate: expected 0, or {SLOWEST:g} to 1000 ({rate}), got {self._rate:.10g}")
        first = "real-time priority (SCHED_FIFO), 1 to 99, beside a rate; 0: none"
        self.priority: int = declare(self, "priority", 0, first, (0, 99))
        refuse_unknown(self)
        file = Path(path) if path else params_folder("settings") / "body_controller.yaml"
        self._settings = load_section(file, ControllerSettings, "settings")
        compile_kernels(self._settings)  # before anybody can see this node: who sees it may count on its ticks
        self._controller: BodyController | None = None
        self._fence: Fence | None = None
        self._bodies: dict[str, BodyShape] = {}
        self._fixed: dict[str, Array] = {}
        self._watchdog = Watchdog(self._settings.timeout)
        self._watch = SensorWatch(self._settings.watch)
        self._emergency = False
        self._wrenches: dict[str, Array] = {}
        self._grips: dict[str, Grip] = {}
        self._expected: dict[str, tuple[float, str, Array]] = {}
        self._tags: dict[str, Tag] = {}
        self._tag_topics: set[str] = set()
        self._joints: JointState | None = None
        self._heard = 0.0
        self._last: float | None = None
        self._moving = False
        self._in_motion = self._arms_in_motion = False
        self._told = -math.inf
        self._report = ""
        self._diagnostics = Diagnostics(self, self._doing, lambda: self._report, self._numbers)
        self._create_publishers()
        self._create_subscriptions()
        if self._rate:
            self.create_timer(1.0 / self._rate, self._on_time, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _create_publishers(self) -> None:
        self._base = self.create_publisher(Twist, "cmd_vel", COMMANDS)
        self._arms = {
            side: self.create_publisher(Float64MultiArray, f"{side}_arm_velocity_controller/commands", COMMANDS)
            for side in SIDES
        }
        self._status = self.create_publisher(String, "body_controller/status", LATCHED)
        self._share = self.create_publisher(Float64, "body_controller/share", COMMANDS)

    def _create_subscriptions(self) -> None:
        hear = self._diagnostics.subscribe
        hear(String, "robot_description", self._on_description, LATCHED)
        hear(JointState, "joint_states", self._on_joints, NEWEST)
        hear(Scene, "scene", self._on_scene, LATCHED, needed=False, refuses=(BagError, ControlError))
        hear(Grasps, "grasps", self._on_grasps, LATCHED, needed=False)
        hear(TwistStamped, "object_twist_command", self._on_twist, COMMANDS, needed=False)
        # Whoever stops it may publish as topics are by default, which a latched subscription alone never hears.
        for qos in (LATCHED, COMMANDS):
            hear(Bool, "emergency_stop", self._on_emergency, qos, needed=False, events=UNMATCHED)
        for side in SIDES:
            hear(WrenchStamped, f"wrist_ft/{side}", partial(self._on_wrench, side), NEWEST, needed=False)
            expected = f"expected_grip_wrench/{side}"
            self.create_subscription(WrenchStamped, expected, partial(self._on_expected, side), COMMANDS)
            self._listen_to_tag(gripper_tag(side))

    def _listen_to_tag(self, name: str) -> None:
        if name not in self._tag_topics:
            self._tag_topics.add(name)
            hear = self._diagnostics.subscribe
            hear(PoseStamped, f"ar_tags/{name}/pose", partial(self._on_tag, name), NEWEST, needed=False)

    def _doing(self) -> str:
        return "moves what it holds" if self._moving else "rests: nothing is commanded"

    def _numbers(self) -> dict[str, object]:
        share = self._controller.share if self._controller is not None else 0.0
        return {"holds": ", ".join(grip.object for grip in self._grips.values()), "share of the twist": share}

    def _on_description(self, message: String) -> None:
        try:
            self._controller = BodyController(RobotKinematics(message.data), self._settings)
            self._fence = Fence(message.data, self._settings.fence)
            self._fence.told(self._bodies, self._fixed)
        except ControlError as error:
            self._controller = None
            self.get_logger().error(str(error))

    def _on_scene(self, message: Scene) -> None:
        bodies, fixed = bodies_from_msg(message), fixed_from_msg(message)
        if self._fence is not None:
            self._fence.told(bodies, fixed)
        self._bodies, self._fixed = bodies, fixed
        for name in movable_from_msg(message):
            self._listen_to_tag(name)

    def _on_grasps(self, message: Grasps) -> None:
        self._grips = grips_from_msg(message)

    def _on_twist(self, message: TwistStamped) -> None:
        target, twist = twist_from_msg(message)
        self._watchdog.feed(self._now(), target, twist)

    def _on_emergency(self, message: Bool) -> None:
        self._emergency = bool(message.data)

    def _on_wrench(self, side: str, message: WrenchStamped) -> None:
        wrench = self._wrenches[side] = wrench_from_msg(message)
        self._watch.feed(_wrench_stream(side), self._now(), wrench, moving=self._in_motion)

    def _on_expected(self, side: str, message: WrenchStamped) -> None:
        self._expected[side] = (self._now(), message.header.frame_id, expected_from_msg(message))

    def _on_tag(self, name: str, message: PoseStamped) -> None:
        tag = self._tags[name] = tag_from_msg(message)
        self._watch.feed(TAGS, self._now(), np.array([tag.time]), moving=False)
        self._watch.feed(_tag_stream(name), self._now(), np.array([tag.time]), moving=self._in_motion)

    def _on_joints(self, message: JointState) -> None:
        self._joints, self._heard = message, time.monotonic()
        if not self._rate:
            self._step(message, seconds(message.header.stamp))

    def _on_time(self) -> None:
        now = time.monotonic()
        if self._joints is not None and now - self._heard < self._settings.timeout:
            self._step(self._joints, now)

    def _step(self, message: JointState, now: float) -> None:
        dt, self._last = now - (now if self._last is None else self._last), now
        if self._controller is not None and dt > 0.0:
            self._send(self._tick(self._controller, message, min(dt, LONGEST)), self._controller)

    def _tick(self, controller: BodyController, message: JointState, dt: float) -> BodyCommand | None:
        """Return what to send; None where nobody commands anything."""
        try:
            twists = self._watchdog.current(self._now())
            if self._emergency:
                return controller.stand("emergency stop: /emergency_stop is true")
            posture = posture_from_msg(message)
            lost = self._lost_stream(posture) if twists else ""
            if lost:
                return controller.stand(lost)
            percept = Percept(posture, self._tags, self._wrenches, self._grips, self._bodies)
            holds = self._with_expected(holds_of(percept))
            command = controller.tick(BodyState(posture), twists, holds, self._wrenches, dt)
            if self._fence is not None and (fault := self._fence.fault(self._now(), percept, command)):
                return controller.stand(fault)
        except ControlError as error:
            return controller.stand(str(error))
        return command if twists or command.report else None

    def _with_expected(self, holds: dict[str, Hold]) -> dict[str, Hold]:
        """Return the holds with what their grips are expected to apply, where that was said of late."""
        now, told = self._now(), dict(holds)
        for side, (when, target, wrench) in self._expected.items():
            if side in holds and target == holds[side].object and 0.0 <= now - when <= self._settings.timeout:
                told[side] = replace(holds[side], expected=wrench)
        return told

    def _lost_stream(self, posture: Posture) -> str:
        """Return which stream that is needed cannot be trusted, and why; empty where all can."""
        now = self._now()
        self._watch.feed(JOINTS, now, posture.vector(), moving=self._arms_in_motion)
        needed, links = [JOINTS], [TAGS, *(_wrench_stream(side) for side in self._grips)]
        for side, grip in self._grips.items():
            needed += [_wrench_stream(side), _tag_stream(grip.object), _tag_stream(gripper_tag(side))]
        return self._watch.cut(now, links) or self._watch.complaint(now, needed)

    def _send(self, command: BodyCommand | None, controller: BodyController) -> None:
        """Publish a command; when commands cease, one that stops everything, and then leave the drives alone."""
        if command is None and not self._moving:
            self._give_a_sign_of_life(controller)
            return
        self._moving = command is not None
        command = command or BodyCommand()
        self._arms_in_motion = any(np.abs(command.arm(side)).max() > STIRS for side in SIDES)
        self._in_motion = self._arms_in_motion or command.base_v != 0.0 or command.base_w != 0.0
        self._base.publish(base_to_msg(command.base_v, command.base_w))
        for side in SIDES:
            self._arms[side].publish(arm_to_msg(command.arm(side)))
        self._share.publish(Float64(data=controller.share))
        if command.report != self._report:
            self._report = command.report
            self._status.publish(String(data=command.report or "ok"))
            if command.report:
                self.get_logger().warning(command.report)

    def _give_a_sign_of_life(self, controller: BodyController) -> None:
        """Tell the share now and then though nothing is commanded: who commands may wait for this before he does."""
        now = time.monotonic()
        if now - self._told >= SIGN_OF_LIFE:
            self._told = now
            self._share.publish(Float64(data=controller.share))

    def _now(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9


def _wrench_stream(side: str) -> str:
    return f"wrench of the {side} gripper"


def _tag_stream(name: str) -> str:
    return f"tag {name!r}"


def _spin(node: BodyControllerNode, stop: threading.Event) -> None:
    """Handle what comes, in the order in which it comes, until `stop` is set; nothing is to hold up a tick."""
    gc.collect()
    gc.freeze()  # what there is by now stays: looking through it again takes time
    take_priority(node.priority)
    spin_in_order(node, stop)


def main() -> None:
    """Run the node until it is told to stop; errors at start are one line and exit code 2."""
    run_node("body_controller_node", BodyControllerNode, (ControlError,), spin=_spin)


if __name__ == "__main__":
    main()
