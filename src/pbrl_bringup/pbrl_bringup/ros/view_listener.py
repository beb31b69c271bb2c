"""Hears a running graph for the viewer: subscribes to what it wants, hands every message on."""

# rclpy has no types of its own.
# mypy: disable-error-code="no-untyped-call,attr-defined"

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Any, Self

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from pbrl_bag.errors import BagError
from pbrl_bag.names import canonical
from pbrl_bag.ros.conversions import message_class, profile_that_hears, qos_from_profile

DISCOVERY_SECONDS = 0.2


class ViewListener:
    """A node in a thread of its own; a context manager.

    Args:
        wants: tells which topics to hear.
        hear: takes topic and message, in the thread; a `BagError` is logged once a topic.
        domain: ROS_DOMAIN_ID of the graph; None: the environment's.
        namespace: of the robot; `wants` and `hear` are given names as they are in the root.
    """

    def __init__(
        self,
        wants: Callable[[str], bool],
        hear: Callable[[str, Any], None],
        domain: int | None = None,
        namespace: str = "",
    ) -> None:
        self._wants, self._hear, self._namespace = wants, hear, namespace
        self._context = Context()
        # Ctrl-C is the server's.
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("pbrl_view", context=self._context, enable_rosout=False)
        self._heard: dict[str, tuple[Any, Any]] = {}
        self._refused: set[str] = set()
        self._node.create_timer(DISCOVERY_SECONDS, self._discover, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="pbrl_view", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _discover(self) -> None:
        """Subscribe to what is new, and again where a publisher came whom the old request keeps out."""
        for topic, types in self._node.get_topic_names_and_types():
            own = canonical(topic, self._namespace)
            if topic in self._refused or own is None or not self._wants(own):
                continue
            infos = self._node.get_publishers_info_by_topic(topic)
            profile = profile_that_hears([qos_from_profile(each.qos_profile) for each in infos])
            known = self._heard.get(topic)
            asked = (profile.reliability, profile.durability)
            if not infos or (known and (known[1].reliability, known[1].durability) == asked):
                continue
            try:
                if len(types) != 1:
                    raise BagError(f"expected one type, got {' and '.join(types)}")
                wanted = message_class(types[0])
            except BagError as error:
                self._refuse(topic, error)
                continue
            if known:
                self._node.destroy_subscription(known[0])
            self._heard[topic] = (
                self._node.create_subscription(wanted, topic, partial(self._take, topic, own), profile),
                profile,
            )

    def _take(self, topic: str, own: str, message: Any) -> None:
        try:
            self._hear(own, message)
        except BagError as error:
            self._refuse(topic, error)

    def _refuse(self, topic: str, error: BagError) -> None:
        if topic not in self._refused:
            self._refused.add(topic)
            self._node.get_logger().warning(f"{topic} is not shown: {' '.join(str(error).split())}")

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()
