"""Declares the simulator's parameters so that a wrong one is one line, not a traceback and not ignored."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from bullet_sim.errors import SimError, nearest

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""Parameters that every node has, by the beginning of their names."""


def declare(node: Node, name: str, default: Any, text: str, limits: tuple[float, float] | None = None) -> Any:
    """Declare a parameter and return its value; an integer serves where a float is expected.

    Args:
        node: that has the parameter.
        name: of the parameter.
        default: its value if none is given; its type is the one expected.
        text: what it is, in a phrase.
        limits: least and greatest value of a number.

    Raises:
        SimError: a value of another type, or out of range.
    """
    # Type and range are checked here and not by rclpy, which would refuse `rate:=2` for not being 2.0.
    descriptor = ParameterDescriptor(description=text, read_only=True, dynamic_typing=True)
    if limits:
        descriptor.additional_constraints = f"from {limits[0]:.10g} to {limits[1]:.10g}"
    value = node.declare_parameter(name, default, descriptor).value
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    if type(value) is not type(default):
        raise SimError(f"{name}: expected {type(default).__name__} ({text}), got {value!r}")
    if limits and not limits[0] <= value <= limits[1]:
        raise SimError(f"{name}: expected {limits[0]:.10g} to {limits[1]:.10g} ({text}), got {value:.10g}")
    return value


def refuse_unknown(node: Node) -> None:
    """Raise a SimError for a parameter that was given but that the node does not have."""
    known = [name for name in node._parameters if not name.startswith(ROS_OWN)]
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            raise SimError(f"unknown parameter {name!r}: {nearest(name, known)}")
