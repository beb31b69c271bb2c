"""How a node begins and ends: until a signal; an error at start is one line and exit code 2."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from pbrl_bag.errors import BagError
from pbrl_bag.ros.stopping import init_until_signal, spin_until

AnyNode = TypeVar("AnyNode", bound=Node)


def handle_as_it_comes(node: Node, stop: threading.Event) -> None:
    """Spin a node until an event is set."""
    spin_until(node, stop.is_set)


def run_node(
    name: str,
    make: Callable[[], AnyNode],
    errors: tuple[type[Exception], ...] = (),
    *,
    spin: Callable[[AnyNode, threading.Event], None] = handle_as_it_comes,
    busy: Callable[[AnyNode], bool] = lambda _: False,
) -> None:
    """Run a node until it is told to stop, and exit.

    Args:
        name: of it, for errors.
        make: it.
        errors: that are said in a line when it is made, as well as `BagError`.
        spin: handles what comes until the event is set.
        busy: whether a thread of it cannot be stopped, and is not to be waited for.
    """
    node, code, thinking = None, 0, False
    try:
        stop = init_until_signal()
        node = make()
        spin(node, stop)
    except (BagError, *errors) as error:
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        code = 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            thinking = busy(node)
            node.destroy_node()
        rclpy.try_shutdown()
    if thinking:  # Python would wait for the thread, and learning can take minutes
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
