"""Krang's simulator as a node: its own clock, all topics of the robot, commands, grasp and release.

Pace. `rate` is how many simulated seconds pass in a second of the wall clock: 1.0 is real time, 0 is as
fast as the machine can. At any rate but 1.0 the simulator waits for controllers: as long as commands
come in, it goes at most `command_lag` of simulated time beyond the last one before it waits for the next
(`PATIENCE` on the wall clock; then the controller counts as gone until it speaks again). A
controller that is slower than the simulator thus slows it down, and the run stays the same
as at real time but for the machine's jitter. Runs that must be bit for bit the same do without nodes:
`./pbrl simulate` steps the same session in one process.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any, get_args

import rclpy
from geometry_msgs.msg import Twist
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from bullet_sim.errors import SimError
from bullet_sim.ros.parameters import declare, refuse_unknown
from bullet_sim.scene import Scene, TagSource, load_scene, with_model, with_tags
from krang_sim.errors import KrangError
from krang_sim.messages import LATCHED, message_types, to_messages
from krang_sim.robot import SIDES
from krang_sim.session import KrangSession

PATIENCE = 0.1
"""[s] on the wall clock that the simulator waits for a controller that has spoken before."""
LISTEN_PERIOD = 0.0099
"""[s] of simulated time between looks at the incoming queues: once a clock tick."""
SLIP = 0.25
"""[s] of wall clock behind schedule at which the lost time is written off instead of caught up."""

LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STREAM_QOS = QoSProfile(depth=100)
COMMAND_QOS = QoSProfile(depth=1)
PICTURE_QOS = QoSProfile(depth=2)  # a megabyte each


class SimNode(Node):
    """Steps a `KrangSession`, publishes what it gives, obeys the command topics.

    Args:
        stop: when it is set, `run` returns at its next step.

    Raises:
        SimError: a wrong parameter, or a scene that cannot be built.
    """

    def __init__(self, stop: threading.Event) -> None:
        super().__init__("sim_node")
        self._stop = stop
        scene, seed, gui = self._declare()
        self.session = KrangSession(scene, seed=seed, gui=gui)
        types = message_types(self.session.tagged, self.session.cameras)
        self._outputs = {topic: self.create_publisher(kind, topic, _quality(topic)) for topic, kind in types.items()}
        self._heard = 0
        self._last_command: float | None = None
        self._listen_to_commands()
        self.create_service(GraspObject, "/grasp", self._grasp)
        self.create_service(ReleaseObject, "/release", self._release)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def _declare(self) -> tuple[Scene, int, bool]:
        """Declare every parameter; return scene, seed and gui."""
        scene = declare(self, "scene", "locked_caster", "scene file, or the name of a scene of the workspace")
        model = declare(self, "model", "", "file of a learned model: the body of its name behaves so; empty: none")
        text = "noise or rendered: pictures on /camera/overhead_<i> for tag_detector_node; empty: as the scene says"
        tags = declare(self, "tags", "", text)
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        gui = declare(self, "gui", False, "open Bullet's window")
        rate = "simulated seconds per second; 0: as fast as possible"
        self._rate: float = declare(self, "rate", 1.0, rate, (0.0, 1000.0))
        self._duration: float = declare(self, "duration", 0.0, "simulated seconds to run; 0: for ever", (0.0, 1e6))
        lag = "at a rate other than 1: simulated seconds to run on after a command before waiting for the next"
        self._lag: float = declare(self, "command_lag", 0.02, lag, (0.0, 1.0))
        refuse_unknown(self)
        if tags not in ("", *get_args(TagSource)):
            raise KrangError(f"tags: expected {' or '.join(get_args(TagSource))}, got {tags!r}")
        loaded = with_model(load_scene(scene), Path(model)) if model else load_scene(scene)
        return with_tags(loaded, tags) if tags else loaded, seed, gui

    def _listen_to_commands(self) -> None:
        self.create_subscription(Twist, "/cmd_vel", self._command_base, COMMAND_QOS)
        self.create_subscription(
            Float64MultiArray, "/body_velocity_controller/commands", self._command_body, COMMAND_QOS
        )
        for side in SIDES:
            self.create_subscription(
                Float64MultiArray,
                f"/{side}_arm_velocity_controller/commands",
                lambda message, side=side: self._obey(self.session.command_arm, side, message.data),
                COMMAND_QOS,
            )

    def _command_base(self, message: Twist) -> None:
        self._obey(self.session.command_base, message.linear.x, message.angular.z)

    def _command_body(self, message: Float64MultiArray) -> None:
        if len(message.data) == 2:
            self._obey(self.session.command_body, *message.data)
        else:
            self._refuse(KrangError(f"body command: expected 2 values, waist and torso, got {len(message.data)}"))

    def _obey(self, command: Any, *values: Any) -> None:
        self._heard += 1
        try:
            command(*values)
        except SimError as error:
            self._refuse(error)
        else:
            self._last_command = self.session.time

    def _refuse(self, error: SimError) -> None:
        self.get_logger().warning(f"ignored: {error}", throttle_duration_sec=1.0)

    def _grasp(self, request: GraspObject.Request, response: GraspObject.Response) -> GraspObject.Response:
        self._heard += 1
        outcome = self.session.grasp(request.gripper, request.object)
        response.success, response.message, response.distance = outcome.success, outcome.message, outcome.distance
        return response

    def _release(self, request: ReleaseObject.Request, response: ReleaseObject.Response) -> ReleaseObject.Response:
        self._heard += 1
        outcome = self.session.release(request.gripper)
        response.success, response.message = outcome.success, outcome.message
        return response

    def run(self) -> None:
        """Step and publish until the duration is over or the context shuts down."""
        origin, next_listen = time.monotonic(), 0.0
        while self._wanted() and not (self._duration and self.session.time >= self._duration):
            for observation in self.session.step():
                for topic, message in to_messages(observation):
                    self._outputs[topic].publish(message)
            if self.session.time >= next_listen:
                next_listen = self.session.time + LISTEN_PERIOD
                origin = self._keep_pace(origin)

    def _wanted(self) -> bool:
        return not self._stop.is_set() and self.context.ok()

    def _keep_pace(self, origin: float) -> float:
        """Hear what has come, and wait until the wall clock and the controllers allow the next tick.

        Args:
            origin: wall clock [s] at which simulated time zero was, or would have been.

        Returns:
            The origin, moved where time was lost that shall not be caught up.
        """
        self._listen(0.0)
        if self._rate != 1.0:
            self._await_command()
        if not self._rate:
            return origin
        due = origin + self.session.time / self._rate
        while (early := due - time.monotonic()) > 0 and self._wanted():
            self._spinner.spin_once(timeout_sec=early)
        return origin if early > -SLIP else origin - early

    def _listen(self, patience: float) -> None:
        """Run callbacks until none is waiting; wait at most `patience` [s] for the first."""
        heard = -1
        while heard != self._heard and self._wanted():
            heard = self._heard
            self._spinner.spin_once(timeout_sec=patience)
            patience = 0.0

    def _await_command(self) -> None:
        """Hold the simulated clock while a controller that has spoken has not answered yet."""
        deadline = time.monotonic() + PATIENCE
        while self._last_command is not None and self.session.time - self._last_command > self._lag:
            left = deadline - time.monotonic()
            if left <= 0 or not self._wanted():
                self._last_command = None
                return
            self._listen(left)

    def destroy_node(self) -> None:
        """End Bullet with the node."""
        self.session.close()
        self._spinner.remove_node(self)
        super().destroy_node()


def _quality(topic: str) -> QoSProfile:
    """Give the quality of service of what is published on a topic."""
    if topic in LATCHED:
        return LATCHED_QOS
    return PICTURE_QOS if topic.startswith("/camera/") else STREAM_QOS


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    node = None
    fault = ""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        # rclpy's own handlers would shut the context down between a step and its publication.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = SimNode(stop)
        node.run()
    except ExternalShutdownException:
        pass
    except (SimError, rclpy_implementation.RCLError) as error:  # RCLError: --ros-args that cannot be read
        fault = " ".join(str(error).split())
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    if fault:
        print(f"sim_node: {fault}", file=sys.stderr)
        sys.exit(2)
