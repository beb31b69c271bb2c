"""What a node tells of itself on `/diagnostics`, once a second: what it hears, how often, what it is at or waits for.

Read it with `ros2 topic echo /diagnostics`, rqt_robot_monitor or rqt_runtime_monitor. The topic is the usual one,
absolute, so that one monitor hears all robots; a status carries its node's full name.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from pbrl_bag.names import relative

PERIOD = 1.0
"""Between two messages [s] of a steady clock."""
SILENT = 2.0
"""Without a message for so long [s], a stream counts as silent."""

SAID = 5.0
"""Between two warnings about messages that cannot be used [s]."""

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Input:
    """One topic that a node hears.

    Args:
        topic: as in the root namespace.
        needed: whether the node can do nothing without it.
        stream: whether it keeps coming, rather than when something changes.
    """

    def __init__(self, topic: str, *, needed: bool, stream: bool) -> None:
        self.topic, self.needed, self.stream = topic, needed, stream
        self.count = 0
        self.newest: float | None = None
        self._told = (0, time.monotonic())

    def heard(self) -> None:
        """Take note of a message."""
        self.count += 1
        self.newest = time.monotonic()

    def rate(self, now: float) -> float:
        """Return messages a second since this was asked last [Hz]; `now` is of a steady clock [s]."""
        (count, then), self._told = self._told, (self.count, now)
        return (self._told[0] - count) / max(now - then, 1e-9)


class Diagnostics:
    """Tells how a node is, and counts what it hears.

    Args:
        node: that tells.
        doing: returns what it is at, or waits for, in a phrase; empty: nothing to say.
        trouble: returns what is wrong, in a phrase; empty: nothing.
        numbers: returns what else a user needs, by name.
        runs_in: node whose executor tells; the node's own if left out.
    """

    def __init__(
        self,
        node: Node,
        doing: Callable[[], str] = str,
        trouble: Callable[[], str] = str,
        numbers: Callable[[], Mapping[str, object]] = dict,
        runs_in: Node | None = None,
    ) -> None:
        self._node, self._doing, self._trouble, self._numbers = node, doing, trouble, numbers
        self._inputs: dict[str, Input] = {}
        self._alone = True
        self._out = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        (runs_in or node).create_timer(PERIOD, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def input(self, topic: str, *, needed: bool = True, stream: bool = True) -> Input:
        """Return the account of a topic, to be told of every message; see `Input`."""
        return self._inputs.setdefault(topic, Input(topic, needed=needed, stream=stream))

    def subscribe(
        self,
        kind: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        *,
        needed: bool = True,
        refuses: tuple[type[Exception], ...] = (),
        events: SubscriptionEventCallbacks | None = None,
    ) -> Subscription:
        """Subscribe the node to a topic of its namespace, and keep account of it.

        Args:
            kind: message class.
            topic: relative to the namespace; what is global is absolute.
            callback: what is done with a message.
            qos: as for any subscription; what is latched comes when it changes, and is not missed when it does not.
            needed: whether the node can do nothing without it.
            refuses: errors that `callback` raises of a message that cannot be used; it is left aside with a warning.
            events: what is done where a publisher does not match; None: rclpy warns.
        """
        stream = qos.durability != DurabilityPolicy.TRANSIENT_LOCAL
        entry = self.input("/" + topic.removeprefix("/"), needed=needed, stream=stream)

        def counted(message: Any) -> None:
            entry.heard()
            try:
                callback(message)
            except refuses as error:
                told = " ".join(str(error).split())
                self._node.get_logger().warning(f"{entry.topic}: left aside: {told}", throttle_duration_sec=SAID)

        return self._node.create_subscription(kind, relative(topic), counted, qos, event_callbacks=events)

    def status(self, now: float) -> DiagnosticStatus:
        """Return the status at a time of the steady clock [s]; rates are those since it was asked last."""
        values = {name: _text(value) for name, value in self._numbers().items()}
        missing, silent = [], []
        for each in list(self._inputs.values()):  # a listener's thread may add to them
            rate = each.rate(now)
            age = None if each.newest is None else max(now - each.newest, 0.0)
            if age is None and each.needed:
                missing.append(each.topic)
            elif age is not None and each.needed and each.stream and age > SILENT:
                silent.append(f"{each.topic} for {age:.0f} s")
            if each.stream:
                values[f"{each.topic} rate [Hz]"] = f"{rate:.1f}"
            values[f"{each.topic} age [s]"] = "never heard" if age is None else f"{age:.2f}"
        level, message = self._verdict(missing, silent)
        name = self._node.get_fully_qualified_name().lstrip("/")
        said = [KeyValue(key=key, value=value) for key, value in values.items()]
        return DiagnosticStatus(level=level, name=name, message=message, values=said)

    def _verdict(self, missing: list[str], silent: list[str]) -> tuple[bytes, str]:
        """Return the level and the sentence: the worst that there is."""
        trouble = self._trouble() or self._namesake()
        if trouble:
            return ERROR, trouble
        if silent:
            return ERROR, f"nothing of {', '.join(silent)}"
        if missing:
            return WARN, f"waits for {', '.join(missing)}"
        return OK, self._doing() or "ok"

    def _namesake(self) -> str:
        """Return that another node has this one's name, in a sentence; empty where none has.

        Both would command the same robot, and each would hear the answers to the other's requests.
        """
        own = (self._node.get_name(), self._node.get_namespace())
        count = self._node.get_node_names_and_namespaces().count(own)
        if count < 2:
            self._alone = True
            return ""
        trouble = f"{count} nodes are called {self._node.get_fully_qualified_name()}: stop one, or rename it"
        if self._alone:
            self._alone = False
            self._node.get_logger().error(trouble)
        return trouble

    def _tell(self) -> None:
        message = DiagnosticArray(status=[self.status(time.monotonic())])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._out.publish(message)


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
