"""Launch files: each makes the nodes that `./pbrl run` makes, for the simulator or a robot, in any namespace.

The packages `launch` and `launch_ros` are not among the wheels that the tests run with. Small stand-ins of the few
classes that are used, with the same arguments, record what the files make; `ros2 launch` itself is not run here.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Graph, load_graph, node_command, with_parameters
from pbrl_bringup.paths import workspace
from pbrl_bringup.ros.launching import SIMULATORS

GRAPHS = sorted(path.stem for path in (workspace() / "config/params/graphs").glob("*.yaml"))
FILES = workspace() / "config/launch"


@dataclass(frozen=True)
class DeclareLaunchArgument:
    name: str
    default_value: str | None = None
    description: str | None = None
    choices: list[str] | None = None


@dataclass(frozen=True)
class OpaqueFunction:
    function: Callable[[dict[str, str]], list[Any]]


@dataclass(frozen=True)
class LaunchConfiguration:
    name: str

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


@dataclass(frozen=True)
class LaunchDescription:
    entities: list[Any]


@dataclass(frozen=True)
class ParameterValue:
    value: str
    value_type: type


@dataclass(frozen=True)
class NodeAction:
    package: str
    executable: str
    name: str
    namespace: str
    parameters: list[dict[str, Any]]
    output: str
    remappings: list[tuple[str, str]] = field(default_factory=list)


STAND_INS = {
    "launch": {"LaunchDescription": LaunchDescription},
    "launch.actions": {"DeclareLaunchArgument": DeclareLaunchArgument, "OpaqueFunction": OpaqueFunction},
    "launch.substitutions": {"LaunchConfiguration": LaunchConfiguration},
    "launch_ros": {},
    "launch_ros.actions": {"Node": NodeAction},
    "launch_ros.parameter_descriptions": {"ParameterValue": ParameterValue},
}


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name, content in STAND_INS.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    yield


def description(graph: str) -> LaunchDescription:
    made = runpy.run_path(str(FILES / f"{graph}.launch.py"))["generate_launch_description"]()
    assert isinstance(made, LaunchDescription)
    return made


def launched(graph: str, **given: str) -> dict[str, NodeAction]:
    """What `ros2 launch` would start, given `name:=value` as it checks it."""
    entities = description(graph).entities
    arguments = {each.name: each for each in entities if isinstance(each, DeclareLaunchArgument)}
    assert set(given) <= set(arguments)
    context = {name: given.get(name, each.default_value) for name, each in arguments.items()}
    assert all(
        each.description and (not each.choices or context[name] in each.choices) for name, each in arguments.items()
    )
    (function,) = [each for each in entities if isinstance(each, OpaqueFunction)]
    return {node.name: node for node in function.function(context)}


def as_command(node: NodeAction) -> set[str]:
    """The rules and parameters of an action, as `./pbrl run` writes them."""
    values = {key: value for parameters in node.parameters for key, value in parameters.items()}
    for key, value in values.items():
        assert not isinstance(value, str), f"{key}: launch would read a bare text as YAML"
    plain = {key: value.value if isinstance(value, ParameterValue) else value for key, value in values.items()}
    rules = {f"__node:={node.name}", *(f"{old}:={new}" for old, new in node.remappings)}
    rules |= {f"__ns:={node.namespace}"} if node.namespace else set()
    return {*rules, *(f"{key}:={value!r}" for key, value in plain.items())}


def as_run(graph: Graph, name: str, namespace: str) -> set[str]:
    node = graph.nodes[name]
    bare = node_command(name, node.model_copy(update={"parameters": {}}), namespace)
    return {word for word in bare if ":=" in word} | {f"{key}:={value!r}" for key, value in node.parameters.items()}


def test_every_graph_has_a_launch_file() -> None:
    assert sorted(path.name.removesuffix(".launch.py") for path in FILES.glob("*.launch.py")) == GRAPHS


@pytest.mark.parametrize("namespace", ["", "robot_1"])
@pytest.mark.parametrize("name", GRAPHS)
def test_what_is_launched_is_what_pbrl_runs(name: str, namespace: str) -> None:
    graph = with_parameters(load_graph(name), {})
    nodes = launched(name, namespace=namespace)
    assert list(nodes) == list(graph.nodes)
    for each, action in nodes.items():
        assert (action.package, action.executable) == (graph.nodes[each].package, graph.nodes[each].executable)
        assert as_command(action) == as_run(graph, each, f"/{namespace}" if namespace else "")


@pytest.mark.parametrize("name", GRAPHS)
def test_a_robot_takes_the_simulators_place_and_brings_its_clock(name: str) -> None:
    everything, nodes = launched(name), launched(name, robot="true")
    left_out = [each for each, node in everything.items() if node.package in SIMULATORS]
    assert (len(left_out) == 1 and [*left_out, *nodes] == list(everything)) or name != "krang_push"
    assert not set(left_out) & set(nodes)
    for node in nodes.values():
        assert {key: value for each in node.parameters for key, value in each.items()}["use_sim_time"] is False


def test_the_clock_can_be_said() -> None:
    for word, value in (("true", True), ("false", False)):
        nodes = launched("namo", robot="true", use_sim_time=word)
        assert [node.parameters[0]["use_sim_time"] for node in nodes.values()] == [value] * len(nodes)


def test_optional_nodes_are_started_when_asked_for() -> None:
    nodes = launched("krang", **{"with": "recorder, tags"})
    assert list(nodes) == ["sim", "controller", "tags", "recorder"]
    with pytest.raises(BringupError, match="the graph has no node 'recoder'; its nodes are sim, controller"):
        launched("krang", **{"with": "recoder"})


def test_a_namespace_that_is_none_is_refused() -> None:
    with pytest.raises(BringupError, match="namespace: expected letters"):
        launched("hand", namespace="robot 1")
