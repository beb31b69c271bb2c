"""Graphs of nodes from `config/params/graphs/*.yaml`, started as `ros2 run` starts them."""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pydantic import Field

from bullet_sim.settings import Settings, read_settings
from pbrl_bag.names import GLOBAL
from pbrl_bag.yaml_text import parse_yaml
from pbrl_bringup.errors import BringupError
from pbrl_bringup.middleware import on_this_machine
from pbrl_bringup.paths import config_file, node_executable
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient

Scalar = bool | int | float | str | list[float] | list[str]
DOMAINS = range(1, 101)  # with higher numbers, DDS's ports run into those that the system hands out
NAMESPACE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
DOMAIN_PORT = 32768  # bound while a domain is in use, as ROS's own domain_coordinator does


class Ready(Settings):
    """What there is once a node is ready: a topic that it publishes or a service that it offers."""

    topic: str | None = None
    service: str | None = None


class Node(Settings):
    """One node of a graph."""

    package: str
    executable: str
    parameters: dict[str, Scalar] = Field(default_factory=dict)
    ready: Ready = Ready()
    optional: bool = False


class Graph(Settings):
    """Nodes by name, in the order in which they are started."""

    description: str
    nodes: dict[str, Node]


def load_graph(name: str) -> Graph:
    """Read a graph by path or by name.

    Raises:
        BringupError: there is none of that name.
        SimError: the file is not a graph.
    """
    return read_settings(config_file("params/graphs", name), Graph)


def wait_ready(graph: Graph, client: GraphClient, timeout: float = 30.0) -> None:
    """Wait until every node offers what its `ready` names."""
    for node in graph.nodes.values():
        if node.ready.topic:
            client.wait_for_topic(node.ready.topic, timeout)
        if node.ready.service:
            client.wait_for_service(node.ready.service, timeout)


def with_parameters(graph: Graph, settings: Mapping[str, str], optional: tuple[str, ...] = ()) -> Graph:
    """Return the graph with parameters set and only the optional nodes that are asked for.

    Args:
        graph: as read.
        settings: "node.parameter" to its value, written as YAML.
        optional: names of the optional nodes to start.

    Raises:
        BringupError: there is no node of a name that is used, or a value is none that a parameter can have.
    """
    unknown = sorted({key.partition(".")[0] for key in settings} | set(optional) - set(graph.nodes))
    unknown = [name for name in unknown if name not in graph.nodes]
    if unknown:
        raise BringupError(f"the graph has no node {unknown[0]!r}; its nodes are {', '.join(graph.nodes)}")
    nodes = {}
    for name, node in graph.nodes.items():
        own = {key.partition(".")[2]: _value(key, text) for key, text in settings.items() if key.startswith(f"{name}.")}
        if not node.optional or name in optional or own:
            nodes[name] = node.model_copy(update={"parameters": {**node.parameters, **own}})
    return graph.model_copy(update={"nodes": nodes})


def _value(key: str, text: str) -> Scalar:
    """Return the value of a parameter that is written as YAML."""
    try:
        value = parse_yaml(text)
    except ValueError as error:
        raise BringupError(f"{key}={text}: {error}") from error
    if not isinstance(value, bool | int | float | str | list):
        raise BringupError(f"{key}={text}: expected a boolean, number, text or list, got {value!r}")
    return value


def node_command(name: str, node: Node, namespace: str = "") -> list[str]:
    """Return the command line of a node, as `ros2 run PACKAGE EXECUTABLE --ros-args ...` makes it.

    Args:
        name: of the node.
        node: its executable and parameters.
        namespace: of its robot, as `parse_namespace` gives it; clock and transforms, global elsewhere, are in it, too.

    Raises:
        BringupError: there is no such executable, or a parameter is not a ROS parameter value.
    """
    command = [str(node_executable(node.package, node.executable)), "--ros-args", "-r", f"__node:={name}"]
    if namespace:
        for old, new in {"__ns": namespace, **{topic: namespace + topic for topic in GLOBAL}}.items():
            command += ["-r", f"{old}:={new}"]
    for key, value in node.parameters.items():
        command += ["-p", f"{key}:={_parameter_text(value)}"]
    return command


def _parameter_text(value: Scalar) -> str:
    """Write a value so that ROS's YAML reader gets the same type: strings quoted, floats with a point."""
    if not isinstance(value, bool | int | float | str | list):
        raise BringupError(f"expected a parameter to be a boolean, number, text or list, got {value!r}")
    return json.dumps(value)


def node_environment(domain: int) -> dict[str, str]:
    """Return the environment of a graph's nodes: the parent's, with a domain on this machine only."""
    environment = dict(os.environ)
    environment["ROS_DOMAIN_ID"] = str(domain)
    environment.update(on_this_machine(environment))
    environment["PYTHONUNBUFFERED"] = "1"
    environment["RCUTILS_COLORIZED_OUTPUT"] = "0"
    # Nodes share few cores: a numeric library that starts a thread a core in each of them slows all.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        environment.setdefault(name, "1")
    return environment


def outside_environment(domain: int | None) -> dict[str, str]:
    """Return the environment of a node that joins a graph outside: the parent's, in its domain unless one is given."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "RCUTILS_COLORIZED_OUTPUT": "0"}
    return environment if domain is None else {**environment, "ROS_DOMAIN_ID": str(domain)}


@contextmanager
def free_domain() -> Iterator[int]:
    """Yield a ROS_DOMAIN_ID that no other graph of this machine uses while the block runs.

    Raises:
        BringupError: all are in use.
    """
    # Whoever was killed leaves shared memory that disturbs the next of its domain: each process begins elsewhere.
    for number in range(len(DOMAINS)):
        domain = DOMAINS[(os.getpid() + number) % len(DOMAINS)]
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as lock:
            try:
                lock.bind(("", DOMAIN_PORT + domain))
            except OSError:
                continue
            yield domain
            return
    raise BringupError(f"expected a free ROS_DOMAIN_ID among {DOMAINS[0]}..{DOMAINS[-1]}, all are in use; stop a graph")


@contextmanager
def running_graph(graph: Graph, logs: Path, domain: int, namespace: str = "") -> Iterator[Programs]:
    """Start every node of a graph in order, in a namespace; all are gone when the block ends."""
    # errors before anything runs
    commands = {name: node_command(name, node, namespace) for name, node in graph.nodes.items()}
    with Programs(logs, node_environment(domain)) as programs:
        for name, command in commands.items():
            programs.start(name, command)
        yield programs


def parse_namespace(text: str) -> str:
    """Return the namespace of a robot with a leading slash; empty: the root.

    Raises:
        BringupError: a name that ROS does not take.
    """
    name = text.strip("/")
    if name and not NAMESPACE.fullmatch(name):
        raise BringupError(
            f"namespace: expected letters, digits and underscores, no digit first, such as robot_1, got {text!r}"
        )
    return f"/{name}" if name else ""


def parse_setting(text: str) -> tuple[str, str]:
    """Split "node.parameter=value" into its two sides.

    Raises:
        BringupError: it has another form.
    """
    key, equals, value = text.partition("=")
    if not equals or "." not in key:
        raise BringupError(f"{text!r}: expected NODE.PARAMETER=VALUE, e.g. sim.scene=three_tables")
    return key, value
