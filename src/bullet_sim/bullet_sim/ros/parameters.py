"""Declares the simulator's parameters so that a wrong one is one line, not a traceback and not ignored."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from bullet_sim.errors import SimError, nearest

ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""Parameters that every node has, by the beginning of their names."""


def declare(
    node: Node,
    name: str,
    default: Any,
    text: str,
    limits: tuple[float, float] | None = None,
    choices: Iterable[str] = (),
) -> Any:
    """Declare a read-only parameter, with its type, sentence and bounds as `ros2 param describe` shows them.

    An integer serves where a float is expected.

    Args:
        node: that has the parameter.
        name: of the parameter.
        default: its value if none is given; its type is the one expected.
        text: what it is, in a phrase.
        limits: least and greatest value of a number.
        choices: texts of which it is one; none: any text.

    Returns:
        Its value, of the type of `default`.

    Raises:
        SimError: a value of another type, out of range, or not among the choices.
    """
    # Checked before it is declared: rclpy would refuse `rate:=2` for not being 2.0, and in words of its own.
    given = node._parameter_overrides.get(name)
    value = default if given is None else given.value
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    known = tuple(choices)
    if type(value) is not type(default):
        wanted = _listed(known) if known else type(default).__name__
        raise SimError(f"{name}: expected {wanted} ({text}), got {value!r}")
    descriptor = ParameterDescriptor(description=text, read_only=True)
    if limits:
        _bound(descriptor, default, limits)
        if not limits[0] <= value <= limits[1]:
            raise SimError(f"{name}: expected {descriptor.additional_constraints} ({text}), got {value:.10g}")
    if known:
        descriptor.additional_constraints = _listed(known)
        if value not in known:
            near = get_close_matches(value, known, n=1, cutoff=0.5)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise SimError(f"{name}: expected {_listed(known)} ({text}), got {value!r}{hint}")
    node.declare_parameter(name, value, descriptor, ignore_override=True)
    return value


def refuse_unknown(node: Node) -> None:
    """Raise a SimError for a parameter that was given but that the node does not have; the last of declaring."""
    known = [name for name in node._parameters if not name.startswith(ROS_OWN)]
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            raise SimError(f"unknown parameter {name!r}: {nearest(name, known)}")


def _bound(descriptor: ParameterDescriptor, default: Any, limits: tuple[float, float]) -> None:
    """Put the bounds of a number into its descriptor; also in words, which tools without ranges show."""
    least, greatest = limits
    if isinstance(default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(least), to_value=float(greatest))]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(least), to_value=int(greatest), step=1)]
    descriptor.additional_constraints = f"{least:.10g} to {greatest:.10g}"


def _listed(choices: tuple[str, ...]) -> str:
    """Return 'a, b or c'; an empty text is called so."""
    words = [choice or "empty" for choice in choices]
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
