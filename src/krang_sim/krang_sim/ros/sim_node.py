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
import time
from typing import Any

import rclpy
from geometry_msgs.msg import Twist
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from bullet_sim.errors import SimError
from bullet_sim.scene import load_scene
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


class SimNode(Node):
    """Steps a `KrangSession`, publishes what it gives, obeys the command topics."""

    def __init__(self) -> None:
        super().__init__("sim_node")
        self._declare()
        scene = load_scene(self._value("scene"))
        self._rate: float = self._value("rate")
        self._duration: float = self._value("duration")
        self._lag: float = self._value("command_lag")
        self.session = KrangSession(scene, seed=self._value("seed"), gui=self._value("gui"))
        types = message_types(self.session.tagged)
        self._outputs = {
            topic: self.create_publisher(kind, topic, LATCHED_QOS if topic in LATCHED else STREAM_QOS)
            for topic, kind in types.items()
        }
        self._stopped = False
        self._heard = 0
        self._last_command: float | None = None
        self._listen_to_commands()
        self.create_service(GraspObject, "/grasp", self._grasp)
        self.create_service(ReleaseObject, "/release", self._release)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def _declare(self) -> None:
        self._parameter("scene", "locked_caster", "Scene file, or the name of a scene that comes with the workspace")
        self._parameter("seed", 0, "Seed of every random draw", IntegerRange(from_value=0, to_value=2**31 - 1))
        self._parameter("rate", 1.0, "Simulated seconds per second; 0: as fast as possible", _between(0.0, 1000.0))
        self._parameter("gui", False, "Open Bullet's window")
        self._parameter("duration", 0.0, "Simulated seconds to run [s]; 0: for ever", _between(0.0, 1e6))
        self._parameter(
            "command_lag",
            0.02,
            "At a rate other than 1: simulated time [s] to run on after a command before waiting for the next",
            _between(0.0, 1.0),
        )

    def _parameter(self, name: str, default: Any, description: str, bounds: Any = None) -> None:
        descriptor = ParameterDescriptor(description=description, read_only=True)
        if isinstance(bounds, FloatingPointRange):
            descriptor.floating_point_range = [bounds]
        elif isinstance(bounds, IntegerRange):
            descriptor.integer_range = [bounds]
        self.declare_parameter(name, default, descriptor)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

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

    def stop(self) -> None:
        """Let `run` return at its next step."""
        self._stopped = True

    def _wanted(self) -> bool:
        return not self._stopped and self.context.ok()

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


def _between(low: float, high: float) -> FloatingPointRange:
    return FloatingPointRange(from_value=low, to_value=high)


def _stop_on_signals(node: SimNode) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: node.stop())


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    node = None
    fault = ""
    # rclpy's own handlers would shut the context down between a step and its publication.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = SimNode()
        _stop_on_signals(node)
        node.run()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except InvalidParameterTypeException as error:
        fault = f"{' '.join(str(error).split())}; write floats with a point (2.0) and switches as true or false"
    except (SimError, InvalidParameterValueException) as error:
        fault = " ".join(str(error).split())
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    if fault:
        print(f"sim_node: {fault}", file=sys.stderr)
        sys.exit(2)
