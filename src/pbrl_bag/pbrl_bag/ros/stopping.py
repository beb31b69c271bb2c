"""Ends a node between two steps of its work, not in the middle of one, and always."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

WAIT = 0.1  # [s] longest wait for something to do


def init_until_signal() -> threading.Event:
    """Start rclpy and return an event that SIGINT or SIGTERM sets.

    rclpy's own handlers shut the context down wherever the node happens to be; a message that has
    arrived by then can no longer be taken, one that is being published fails. Here the signal only
    asks for the end.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    return stop


def spin_until(node: Node, done: Callable[[], bool]) -> None:
    """Spin a node until `done()`, or until ROS is shut down.

    `rclpy.spin` waits without a limit. A signal can come between its look at the context and that wait; where
    nothing else happens any more (the simulator got the same signal) it then waits for ever.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok() and not done():
            executor.spin_once(timeout_sec=WAIT)
    finally:
        executor.remove_node(node)
        executor.shutdown()
