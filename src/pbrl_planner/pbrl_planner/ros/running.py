"""How the nodes of this package run: what comes is handled in order, until a signal; errors at start are one line."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from pbrl_bag.errors import BagError
from pbrl_bag.ros.parameters import declare
from pbrl_bag.ros.stopping import WAIT, init_until_signal
from pbrl_control.errors import ControlError
from pbrl_control.installed import params_folder
from pbrl_control.settings import load_section
from pbrl_planner.cart.settings import CartParameters
from pbrl_planner.errors import PlannerError

AnyNode = TypeVar("AnyNode", bound=Node)


def declare_settings(node: Node) -> CartParameters:
    """Declare the parameter `settings`, and return what its file says.

    Raises:
        ControlError: there is no such file, or it is not as it should be.
    """
    path = declare(node, "settings", "", "YAML of planner, costmaps and controller; empty: cart.yaml as installed")
    file = Path(path) if path else params_folder("settings") / "cart.yaml"
    return load_section(file, CartParameters, "settings")


def run_node(name: str, make: Callable[[], AnyNode], busy: Callable[[AnyNode], bool] = lambda _: False) -> None:
    """Run a node until it is told to stop.

    Args:
        name: of it, for errors.
        make: it.
        busy: whether a thread of it cannot be stopped, and is not to be waited for.
    """
    node, code, thinking = None, 0, False
    try:
        stop = init_until_signal()
        node = make()
        _spin(node, stop)
    except (ControlError, BagError, PlannerError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        code = 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            thinking = busy(node)
            node.destroy_node()
        rclpy.try_shutdown()
    if thinking:  # Python would wait for the thread
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def _spin(node: Node, stop: threading.Event) -> None:
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok() and not stop.is_set():
            executor.spin_once(timeout_sec=WAIT)
    finally:
        executor.remove_node(node)
        executor.shutdown()
