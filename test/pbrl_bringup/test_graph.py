"""Graphs: as written, with settings, and as command lines of real executables."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from bullet_sim.errors import SimError
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import (
    DOMAIN_PORT,
    Graph,
    Node,
    free_domain,
    load_graph,
    node_command,
    node_environment,
    parse_namespace,
    parse_setting,
    with_parameters,
)
from pbrl_bringup.paths import workspace

GRAPHS = sorted((workspace() / "config/params/graphs").glob("*.yaml"))


def sample_graph() -> Graph:
    sim = Node(package="krang_sim", executable="sim_node", parameters={"scene": "locked_caster", "rate": 1.0})
    recorder = Node(package="pbrl_bag", executable="recorder_node", optional=True)
    return Graph(description="one", nodes={"sim": sim, "recorder": recorder})


@pytest.mark.parametrize("path", GRAPHS, ids=lambda path: path.stem)
def test_every_graph_names_nodes_that_exist(path: Path) -> None:
    for name, node in load_graph(str(path)).nodes.items():
        assert Path(node_command(name, node)[0]).is_file()


def test_there_are_graphs() -> None:
    assert GRAPHS


def test_parameters_keep_their_type() -> None:
    node = Node(
        package="krang_sim",
        executable="sim_node",
        parameters={"scene": "on", "rate": 1.0, "seed": 3, "gui": False},
    )
    assert node_command("sim", node)[1:] == [
        *("--ros-args", "-r", "__node:=sim"),
        *("-p", 'scene:="on"', "-p", "rate:=1.0", "-p", "seed:=3", "-p", "gui:=false"),
    ]


def test_a_robot_with_a_namespace_has_its_own_clock_and_transforms() -> None:
    command = node_command("sim", Node(package="krang_sim", executable="sim_node"), "/fleet/a")
    assert command[1:4] == ["--ros-args", "-r", "__node:=sim"]
    rules = ["__ns:=/fleet/a", "/clock:=/fleet/a/clock", "/tf:=/fleet/a/tf", "/tf_static:=/fleet/a/tf_static"]
    assert command[4:] == [word for rule in rules for word in ("-r", rule)]


@pytest.mark.parametrize(("text", "namespace"), [("", ""), ("/", ""), ("a", "/a"), ("/a_1/b/", "/a_1/b")])
def test_a_namespace_has_one_slash_in_front(text: str, namespace: str) -> None:
    assert parse_namespace(text) == namespace


@pytest.mark.parametrize("text", ["1a", "a b", "a//b", "~a", "a-b", "rö", "a/1", "__ns:=/x"])
def test_a_namespace_that_ros_does_not_take_is_a_line(text: str) -> None:
    with pytest.raises(BringupError, match="namespace: expected letters, digits and underscores"):
        parse_namespace(text)


def test_optional_nodes_start_when_they_are_asked_for() -> None:
    graph = sample_graph()
    assert list(with_parameters(graph, {}).nodes) == ["sim"]
    assert list(with_parameters(graph, {}, ("recorder",)).nodes) == ["sim", "recorder"]
    assert list(with_parameters(graph, {"recorder.out": "a"}).nodes) == ["sim", "recorder"]


def test_settings_override_what_is_written() -> None:
    graph = with_parameters(sample_graph(), {"sim.rate": "2.5", "sim.gui": "true"})
    assert graph.nodes["sim"].parameters == {"scene": "locked_caster", "rate": 2.5, "gui": True}


@pytest.mark.parametrize(("settings", "optional"), [({"smi.rate": "1"}, ()), ({}, ("smi",))])
def test_an_unknown_node_is_named(settings: dict[str, str], optional: tuple[str, ...]) -> None:
    with pytest.raises(BringupError, match="no node 'smi'; its nodes are sim, recorder"):
        with_parameters(sample_graph(), settings, optional)


@pytest.mark.parametrize("text", ["sim.rate", "rate=1", ""])
def test_a_setting_has_one_form(text: str) -> None:
    with pytest.raises(BringupError, match=r"expected NODE\.PARAMETER=VALUE"):
        parse_setting(text)


def test_a_misspelt_key_names_the_nearest(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("description: x\nnodes:\n  sim: {pakage: krang_sim, executable: sim_node}\n")
    with pytest.raises(SimError, match=r"a\.yaml: nodes\.sim\.pakage: unknown key.*package"):
        load_graph(str(path))


def test_an_unknown_graph_names_the_nearest() -> None:
    with pytest.raises(BringupError, match="did you mean 'krang_push'"):
        load_graph("krang_puhs")


def test_an_unknown_executable_is_an_error() -> None:
    with pytest.raises(BringupError, match="krang_sim has no executable 'sim'; it has hand_node, sim_node"):
        node_command("sim", Node(package="krang_sim", executable="sim"))
    with pytest.raises(BringupError, match="'krang' is not in the ament index"):
        node_command("sim", Node(package="krang", executable="sim_node"))


def test_domains_are_not_shared() -> None:
    with free_domain() as one, free_domain() as two:
        assert one != two
        assert node_environment(two)["ROS_DOMAIN_ID"] == str(two)
        with socket.socket() as probe, pytest.raises(OSError, match="in use"):
            probe.bind(("", DOMAIN_PORT + one))
