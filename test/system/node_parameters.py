"""What every node declares, and the parameter files in config/params/nodes that say it.

`python test/system/node_parameters.py` in the root of a built workspace writes the files anew.
"""

from __future__ import annotations

import importlib
import json
import textwrap
import threading
from collections.abc import Iterator
from configparser import ConfigParser
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from pbrl_bag.ros.parameters import ROS_OWN
from pbrl_bringup.paths import workspace

FOLDER = workspace() / "config" / "params" / "nodes"
WIDTH = 118


@dataclass(frozen=True)
class Executable:
    """A node as `ros2 run PACKAGE NAME` finds it."""

    package: str
    name: str
    module: str

    def __str__(self) -> str:
        return f"{self.package}/{self.name}"

    @property
    def file(self) -> Path:
        return FOLDER / self.package / f"{self.name}.yaml"


@dataclass(frozen=True)
class Parameter:
    """A parameter as its node's services tell of it."""

    name: str
    value: Any
    descriptor: ParameterDescriptor

    @property
    def bounds(self) -> tuple[float, float] | None:
        for one in (*self.descriptor.floating_point_range, *self.descriptor.integer_range):
            return one.from_value, one.to_value
        return None


def executables() -> list[Executable]:
    """Every node that the built packages' entry points name."""
    found = []
    for path in sorted(workspace().glob("build/*/*.egg-info/entry_points.txt")):
        points = ConfigParser()
        points.read(path)
        for name, target in points["console_scripts"].items():
            if name.endswith("_node"):
                found.append(Executable(path.parent.parent.name, name, target.partition(":")[0]))
    return found


class _DeclaredError(Exception):
    """Ends a node's constructor when everything is declared and nothing else is done yet."""


def declared(module_name: str, arguments: list[str] | None = None) -> list[Parameter]:
    """Start a node's constructor with ROS arguments, and read what it has declared as its parameter services would."""
    module = importlib.import_module(module_name)
    rclpy.init(args=["--ros-args", *(arguments or [])])
    try:
        with _ends_when_declared(module) as caught:
            kind = _node_class(module)
            given = {"stop": threading.Event()} if "stop" in signature(kind).parameters else {}
            with _quietly():
                kind(**given)
        node = caught[0]
        try:
            names = [name for name in node.list_parameters([], 0).names if not name.startswith(ROS_OWN)]
            values = node.get_parameters(names)
            described = node.describe_parameters(names)
            return [Parameter(*each) for each in zip(names, [one.value for one in values], described, strict=True)]
        finally:
            Node.destroy_node(node)
    finally:
        rclpy.try_shutdown()


@contextmanager
def _ends_when_declared(module: ModuleType) -> Iterator[list[Node]]:
    caught: list[Node] = []
    refuse = module.refuse_unknown

    def end(node: Node) -> None:
        caught.append(node)
        refuse(node)
        raise _DeclaredError

    with patch.object(module, "refuse_unknown", end):
        yield caught


@contextmanager
def _quietly() -> Iterator[None]:
    try:
        yield
    except _DeclaredError:
        return
    raise AssertionError("expected a node to end its declarations with refuse_unknown")


def _node_class(module: ModuleType) -> type[Node]:
    found = [
        each
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, Node) and each.__module__ == module.__name__
    ]
    (kind,) = found
    return kind


def text_of(node: Executable, parameters: list[Parameter]) -> str:
    """The parameter file of a node, with what it declares."""
    lines = [
        f"# ros2 run {node.package} {node.name} --ros-args --params-file FILE",
        "# Every parameter at its default; all are read at the start.",
        "/**:",
        "  ros__parameters:",
    ]
    for each in parameters:
        constraints = each.descriptor.additional_constraints
        said = each.descriptor.description + (f" ({constraints})" if constraints else "")
        lines += [f"    # {line}" for line in textwrap.wrap(said, WIDTH - 6)]
        lines.append(f"    {each.name}: {json.dumps(_plain(each.value))}")
    return "\n".join(lines) + "\n"


def _plain(value: Any) -> Any:
    return value if isinstance(value, bool | int | float | str) else list(value)


def main() -> None:
    """Write the files."""
    for node in executables():
        node.file.parent.mkdir(parents=True, exist_ok=True)
        node.file.write_text(text_of(node, declared(node.module)), encoding="utf-8")
        print(node.file.relative_to(workspace()))


if __name__ == "__main__":
    main()
