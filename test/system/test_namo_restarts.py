"""Each part of the NAMO graph dies while a table is moved, and returns: the robot rests, looks anew, and goes on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from namo_person import Person
from rclpy.context import Context

from pbrl_bringup.graph import free_domain, load_graph, node_command, running_graph, with_parameters
from pbrl_bringup.processes import Programs

ROOM = """
name: restarts
room: {outline: [[-0.5, -1.5], [5.0, -1.5], [5.0, 1.5], [-0.5, 1.5]]}
robot: {pose: [0.6, 0.3, 0.0]}
bodies:
  table: {kind: office_table, size: [1.0, 1.0], height: 0.7775, nominal_mass: 33.0, pose: [2.2, 0.75, 0.0]}
  cupboard: {kind: fixture, polygon: [[1.9, -1.4], [2.6, -1.4], [2.6, -0.4], [1.9, -0.4]], height: 1.0}
"""
"""The table, on free casters, and the cupboard leave no gap that the robot fits through."""
UNDER_WAY = 1.0  # [s] of simulated time for which the table is moved before somebody dies


class Graph:
    """The running graph, of which parts can be killed and brought back."""

    def __init__(self, programs: Programs, commands: dict[str, list[str]], person: Person, logs: Path) -> None:
        self.person = person
        self._programs, self._commands, self._logs = programs, commands, logs

    def kill(self, name: str) -> int:
        """Kill a node, as a crash would; return how much had been told until then."""
        self._programs.strike(name, signal.SIGKILL)
        self._programs.stop(name)
        return len(self.person.told)

    def bring_back(self, name: str) -> None:
        """Start it again."""
        self._programs.start(name, self._commands[name])

    def log(self, name: str) -> str:
        """Return what a node has logged since it was last started: whoever is far does not hear its first words."""
        return (self._logs / f"{name}.log").read_text(encoding="utf-8")


@pytest.fixture
def graph(tmp_path: Path, nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    scene, logs = tmp_path / "restarts.yaml", tmp_path / "logs"
    scene.write_text(ROOM, encoding="utf-8")
    told = {"sim.seed": "3", "sim.scene": str(scene), "namo.goal": '"4.3 0.0"'}
    nodes = with_parameters(load_graph("namo"), told)
    commands = {name: node_command(name, node) for name, node in nodes.nodes.items()}
    with free_domain() as domain, running_graph(nodes, logs, domain) as programs:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        someone = Person(context, programs)
        yield Graph(programs, commands, someone, logs)
        someone.leave()
        rclpy.try_shutdown(context=context)


@pytest.mark.timeout(900)
def test_whoever_dies_while_a_table_is_held_is_waited_for(graph: Graph) -> None:
    person = graph.person
    person.enters("ClearObstacle")
    moving = person.way[-1][0]
    person.until(lambda: person.way[-1][0] > moving + UNDER_WAY, "the clock stands still")

    told = graph.kill("controller")
    died = person.way[-1][0]
    person.enters("Paused", told)
    assert "body_controller" in person.told[-1].sentence
    person.rests(died)
    graph.bring_back("controller")
    person.enters("Release", told)
    assert "holds" in next(each.sentence for each in person.told[told:] if each.state == "Release")

    told = graph.kill("namo")
    person.rests(person.way[-1][0])
    graph.bring_back("namo")
    person.enters("Planning", told)
    before = graph.log("namo").partition("Planning: ")[0]
    assert "Look: " in before and "GetReady: " in before, "it looks before it plans again"

    told = graph.kill("sim")
    person.enters("Paused", told)
    graph.bring_back("sim")
    person.enters("NavigateToPoint", told)
    states = [each.state for each in person.told[told:]]
    assert states.index("Paused") < states.index("Look") < states.index("NavigateToPoint")
    assert person.told[-1].plans >= 1
