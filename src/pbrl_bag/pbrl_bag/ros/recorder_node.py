"""Records topics into a bag, as they are on the wire: nothing is decoded."""

from __future__ import annotations

import fnmatch
import sys
import time
from datetime import datetime
from functools import partial

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from pbrl_bag.errors import BagError
from pbrl_bag.names import GLOBAL, canonical
from pbrl_bag.qos import Qos
from pbrl_bag.ros.conversions import message_class, profile_that_hears, qos_from_profile
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.stopping import init_until_signal, spin_until
from pbrl_bag.writer import BagWriter

DISCOVERY_SECONDS = 0.2
NOT_RECORDED = ["/parameter_events"]


class RecorderNode(Node):
    """Subscribes to every topic that is asked for, as soon as somebody publishes it.

    In a namespace that is what lies in it, and clock and transforms as they are remapped for it. Names stay as they
    are on the wire; patterns are of names as in the root namespace.

    Log time is the time of arrival: wall time, or the time of `/clock` under use_sim_time.

    Raises:
        BagError: the output folder exists or cannot be made.
    """

    def __init__(self, **options: object):
        super().__init__("recorder_node", **options)
        text = "bag folder to make, which must not exist yet; empty: recording_<date and time>"
        output = declare(self, "output", "", text)
        self.topics = declare(self, "topics", [], "topics to record, * matches any text; empty: all")
        self.exclude = declare(self, "exclude", NOT_RECORDED, "topics to leave out, * matches any text")
        refuse_unknown(self)
        self.output: str = output or datetime.now().strftime("recording_%Y_%m_%d-%H_%M_%S")
        self.writer = BagWriter(self.output)
        self._heard: dict[str, tuple[Subscription, QoSProfile]] = {}
        self._refused: set[str] = set()
        self._global = {self.resolve_topic_name(name) for name in GLOBAL}
        self._sim_time = bool(self.get_parameter("use_sim_time").value)
        self._diagnostics = Diagnostics(self, self._doing, numbers=self._numbers)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DISCOVERY_SECONDS, self.discover, clock=self._steady)
        self.discover()
        self.get_logger().info(f"recording into {self.output}")

    def _doing(self) -> str:
        return f"records into {self.output}" if self._heard else "waits for a topic that somebody publishes"

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
        return not self.topics or any(fnmatch.fnmatchcase(topic, pattern) for pattern in self.topics)

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
        if known and (known[1].reliability, known[1].durability) == (profile.reliability, profile.durability):
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
            self.destroy_subscription(known[0])
        callback = partial(self._record, topic, types[0])
        subscription = self.create_subscription(kind, topic, lambda data, info: callback(data, info), profile, raw=True)
        self._heard[topic] = (subscription, profile)

    def _record(self, topic: str, type_name: str, data: bytes, info: dict[str, int]) -> None:
        """Write one message as it came."""
        now = self.get_clock().now().nanoseconds if self._sim_time else time.time_ns()
        self.writer.write(topic, type_name, bytes(data), now, info.get("source_timestamp") or now)

    def drain(self) -> None:
        """Write what has arrived and waits in the middleware, so that a stop loses nothing heard before it."""
        for subscription, _ in self._heard.values():
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                    subscription.callback(*taken)


def main() -> None:
    """Record until SIGINT or SIGTERM."""
    node, fault = None, ""
    try:
        stop = init_until_signal()
        node = RecorderNode()
        spin_until(node, stop.is_set)
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
