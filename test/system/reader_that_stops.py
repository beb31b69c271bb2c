"""A node that subscribes to every topic there is, reliably where it can be, says so, and from then on never reads."""

from __future__ import annotations

import importlib
import os
import signal
import sys

import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy


def main() -> None:
    """Subscribe to all but what is told to leave out, wait for the first message, and stop itself."""
    rclpy.init()
    node = rclpy.create_node("reader_that_stops", enable_rosout=False)
    wanted = int(sys.argv[1])
    heard: set[str] = set()
    taken: dict[str, object] = {}
    while len(heard) < wanted:
        for topic, (kind, *_) in node.get_topic_names_and_types():
            if topic in taken or topic in ("/rosout", "/parameter_events"):
                continue
            package, _, name = kind.split("/")
            offered = node.get_publishers_info_by_topic(topic)
            reliable = bool(offered) and all(
                each.qos_profile.reliability == ReliabilityPolicy.RELIABLE for each in offered
            )
            quality = QoSProfile(
                history=HistoryPolicy.KEEP_ALL,
                reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            )
            message = getattr(importlib.import_module(f"{package}.msg"), name)
            taken[topic] = node.create_subscription(message, topic, lambda _, at=topic: heard.add(at), quality)
        rclpy.spin_once(node, timeout_sec=0.05)
    print(len(heard), flush=True)
    os.kill(os.getpid(), signal.SIGSTOP)


if __name__ == "__main__":
    main()
