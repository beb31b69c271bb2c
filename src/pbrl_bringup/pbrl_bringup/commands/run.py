"""`./pbrl run GRAPH`: nodes as processes, until Ctrl-C."""

from __future__ import annotations

import os
from collections.abc import Container, Sequence
from functools import partial
from pathlib import Path

from pbrl_bringup.graph import (
    load_graph,
    node_command,
    parse_namespace,
    parse_setting,
    running_graph,
    wait_ready,
    with_parameters,
)
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient
from pbrl_bringup.terminal import say

DISCOVERED = 1.0
"""[s] in which a node that runs in the domain already is found."""


def command(
    graph: str, settings: Sequence[str], optional: Sequence[str], namespace: str, domain: int | None, logs: Path
) -> int:
    """Start a graph, say when each node is ready, and stay until Ctrl-C or until a node ends.

    Raises:
        BringupError: no such graph, node or parameter; a name that is none; a node that is there already, or that ends
            by itself.
    """
    robot = parse_namespace(namespace)
    logs /= robot.strip("/")
    chosen = with_parameters(load_graph(graph), dict(map(parse_setting, settings)), tuple(optional))
    for name, node in chosen.nodes.items():
        node_command(name, node, robot)  # errors before a word is said
    number = int(os.environ.get("ROS_DOMAIN_ID", "0")) if domain is None else domain
    say(f"pbrl: {chosen.description.strip()}")
    with GraphClient(number, namespace=robot) as client:
        client.wait_for_none_of(chosen.nodes, DISCOVERED)
    spare = {name for name, node in chosen.nodes.items() if node.optional}
    with (
        running_graph(chosen, logs, number, robot) as programs,
        GraphClient(number, partial(_check, programs, spare), robot) as client,
    ):
        wait_ready(chosen, client)
        try:  # Ctrl-C may come as soon as it is named
            where = f"ROS_DOMAIN_ID {number}" + (f", namespace {robot}" if robot else "")
            say(f"pbrl: {', '.join(chosen.nodes)} run in {where}, output in {logs}; Ctrl-C stops them")
            client.stay()
        except KeyboardInterrupt:
            say("pbrl: stopping")
    return 0


def _check(programs: Programs, spare: Container[str]) -> None:
    """Raise a BringupError if a node has ended by itself; of one that is optional it is told, and the rest goes on."""
    for program in programs.let_go(spare):
        say(f"pbrl: {program.name} ended with exit code {program.process.returncode}: {program.last_line()}")
        say("pbrl: the other nodes go on without it")
    programs.check()
