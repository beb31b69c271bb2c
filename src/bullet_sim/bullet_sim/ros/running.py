"""How a simulator's node begins and ends."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bullet_sim.errors import SimError


class Runs(Protocol):
    """A node that knows how to run until it is told to stop."""

    def run(self) -> None:
        """Run."""

    def destroy_node(self) -> object:
        """End."""


def run_node(name: str, make: Callable[[threading.Event], Runs]) -> None:
    """Run a simulator's node; errors at start are one line and exit code 2.

    Args:
        name: of the node, in that line.
        make: the node, given the event that tells it to stop.
    """
    node = None
    fault = ""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        # rclpy's own handlers would shut the context down between a step and its publication.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make(stop)
        node.run()
    except ExternalShutdownException:
        pass
    except (SimError, rclpy_implementation.RCLError) as error:  # RCLError: --ros-args that cannot be read
        fault = " ".join(str(error).split())
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    if fault:
        print(f"{name}: {fault}", file=sys.stderr)
        sys.exit(2)
