"""Latched topics of which every message counts, not only the last."""

from __future__ import annotations

from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bullet_sim.ros.names import relative

LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE = Duration(seconds=0.1)
"""Of the wall clock: what a full socket dropped is asked for and sent again in half of it (config/middleware)."""
NOT_AT_ALL = Duration()


class LatchedPublisher:
    """Publishes so that no message takes the place of one that is still on its way.

    A latched writer keeps one message, for late subscribers; more would tell them of holds that are long over. What a
    subscriber's full socket dropped is sent again from there, unless the next message has replaced it: a simulator that
    goes as fast as it can publishes the end of a hold milliseconds after its beginning. So the next one waits until the
    last has arrived everywhere. Who is frozen or dead is waited for once, until everybody has caught up.

    Args:
        node: that publishes.
        kind: message class.
        topic: its global name.
    """

    def __init__(self, node: Node, kind: type, topic: str) -> None:
        self._out = node.create_publisher(kind, relative(topic), LATCHED_QOS)
        self._arrived = True

    def publish(self, message: Any) -> None:
        """Publish a message, at the latest 0.1 s of the wall clock from now."""
        self._arrived = self._out.wait_for_all_acked(PATIENCE if self._arrived else NOT_AT_ALL)
        self._out.publish(message)
