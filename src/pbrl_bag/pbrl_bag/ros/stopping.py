"""Ends a node between two steps of its work, not in the middle of one, and always."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from pbrl_bag.errors import BagError

SIGNALS = (signal.SIGINT, signal.SIGTERM)
WAIT = 0.1  # [s] longest wait for something to do


def init_until_signal() -> threading.Event:
    """Start rclpy and return an event that SIGINT or SIGTERM sets.

    rclpy's own handlers shut the context down wherever the node happens to be; a message that has
    arrived by then can no longer be taken, one that is being published fails. Here the signal only
    asks for the end.

    Raises:
        BagError: the command line's `--ros-args` cannot be read.
    """
    stop = threading.Event()
    for number in SIGNALS:
        signal.signal(number, lambda *_: stop.set())
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:
        raise BagError(str(error)) from error
    return stop


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """End the block with KeyboardInterrupt at SIGINT or SIGTERM: for long work that looks at no event.

    Signals belong to the main thread; in any other the block runs to its end.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.default_int_handler) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def spin_in_order(node: Node, stop: threading.Event) -> None:
    """Handle what comes to a node, in the order in which it comes, until an event is set, or ROS is shut down.

    rclpy's usual executor lays a new set of everything to wait for whenever it has handled what was there: that is half
    of a fast node's work, and ticks come late by it.
    """
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok() and not stop.is_set():
            executor.spin_once(timeout_sec=WAIT)
    finally:
        executor.remove_node(node)
        executor.shutdown()


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
