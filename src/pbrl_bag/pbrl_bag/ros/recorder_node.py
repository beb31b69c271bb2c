"""Records topics into a bag, as they are on the wire: nothing is decoded. A long recording is several files."""

from __future__ import annotations

import fnmatch
import math
import sys
import threading
import time
from dataclasses import dataclass
from datetime import datetime
from operator import itemgetter

import rclpy
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from pbrl_bag.errors import BagError
from pbrl_bag.names import GLOBAL, canonical, hidden
from pbrl_bag.qos import Qos
from pbrl_bag.ros.conversions import message_class, profile_that_hears, qos_from_profile
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.stopping import init_until_signal
from pbrl_bag.writer import BagWriter

DISCOVERY_SECONDS = 0.2
NOT_RECORDED = ["/parameter_events"]
LISTENS, ATTENDS = 0.005, 0.05
"""What has arrived is written every so often, and timers and requests are looked after every so often [s]."""


class Unattended(CallbackGroup):
    """Subscriptions of which an executor takes no notice: their messages are taken without it.

    To wait anew, after each message, for all that may come is two thirds of what recording costs.
    """

    def can_execute(self, entity: object) -> bool:
        """Return no."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return no."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing: none has begun."""


@dataclass(frozen=True)
class Heard:
    """A topic that is recorded.

    Attributes:
        type_name: of its messages.
        subscription: whose messages wait in the middleware.
        profile: asked for.
    """

    type_name: str
    subscription: Subscription
    profile: QoSProfile


class RecorderNode(Node):
    """Subscribes to every topic that is asked for, as soon as somebody publishes it.

    In a namespace that is what lies in it, and clock and transforms as they are remapped for it. Names stay as they
    are on the wire; patterns are of names as in the root namespace.

    Log time is the time of arrival: wall time, or the time of `/clock` under use_sim_time. What comes before the first
    word of that clock waits in the middleware: it has no time yet.

    Raises:
        BagError: the output folder exists or cannot be made.
    """

    def __init__(self, **options: object):
        super().__init__("recorder_node", **options)
        text = "bag folder to make, which must not exist yet; empty: recording_<date and time>"
        output = declare(self, "output", "", text)
        self.topics = declare(self, "topics", [], "topics to record, * matches any text; empty: all but hidden ones")
        self.exclude = declare(self, "exclude", NOT_RECORDED, "topics to leave out, * matches any text")
        refuse_unknown(self)
        self.output: str = output or datetime.now().strftime("recording_%Y_%m_%d-%H_%M_%S")
        self.writer = BagWriter(self.output)
        self._heard: dict[str, Heard] = {}
        self._unattended = Unattended()
        self._refused: set[str] = set()
        self._global = {self.resolve_topic_name(name) for name in GLOBAL}
        self._sim_time = bool(self.get_parameter("use_sim_time").value)
        self._diagnostics = Diagnostics(self, self._doing, numbers=self._numbers)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DISCOVERY_SECONDS, self.discover, clock=self._steady)
        self.discover()
        self.get_logger().info(f"recording into {self.output}")

    def _doing(self) -> str:
        if self._timeless():
            return "waits for /clock (use_sim_time)"
        return f"records into {self.output}" if self._heard else "waits for a topic that somebody publishes"

    def _timeless(self) -> bool:
        """Tell whether it goes by a clock that has not been heard yet."""
        return self._sim_time and self.get_clock().now().nanoseconds == 0

    def _numbers(self) -> dict[str, object]:
        return {"topics": len(self._heard), "left out": len(self._refused), "messages": self.writer.message_count}

    def wants(self, topic: str) -> bool:
        """Tell whether a topic is to be recorded, by its name on the wire."""
        own = canonical(topic, self.get_namespace())
        if own is None and topic not in self._global:
            return False
        topic = own or topic
        if any(fnmatch.fnmatchcase(topic, pattern) for pattern in self.exclude):
            return False
        if not self.topics:
            return not hidden(topic)  # as `ros2 bag record`
        return any(fnmatch.fnmatchcase(topic, pattern) for pattern in self.topics)

    def discover(self) -> None:
        """Subscribe to what is new, and again where publishers came that the old request keeps out."""
        for topic, types in self.get_topic_names_and_types():
            if not self.wants(topic) or topic in self._refused:
                continue
            offered = [
                (info.topic_type, qos_from_profile(info.qos_profile))
                for info in self.get_publishers_info_by_topic(topic)
            ]
            if offered:
                self._subscribe(topic, types, [qos for _, qos in offered])

    def _subscribe(self, topic: str, types: list[str], offered: list[Qos]) -> None:
        """Subscribe to one topic so that all of its publishers are heard."""
        profile = profile_that_hears(offered)
        known = self._heard.get(topic)
        if known and _asks(known.profile) == _asks(profile):
            return
        try:
            if len(types) > 1:
                raise BagError(f"expected one type, got {' and '.join(types)}")
            kind = message_class(types[0])
            self.writer.add_topic(topic, types[0], offered)
        except BagError as error:
            self._refused.add(topic)
            self.get_logger().warning(f"{topic} is not recorded: {error}")
            return
        if known:
            self.destroy_subscription(known.subscription)
        subscription = self.create_subscription(
            kind, topic, lambda _: None, profile, callback_group=self._unattended, raw=True
        )
        self._heard[topic] = Heard(types[0], subscription, profile)

    def listen(self, stop: threading.Event) -> None:
        """Write what arrives until an event is set, or ROS is shut down.

        Raises:
            BagError: it cannot be written.
        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        attended = -math.inf
        try:
            while rclpy.ok() and not stop.is_set():
                self.drain()
                if self._sim_time or time.monotonic() > attended + ATTENDS:  # where the time is a message as well
                    executor.spin_once(timeout_sec=0.0)
                    attended = time.monotonic()
                time.sleep(LISTENS)
        finally:
            executor.remove_node(self)
            executor.shutdown()

    def drain(self) -> None:
        """Write what has arrived and waits in the middleware, in the order in which it was sent, once there is a time.

        Raises:
            BagError: it cannot be written.
        """
        if self._timeless():
            return
        arrived: list[tuple[int, str, bytes]] = []
        for topic, heard in self._heard.items():
            waiting = heard.subscription.handle
            with waiting:
                while (taken := waiting.take_message(heard.subscription.msg_type, True)) is not None:
                    data, info = taken
                    arrived.append((info.get("source_timestamp") or 0, topic, bytes(data)))
        for sent, topic, data in sorted(arrived, key=itemgetter(0)):
            now = self.get_clock().now().nanoseconds if self._sim_time else time.time_ns()
            self.writer.write(topic, self._heard[topic].type_name, data, now, sent or now)


def _asks(profile: QoSProfile) -> tuple[object, object]:
    """Return what of a profile decides whom it hears."""
    return profile.reliability, profile.durability


def main() -> None:
    """Record until SIGINT or SIGTERM."""
    node, fault = None, ""
    try:
        stop = init_until_signal()
        node = RecorderNode()
        node.listen(stop)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except BagError as error:
        fault = str(error)
    finally:
        if node is not None:
            fault = _finish(node) or fault
        rclpy.try_shutdown()
    if fault:
        print(f"recorder_node: {' '.join(fault.split())}", file=sys.stderr)
        raise SystemExit(2)


def _finish(node: RecorderNode) -> str:
    """Close the bag, so that it has its footer, whatever ended the recording; return what is wrong, or nothing."""
    try:
        node.drain()
        node.writer.close()
    except BagError as error:
        return str(error)
    finally:
        node.destroy_node()
    print(f"recorded {node.writer.message_count} messages into {node.output}", file=sys.stderr)
    return ""


if __name__ == "__main__":
    main()
