"""What every simulator's node is: a session stepped at a pace, published, and obedient to commands, grasp and release.

Pace. `rate` is how many simulated seconds pass in a second of the wall clock: 1.0 is real time, 0 is as
fast as the machine can. At any rate but 1.0 the simulator waits for controllers: as long as commands
come in, it goes at most `command_lag` of simulated time beyond the last one before it waits for the next
(`PATIENCE` on the wall clock; then the controller counts as gone until it speaks again). A
controller that is slower than the simulator thus slows it down, and the run stays the same
as at real time but for the machine's jitter.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
from pbrl_msgs.srv import GraspObject, ReleaseObject
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray

from bullet_sim.errors import SimError
from bullet_sim.faults import Faults, FaultyLinks
from bullet_sim.grippers import GraspOutcome
from bullet_sim.messages import LATCHED, to_messages
from bullet_sim.ros.diagnostics import PaceDiagnostics
from bullet_sim.ros.latched import LatchedPublisher
from bullet_sim.ros.names import relative
from bullet_sim.ros.parameters import declare

PATIENCE = 0.1
"""[s] on the wall clock that the simulator waits for a controller that has spoken before."""
LISTEN_PERIOD = 0.0099
"""[s] of simulated time between looks at the incoming queues: once a clock tick."""
SLIP = 0.25
"""[s] of wall clock behind schedule at which the lost time is written off instead of caught up."""

STREAM_QOS = QoSProfile(depth=100)
COMMAND_QOS = QoSProfile(depth=1)
PICTURE_QOS = QoSProfile(depth=2)  # a megabyte each


class Session(Protocol):
    """A run of a robot in a scene."""

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""

    def step(self) -> Sequence[Any]:
        """Advance by one physics step; give what is published now."""

    def close(self) -> None:
        """End it."""


class TwoArmed(Session, Protocol):
    """A run of a robot with two arms and grippers."""

    def command_arm(self, side: str, velocity: Sequence[float]) -> None:
        """Ask for the velocities (7,) [rad/s] of an arm's joints."""

    def grasp(self, side: str, object_name: str = "") -> GraspOutcome:
        """Close a gripper."""

    def release(self, side: str) -> GraspOutcome:
        """Open a gripper."""


class PacedSimulator(Node):
    """Steps a session, publishes what it gives, obeys the command topics.

    Args:
        name: of the node.
        stop: when it is set, `run` returns at its next step.

    A simulator declares its own parameters and `declare_pace`, and then calls `start` with its session, and `obey_arms`
    where there are two.
    """

    def __init__(self, name: str, stop: threading.Event) -> None:
        super().__init__(name)
        self._stop = stop
        self._heard = 0
        self._last_command: float | None = None
        self._commands: dict[str, Callable[[Any], None]] = {}
        self._faulty: FaultyLinks | None = None

    def declare_pace(self) -> None:
        """Declare the parameters of the pace.

        Raises:
            SimError: a wrong one.
        """
        rate = "simulated seconds per second; 0: as fast as possible"
        self._rate: float = declare(self, "rate", 1.0, rate, (0.0, 1000.0))
        self._duration: float = declare(self, "duration", 0.0, "simulated seconds to run; 0: for ever", (0.0, 1e6))
        lag = "at a rate other than 1: simulated seconds to run on after a command before waiting for the next"
        self._lag: float = declare(self, "command_lag", 0.02, lag, (0.0, 1.0))

    def start(
        self,
        session: Session,
        types: dict[str, Callable[[], Any]],
        faults: Faults,
        seed: int,
        latched: Sequence[str] = LATCHED,
    ) -> None:
        """Offer the topics of a session.

        Args:
            session: the run.
            types: message class by topic that it publishes.
            faults: of the scene: messages and clocks that fail.
            seed: of every draw of those.
            latched: topics whose last message late subscribers get too.
        """
        self._session = session
        if faults.any:
            self._faulty = FaultyLinks(faults, np.random.default_rng(seed))
            self.get_logger().warning("faults are injected: messages or clocks fail on purpose, as the scene has it")
        self._outputs = {topic: self._publisher(topic, kind, topic in latched) for topic, kind in types.items()}
        self._diagnostics = PaceDiagnostics(self, lambda: session.time, self._rate, lambda: self._heard)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def _publisher(self, topic: str, kind: Callable[[], Any], latched: bool) -> Any:
        """Return what publishes a topic, by how much of it is worth keeping for whom."""
        if latched:
            return LatchedPublisher(self, kind, topic)
        qos = PICTURE_QOS if topic.startswith("/camera/") else STREAM_QOS
        return self.create_publisher(kind, relative(topic), qos)

    def obey_arms(self, session: TwoArmed) -> None:
        """Obey the commands of two arms, and offer to grasp and release."""
        for side in ("left", "right"):
            self.listen(
                Float64MultiArray,
                f"{side}_arm_velocity_controller/commands",
                lambda message, side=side: session.command_arm(side, message.data),
            )
        self.create_service(GraspObject, "grasp", partial(self._grasp, session))
        self.create_service(ReleaseObject, "release", partial(self._release, session))

    def listen(self, kind: Any, topic: str, command: Callable[[Any], None]) -> None:
        """Obey the messages of a topic; what `command` raises SimError for is warned about and ignored."""
        self._commands[f"/{topic}"] = command

        def heard(message: Any) -> None:
            self._heard += 1
            self._last_command = self._session.time  # a controller has spoken, whatever the link makes of it
            if self._faulty is None:
                self._obey(command, message)
            else:
                self._faulty.send(self._session.time, f"/{topic}", message)

        self.create_subscription(kind, topic, heard, COMMAND_QOS)

    def _obey(self, command: Callable[[Any], None], message: Any) -> None:
        try:
            command(message)
        except SimError as error:
            self.get_logger().warning(f"ignored: {error}", throttle_duration_sec=1.0)

    def _grasp(
        self, session: TwoArmed, request: GraspObject.Request, response: GraspObject.Response
    ) -> GraspObject.Response:
        self._heard += 1
        outcome = session.grasp(request.gripper, request.object)
        response.success, response.message, response.distance = outcome.success, outcome.message, outcome.distance
        return response

    def _release(
        self, session: TwoArmed, request: ReleaseObject.Request, response: ReleaseObject.Response
    ) -> ReleaseObject.Response:
        self._heard += 1
        outcome = session.release(request.gripper)
        response.success, response.message = outcome.success, outcome.message
        return response

    def run(self) -> None:
        """Step and publish until the duration is over or the context shuts down."""
        origin, next_listen, session = time.monotonic(), 0.0, self._session
        while self._wanted() and not (self._duration and session.time >= self._duration):
            for observation in session.step():
                for topic, message in to_messages(observation):
                    self._tell(topic, message)
            self._carry()
            if session.time >= next_listen:
                next_listen = session.time + LISTEN_PERIOD
                origin = self._keep_pace(origin)

    def _tell(self, topic: str, message: Any) -> None:
        if self._faulty is None:
            self._outputs[topic].publish(message)
        else:
            self._faulty.send(self._session.time, topic, message)

    def _carry(self) -> None:
        """Deliver what faulty links let arrive now."""
        if self._faulty is None:
            return
        for topic, message in self._faulty.due(self._session.time):
            if topic in self._outputs:
                self._outputs[topic].publish(message)
            else:
                self._obey(self._commands[topic], message)

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
        due = origin + self._session.time / self._rate
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
        while self._last_command is not None and self._session.time - self._last_command > self._lag:
            left = deadline - time.monotonic()
            if left <= 0 or not self._wanted():
                self._last_command = None
                return
            self._listen(left)

    def destroy_node(self) -> None:
        """End Bullet with the node."""
        self._session.close()
        self._spinner.remove_node(self)
        self._spinner.shutdown()  # left to the collector, it may outlive the context and complain
        super().destroy_node()
