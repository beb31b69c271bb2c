"""How the nodes of this package run: what comes is handled in order, until a signal; errors at start are one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rclpy.node import Node

from pbrl_bag.ros import running
from pbrl_bag.ros.parameters import declare
from pbrl_bag.ros.stopping import spin_in_order
from pbrl_control.errors import ControlError
from pbrl_planner.cart.settings import CartParameters, load_cart
from pbrl_planner.errors import PlannerError

AnyNode = TypeVar("AnyNode", bound=Node)


def declare_settings(node: Node) -> CartParameters:
    """Declare the parameter `settings`, and return what its file says.

    Raises:
        ControlError: there is no such file, or it is not as it should be.
    """
    path = declare(node, "settings", "", "YAML of planner, costmaps and controller; empty: cart.yaml as installed")
    return load_cart(path)


def run_node(name: str, make: Callable[[], AnyNode], busy: Callable[[AnyNode], bool] = lambda _: False) -> None:
    """Run a node until it is told to stop, handling what comes in order; see `pbrl_bag.ros.running.run_node`."""
    running.run_node(name, make, (ControlError, PlannerError), spin=spin_in_order, busy=busy)
