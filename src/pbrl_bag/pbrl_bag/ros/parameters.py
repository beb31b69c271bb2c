"""Declares node parameters so that a wrong one is one line, not a traceback and not ignored."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from pbrl_bag.errors import BagError
from pbrl_bag.validation import nearest

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

    An integer serves where a float is expected, and empty texts in a list count as none: ROS
    cannot say an empty list on a command line.

    Args:
        node: that has the parameter.
        name: of the parameter.
        default: its value if none is given; its type is the one expected.
        text: what it is, in a phrase.
        limits: least and greatest value of a number.
        choices: texts of which it, or each entry of a list, is one; none: any text.

    Returns:
        Its value, of the type of `default`.

    Raises:
        BagError: a value of another type, out of range, or not among the choices.
    """
    # Checked before it is declared: rclpy would refuse `rate:=2` for not being 2.0, and in words of its own.
    given = node._parameter_overrides.get(name)
    value = _checked(name, default if given is None else given.value, default, text)
    descriptor = ParameterDescriptor(description=text, read_only=True)
    if limits:
        _bound(descriptor, default, limits)
        if not limits[0] <= value <= limits[1]:
            raise BagError(f"{name}: expected {_words(limits)} ({text}), got {value:.10g}")
    known = tuple(choices)
    if known:
        descriptor.additional_constraints = _listed(known)
        for word in value if isinstance(value, list) else [value]:
            if word not in known:
                near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise BagError(f"{name}: expected {_listed(known)} ({text}), got {word!r}{hint}")
    node.declare_parameter(name, [""] if value == [] else value, descriptor, ignore_override=True)
    return value


def refuse_unknown(node: Node) -> None:
    """Raise a BagError for a parameter that was given but that the node does not have; the last of declaring."""
    known = [name for name in node._parameters if not name.startswith(ROS_OWN)]
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith(ROS_OWN):
            raise BagError(f"unknown parameter {name!r}: {nearest(name, known)}")


def _checked(name: str, value: Any, default: Any, text: str) -> Any:
    """Return a value as the type of the default."""
    if isinstance(default, list):
        return _texts(name, value)
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    if type(value) is not type(default):
        raise BagError(f"{name}: expected {type(default).__name__} ({text}), got {value!r}")
    return value


def _bound(descriptor: ParameterDescriptor, default: Any, limits: tuple[float, float]) -> None:
    """Put the bounds of a number into its descriptor; also in words, which tools without ranges show."""
    least, greatest = limits
    if isinstance(default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(least), to_value=float(greatest))]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(least), to_value=int(greatest), step=1)]
    descriptor.additional_constraints = _words(limits)


def _words(limits: tuple[float, float]) -> str:
    return f"{limits[0]:.10g} to {limits[1]:.10g}"


def _listed(choices: tuple[str, ...]) -> str:
    """Return 'a, b or c'; an empty text is called so."""
    words = [choice or "empty" for choice in choices]
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def _texts(name: str, value: Any) -> list[str]:
    """Return a list of texts without its empty entries."""
    if not isinstance(value, list | tuple) or not all(isinstance(entry, str) for entry in value):
        raise BagError(f"{name}: expected a list of texts like ['/a', '/b'], got {value!r}")
    return [entry for entry in value if entry]
