"""A hand that pushes furniture when it is asked to, as a node: the service `/push`, and the streams of a robot's wrist.

What Krang does with arms and wheels, a hand does in a second: whoever chooses pushes can try them here. Simulated time
goes on only while a push does, at `rate` simulated seconds a second.
"""

from __future__ import annotations

import threading
import time
from typing import Any

from pbrl_msgs.srv import PushObject
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from bullet_sim.errors import SimError
from bullet_sim.ros.diagnostics import PaceDiagnostics
from bullet_sim.ros.latched import LatchedPublisher
from bullet_sim.ros.names import relative
from bullet_sim.ros.parameters import declare, refuse_unknown
from bullet_sim.ros.running import run_node
from bullet_sim.scene import load_scene
from krang_sim.errors import KrangError
from krang_sim.hand_session import HandSession, straight_push
from krang_sim.messages import LATCHED, message_types, to_messages
from krang_sim.observations import ClockTick, Observation

STREAM_QOS = QoSProfile(depth=1000)
TOPICS = ("/clock", "/scene", "/grasps", "/wrist_ft/left")


class HandNode(Node):
    """Does the pushes that are asked of it, and publishes what is seen and felt.

    Args:
        stop: when it is set, a push that is under way is given up.

    Raises:
        SimError: a wrong parameter, or a scene that cannot be built.
    """

    def __init__(self, stop: threading.Event, **options: Any) -> None:
        super().__init__("hand_node", **options)
        scene = declare(self, "scene", "locked_caster", "scene file, or the name of a scene of the workspace")
        seed = declare(self, "seed", 0, "seed of every random draw", (0, 2**31 - 1))
        rate = "simulated seconds per second; 0: as fast as possible"
        self._rate: float = declare(self, "rate", 1.0, rate, (0.0, 1000.0))
        refuse_unknown(self)
        self._stop, self._origin, self._at, self._pushes = stop, time.monotonic(), 0.0, 0
        self._session = HandSession(load_scene(scene), seed=seed, publish=self._publish)
        types = message_types(self._session.tagged)
        wanted = {*TOPICS, "/ar_tags/left_gripper/pose", *(f"/ar_tags/{name}/pose" for name in self._session.tagged)}
        self._outputs = {
            topic: LatchedPublisher(self, kind, topic)
            if topic in LATCHED
            else self.create_publisher(kind, relative(topic), STREAM_QOS)
            for topic, kind in types.items()
            if topic in wanted
        }
        self._publish(self._session.latched())
        self.create_service(PushObject, "push", self._push)
        # Its time stands still between pushes: no pace is too slow.
        self._diagnostics = PaceDiagnostics(self, lambda: self._at, 0.0, lambda: self._pushes)

    def _push(self, request: PushObject.Request, response: PushObject.Response) -> PushObject.Response:
        self._pushes += 1
        contact, way = request.contact_point, request.direction
        self._origin = time.monotonic() - (self._at / self._rate if self._rate else 0.0)
        try:
            push = straight_push(
                request.object, (contact.x, contact.y), (way.x, way.y), request.speed, request.duration
            )
            status = self._session.push(push)
        except SimError as error:
            status = " ".join(str(error).split())
        response.success, response.message = status == "done", status
        return response

    def _publish(self, news: list[Observation]) -> None:
        for observation in news:
            for topic, message in to_messages(observation):
                self._outputs[topic].publish(message)
        self._at = next((each.time for each in news if isinstance(each, ClockTick)), self._at)
        if self._pushes:
            self._diagnostics.keep_up()  # a push is made in a callback
        due = self._origin + self._at / self._rate if self._rate else 0.0
        if self._stop.wait(max(due - time.monotonic(), 0.0)):
            raise KrangError("the simulator was stopped in the middle of the push")

    def run(self) -> None:
        """Push when asked, until it is told to stop."""
        spinner = SingleThreadedExecutor()
        spinner.add_node(self)
        try:
            while not self._stop.is_set() and self.context.ok():
                spinner.spin_once(timeout_sec=0.1)
        finally:
            spinner.remove_node(self)
            spinner.shutdown()

    def destroy_node(self) -> None:
        """End Bullet with the node."""
        self._session.close()
        super().destroy_node()


def main() -> None:
    """Run the node."""
    run_node("hand_node", HandNode)


if __name__ == "__main__":
    main()
