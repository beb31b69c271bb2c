"""Plays a bag: publishes its messages as they were, when they were."""

from __future__ import annotations

import sys
import threading
import time

import rclpy
from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from pbrl_bag.errors import BagError
from pbrl_bag.mcap_file import RawMessage
from pbrl_bag.names import canonical, in_namespace, namespace_of, relative
from pbrl_bag.playback import CLOCK_TOPIC, Schedule, latched_before, load_bag
from pbrl_bag.ros.conversions import message_class, profile_from_qos
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.stopping import init_until_signal

CLOCK_PERIOD = 0.01  # [s] of wall time between two messages on /clock
LONGEST_SLEEP = 0.05  # [s]


class PlayerNode(Node):
    """Publishes the topics of a bag with the QoS they were recorded with.

    In a namespace they are published in it, whatever namespace they were recorded in; in the root as they were.

    Raises:
        BagError: the bag cannot be read, a parameter is out of range, a message type is not sourced.
    """

    def __init__(self, **options: object):
        super().__init__("player_node", **options)
        path = declare(self, "bag", "", "bag folder or .mcap file to play")
        rate = declare(self, "rate", 1.0, "seconds of the bag per second", (1e-3, 1e3))
        offset = declare(self, "start_offset", 0.0, "seconds to leave out", (0.0, 1e9))
        loop = declare(self, "loop", False, "begin again at the end")
        self.awaited = declare(self, "wait_for", [], "topics that need a subscriber before playing begins")
        refuse_unknown(self)
        if not path:
            raise BagError("bag: expected a bag folder or .mcap file, got none; give -p bag:=FOLDER")
        self.bag = load_bag(path)
        self._recorded_in = namespace_of(self.bag.topics, path) if self.get_namespace() != "/" else ""
        self.schedule = Schedule([one.log_time for one in self.bag.messages], rate, offset, loop)
        self._publishers_by_topic = {name: self._publisher(name) for name in self.bag.topics}
        for topic in self.awaited:
            if topic not in self._publishers_by_topic:
                raise BagError(f"wait_for: expected a topic of the bag, got {topic!r}")
        # A robot in a namespace has a clock of its own, or goes by the one of all.
        has_clock = not {CLOCK_TOPIC, in_namespace(CLOCK_TOPIC, self._recorded_in)}.isdisjoint(self.bag.topics)
        self._clock_publisher = None if has_clock else self.create_publisher(Clock, CLOCK_TOPIC, 10)
        for note in self.bag.notes:
            self.get_logger().warning(note)

    def _publisher(self, name: str) -> Publisher:
        """Return a publisher as the topic had when it was recorded."""
        topic = self.bag.topics[name]
        published = canonical(name, self._recorded_in) or name
        if self.get_namespace() != "/":
            published = relative(published)
        return self.create_publisher(message_class(topic.type), published, profile_from_qos(topic.qos))

    def ready(self) -> bool:
        """Tell whether every topic that playing waits for has a subscriber."""
        return all(self._publishers_by_topic[name].get_subscription_count() for name in self.awaited)

    def play(self, stop: threading.Event) -> int:
        """Publish everything in its time and return how many messages that were; `stop` ends it early."""
        if not self.ready():
            self.get_logger().info(f"waiting for a subscriber of {', '.join(self.awaited)}")
        while not (stop.is_set() or self.ready()):
            stop.wait(LONGEST_SLEEP)
        for message in latched_before(self.bag, self.schedule.first):
            self._publish(message)
        count, start, ticked = 0, time.monotonic(), -CLOCK_PERIOD
        longest = CLOCK_PERIOD if self._clock_publisher else LONGEST_SLEEP
        while not (stop.is_set() or self.schedule.finished):
            elapsed = time.monotonic() - start
            if elapsed - ticked >= CLOCK_PERIOD:
                self._tick(self.schedule.clock(elapsed))
                ticked = elapsed
            for i in self.schedule.due(elapsed):
                self._publish(self.bag.messages[i])
                count += 1
            stop.wait(min(self.schedule.wait(time.monotonic() - start), longest))
        return count

    def settle(self) -> None:
        """Wait until reliable subscribers have everything, so that leaving loses nothing."""
        for publisher in self._publishers_by_topic.values():
            publisher.wait_for_all_acked(Duration(seconds=2))

    def _publish(self, message: RawMessage) -> None:
        self._publishers_by_topic[message.topic].publish(message.data)

    def _tick(self, now: int) -> None:
        """Publish the bag's time, unless the bag has a clock of its own."""
        if self._clock_publisher:
            self._clock_publisher.publish(Clock(clock=Time(sec=now // 10**9, nanosec=now % 10**9)))


def main() -> None:
    """Play a bag to its end, or until SIGINT or SIGTERM."""
    node = None
    try:
        stop = init_until_signal()
        node = PlayerNode()
        count = node.play(stop)
        if not stop.is_set():
            node.settle()
        print(f"played {count} messages", file=sys.stderr)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except BagError as error:
        print(f"player_node: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
