"""A client of a running graph: waits for what nodes offer, calls their services, keeps latched messages."""

# rclpy has no types of its own.
# mypy: disable-error-code="no-untyped-call,attr-defined"

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection
from types import TracebackType
from typing import Any, Self

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from pbrl_bag.names import in_namespace
from pbrl_bringup.errors import BringupError
from pbrl_bringup.middleware import on_this_machine

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
SPIN = 0.05  # [s] how long one turn waits; bounds how late the end of a node is noticed


class Heard:
    """The last message of a topic, when it came [ns of wall time], and how many there have been."""

    def __init__(self) -> None:
        self.message: Any = None
        self.count = 0
        self.time_ns = 0
        self.subscription: Any = None

    def __call__(self, message: Any) -> None:
        """Take a message; the subscription's callback."""
        self.message = message
        self.count += 1
        self.time_ns = time.time_ns()


class GraphClient:
    """One small node beside a graph, in the graph's domain.

    Args:
        domain: ROS_DOMAIN_ID of the graph.
        check: called while waiting; raises where a node of the graph has died.
        namespace: of the graph; names of topics and services are given as they are in the root.
    """

    def __init__(self, domain: int, check: Callable[[], None] = lambda: None, namespace: str = "") -> None:
        os.environ.update(on_this_machine(os.environ))
        self._check = check
        self._namespace = namespace
        self._context = Context()
        # Ctrl-C stays with Python: the caller stops its nodes in order.
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("pbrl_client", context=self._context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for_none_of(self, names: Collection[str], seconds: float) -> None:
        """Look for a while whether nodes of some names are there already.

        Raises:
            BringupError: one is.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            there = {(name, space) for name, space in self._node.get_node_names_and_namespaces()}
            for name in names:
                if (name, self._namespace or "/") in there:
                    raise BringupError(
                        f"a node {self.on_the_wire('/' + name)} runs in this domain already; stop the other graph, or "
                        f"give this one a --namespace or --domain of its own"
                    )
            self._executor.spin_once(timeout_sec=SPIN)

    def listen(self, kind: type, topic: str, *, latched: bool = True) -> Heard:
        """Subscribe, and return what holds the last message."""
        heard = Heard()
        qos = LATCHED if latched else QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        heard.subscription = self._node.create_subscription(kind, self.on_the_wire(topic), heard, qos)
        return heard

    def on_the_wire(self, name: str) -> str:
        """Return the name that a topic or service of the graph has in its namespace."""
        return in_namespace(name, self._namespace)

    def forget(self, heard: Heard) -> None:
        """Stop listening."""
        self._node.destroy_subscription(heard.subscription)

    def wait_for_topic(self, topic: str, timeout: float) -> None:
        """Wait until a node publishes a topic."""
        wanted = self.on_the_wire(topic)
        self.wait_until(lambda: self._node.count_publishers(wanted) > 0, timeout, f"nobody publishes {wanted}")

    def wait_for_subscribers(self, topic: str, count: int, timeout: float) -> None:
        """Wait until so many nodes subscribe to a topic."""
        wanted = self.on_the_wire(topic)
        complaint = f"{wanted} has fewer than {count} subscribers"
        self.wait_until(lambda: self._node.count_subscribers(wanted) >= count, timeout, complaint)

    def wait_for_service(self, service: str, timeout: float) -> None:
        """Wait until a node offers a service."""
        wanted = self.on_the_wire(service)

        def offered() -> bool:
            return any(name == wanted for name, _ in self._node.get_service_names_and_types())

        self.wait_until(offered, timeout, f"nobody offers {wanted}")

    def call(self, kind: Any, service: str, request: Any, timeout: float) -> Any:
        """Call a service and return its response."""
        client = self._node.create_client(kind, self.on_the_wire(service))
        try:
            self.wait_until(client.service_is_ready, timeout, f"nobody offers {service}")
            future = client.call_async(request)
            self.wait_until(future.done, timeout, f"{service} has not answered")
            return future.result()
        finally:
            self._node.destroy_client(client)

    def stay(self) -> None:
        """Handle messages for ever; a node that dies or Ctrl-C ends it."""
        while True:
            self._check()
            self._executor.spin_once(timeout_sec=SPIN)

    def wait_until(self, condition: Callable[[], bool], timeout: float, complaint: str) -> None:
        """Handle messages until a condition holds.

        Raises:
            BringupError: it does not within `timeout` seconds, or a node has died.
        """
        deadline = time.monotonic() + timeout
        while not condition():
            self._check()
            if time.monotonic() > deadline:
                raise BringupError(f"{complaint} after {timeout:.0f} s; the nodes' logs say why")
            self._executor.spin_once(timeout_sec=SPIN)
