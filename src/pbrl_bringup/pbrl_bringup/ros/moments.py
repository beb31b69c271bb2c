"""A client that keeps when messages of a topic were sent and when they came."""

# rclpy has no types of its own.
# mypy: disable-error-code="no-untyped-call,arg-type"

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rclpy.qos import QoSProfile

from pbrl_bringup.ros.client import GraphClient

QUALITY = QoSProfile(depth=1000)  # messages wait while this process does something else


@dataclass
class Moments:
    """When each message left its writer, and when it came here [s of wall time]."""

    sent: list[float] = field(default_factory=list)
    came: list[float] = field(default_factory=list)


class MomentsClient(GraphClient):
    """A `GraphClient` that can keep moments too."""

    def moments(self, kind: type, topic: str, wanted: Callable[[], bool]) -> Moments:
        """Subscribe, and return what grows with each message that comes while it is `wanted`."""
        kept = Moments()

        def take(message: Any, info: dict[str, int]) -> None:
            if wanted():
                kept.sent.append(1e-9 * info["source_timestamp"])
                kept.came.append(1e-9 * info["received_timestamp"])

        self._node.create_subscription(kind, self.on_the_wire(topic), take, QUALITY)
        return kept
