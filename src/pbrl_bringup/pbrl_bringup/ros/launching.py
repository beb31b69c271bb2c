"""A graph of `config/params/graphs` as what `ros2 launch` takes: the same nodes, parameters and rules as `./pbrl run`.

`config/launch/*.launch.py` hand a graph's name to `describe`. Arguments of each:

- `namespace`: of the robot; several then share a domain, each with its own clock and transforms.
- `robot:=true`: a real robot takes the simulator's place, which is left out.
- `use_sim_time`: auto (as the graph says; false with a real robot), true or false.
- `with`: optional nodes to start too, with commas.
"""

from __future__ import annotations

from typing import Any

from pbrl_bag.names import GLOBAL
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Graph, Node, Scalar, load_graph, parse_namespace, with_parameters

SIMULATORS = ("bullet_sim", "krang_sim", "pr2_cart_sim", "tabletop_sim")
SIM_TIME = "use_sim_time"
ARGUMENTS = {
    "namespace": ("", "of the robot, such as robot_1; empty: the root", None),
    "robot": ("false", "a real robot takes the simulator's place", ("true", "false")),
    SIM_TIME: ("auto", "auto: as the graph says, false with a real robot", ("auto", "true", "false")),
    "with": ("", "optional nodes to start too, with commas", None),
}
"""Default, description and choices of a launch file's arguments."""


def describe(name: str) -> Any:
    """Return the launch description of a graph.

    Args:
        name: of the graph in `config/params/graphs`.

    Raises:
        BringupError: there is none of that name.
        SimError: the file is not a graph.
    """
    # Part of a ROS installation, not of the wheels that `./pbrl` installs: needed by `ros2 launch` alone.
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch.substitutions import LaunchConfiguration

    graph = load_graph(name)

    def chosen(context: Any) -> list[Any]:
        given = {each: LaunchConfiguration(each).perform(context) for each in ARGUMENTS}
        return [_action(each, node, given["namespace"]) for each, node in selected(graph, given).items()]

    declared = [
        DeclareLaunchArgument(each, default_value=default, description=text, choices=choices and list(choices))
        for each, (default, text, choices) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=chosen)])


def selected(graph: Graph, given: dict[str, str]) -> dict[str, Node]:
    """Return the nodes to start, with their parameters.

    Args:
        graph: as written.
        given: value of each of `ARGUMENTS`.

    Raises:
        BringupError: an optional node that there is not, or one that a real robot does not need.
    """
    wanted = tuple(word.strip() for word in given["with"].split(",") if word.strip())
    robot = given["robot"] == "true"
    nodes = dict(with_parameters(graph, {}, wanted).nodes)
    if robot:
        nodes = {name: node for name, node in nodes.items() if node.package not in SIMULATORS}
    if not nodes:
        raise BringupError("expected nodes to start, got none beside the simulator")
    return {name: _timed(node, given[SIM_TIME], robot) for name, node in nodes.items()}


def _timed(node: Node, sim_time: str, robot: bool) -> Node:
    """Return a node with the clock that is asked for; one that says nothing of it has the wall clock."""
    if node.package in SIMULATORS or (sim_time == "auto" and not robot):
        return node
    return node.model_copy(update={"parameters": {**node.parameters, SIM_TIME: sim_time == "true"}})


def _action(name: str, node: Node, namespace: str) -> Any:
    """Return the action that starts a node."""
    from launch_ros.actions import Node as NodeAction

    robot = parse_namespace(namespace)
    return NodeAction(
        package=node.package,
        executable=node.executable,
        name=name,
        namespace=robot,
        parameters=[{key: _parameter(value) for key, value in node.parameters.items()}],
        remappings=[(topic, robot + topic) for topic in GLOBAL] if robot else [],
        output="screen",
    )


def _parameter(value: Scalar) -> Any:
    """Return a parameter that keeps its type: launch reads a bare text as YAML, so that "" or "on" were none."""
    from launch_ros.parameter_descriptions import ParameterValue

    return ParameterValue(value, value_type=str) if isinstance(value, str) else value
