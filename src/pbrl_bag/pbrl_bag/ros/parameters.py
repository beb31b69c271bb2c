"""Declares node parameters so that a wrong one is one line, not a traceback and not ignored."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from pbrl_bag.errors import BagError
from pbrl_bag.validation import nearest


def declare(node: Node, name: str, default: Any, text: str, limits: tuple[float, float] | None = None) -> Any:
    """Declare a parameter and return its value.

    An integer serves where a float is expected, and empty texts in a list count as none: ROS
    cannot say an empty list on a command line.

    Args:
        node: that has the parameter.
        name: of the parameter.
        default: its value if none is given; its type is the one expected.
        text: what it is, in a phrase.
        limits: least and greatest value of a float.

    Raises:
        BagError: a value of another type, or out of range.
    """
    # Type and range are checked here and not by rclpy, which would refuse `rate:=2` for not being 2.0.
    descriptor = ParameterDescriptor(description=text, read_only=True, dynamic_typing=True)
    if limits:
        descriptor.additional_constraints = f"from {limits[0]:g} to {limits[1]:g}"
    value = node.declare_parameter(name, [""] if default == [] else default, descriptor).value
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if isinstance(default, list):
        return _texts(name, value)
    if type(value) is not type(default):
        raise BagError(f"{name}: expected {type(default).__name__} ({text}), got {value!r}")
    if limits and not limits[0] <= value <= limits[1]:
        raise BagError(f"{name}: expected {limits[0]:g} to {limits[1]:g} ({text}), got {value:g}")
    return value


def refuse_unknown(node: Node) -> None:
    """Raise a BagError for a parameter that was given but that the node does not have."""
    known = [name for name in node._parameters if not name.startswith(("use_sim_time", "qos_overrides"))]
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith("qos_overrides"):
            raise BagError(f"unknown parameter {name!r}: {nearest(name, known)}")


def _texts(name: str, value: Any) -> list[str]:
    """Return a list of texts without its empty entries."""
    if not isinstance(value, list | tuple) or not all(isinstance(entry, str) for entry in value):
        raise BagError(f"{name}: expected a list of texts like ['/a', '/b'], got {value!r}")
    return [entry for entry in value if entry]
