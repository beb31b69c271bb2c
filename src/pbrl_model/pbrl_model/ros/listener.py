"""Hears the topics of a recording, from whoever publishes them, and keeps the bytes that may still be asked for."""

from __future__ import annotations

import contextlib
import math
import threading
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.errors import BagError
from pbrl_bag.names import canonical, relative
from pbrl_bag.roles import GRASPS_TOPIC, SCENE_TOPIC
from pbrl_bag.ros.conversions import message_class, profile_that_hears, qos_from_profile
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.types import Recording
from pbrl_model.ros.heard import Heard, Message, recording_of

DISCOVERY_SECONDS = 0.1
MEMORY = 200.0
"""Kept at most [MB]: an hour of a robot that holds things with two wrists."""


class RecordingListener(Node):
    """Subscribes to every topic that plays a role in a recording, as soon as somebody publishes it.

    Topics are those of its namespace, and are called as in the root one: a robot beside ours is not learned from.

    A node of its own with an executor of its own in a thread, so that a fit in the other node's callback does not
    make it deaf. Messages are kept as bytes: some 60 kB for a second of a robot with two wrists. What lies between two
    holds is forgotten, and the oldest of all beyond `memory`; see `Heard`.

    Args:
        name: of the node.
        context: the one to join; None: the default one.
        memory: kept at most [MB].
        namespace: of the robot.
    """

    def __init__(
        self,
        name: str,
        context: Context | None = None,
        memory: float = MEMORY,
        namespace: str = "/",
    ):
        super().__init__(
            name,
            context=context,
            namespace=namespace,
            # A process is told what its node is called by `__node`, which would hold for all nodes in it.
            cli_args=["--ros-args", "-r", f"__node:={name}"],
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._builder = RecordingBuilder()
        self._heard = Heard(round(memory * 1e6))
        self._last: dict[str, tuple[type, bytes]] = {}
        self._subscriptions_by_topic: dict[str, tuple[Subscription, QoSProfile]] = {}
        self._refused: set[str] = set()
        self._diagnostics: Diagnostics | None = None
        self.create_timer(DISCOVERY_SECONDS, self.discover, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)

    def start(self) -> None:
        """Begin to listen, in a thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop listening and leave the graph."""
        self._executor.shutdown()
        if self._thread.is_alive():
            self._thread.join()
        self.destroy_node()

    def tell(self, diagnostics: Diagnostics) -> None:
        """Keep account of what is heard in a node's diagnostics."""
        diagnostics.input(SCENE_TOPIC, stream=False)
        diagnostics.input(GRASPS_TOPIC, stream=False)
        self._diagnostics = diagnostics

    def count(self) -> int:
        """Return how many messages have been heard, forgotten ones too."""
        return self._heard.count

    def newest(self) -> float:
        """Return the newest stamp that has been heard [s], minus infinity before the first."""
        return self._heard.newest()

    def last(self, topic: str) -> Any | None:
        """Return the last message of a topic, or None."""
        entry = self._last.get(topic)
        return None if entry is None else deserialize_message(entry[1], entry[0])

    def follow(self) -> None:
        """Keep what comes from now on for `fresh`, too."""
        self._heard.follow()

    def fresh(self) -> list[Message]:
        """Return what has been heard since the last call; see `follow`."""
        return self._heard.fresh()

    def recording(self, since: float = -math.inf) -> Recording:
        """Return what has been heard so far and not been forgotten.

        Args:
            since: what was let go of before need not be complete [s].

        Raises:
            BagError: a topic is missing or a stream is malformed.
        """
        return recording_of(self.kept(), since)

    def kept(self) -> list[Message]:
        """Return the messages that have been heard so far and not been forgotten; see `recording_of`."""
        return self._heard.kept()

    def discover(self) -> None:
        """Subscribe to what is new, and again where a publisher came whom the old request keeps out."""
        for found, types in self.get_topic_names_and_types():
            topic = canonical(found, self.get_namespace())
            if topic is None or topic in self._refused or not self._builder.wants(topic):
                continue
            offered = [qos_from_profile(info.qos_profile) for info in self.get_publishers_info_by_topic(found)]
            if offered:
                self._subscribe(topic, types, profile_that_hears(offered))

    def _subscribe(self, topic: str, types: list[str], profile: QoSProfile) -> None:
        known = self._subscriptions_by_topic.get(topic)
        if known and (known[1].reliability, known[1].durability) == (profile.reliability, profile.durability):
            return
        try:
            if len(types) != 1:
                raise BagError(f"expected one type, got {' and '.join(types)}")
            kind = message_class(types[0])
        except BagError as error:
            self._refused.add(topic)
            self.get_logger().warning(f"{topic} is not heard: {error}")
            return
        if known:
            self.destroy_subscription(known[0])
        keep = partial(self._keep, topic, kind)
        subscription = self.create_subscription(kind, relative(topic), keep, profile, raw=True)
        self._subscriptions_by_topic[topic] = (subscription, profile)

    def _keep(self, topic: str, kind: type, data: bytes) -> None:
        self._last[topic] = (kind, data)
        if self._diagnostics is not None:  # a robot need not have both wrists, nor push all the time
            self._diagnostics.input(topic, needed=False).heard()
        for note in self._heard.add(Message(topic, kind, data)):
            self.get_logger().warning(note)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()
