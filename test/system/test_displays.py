"""RViz's configuration and Foxglove's layout against running graphs: every topic, its type, its quality, its fields.

Neither program is at hand here: what they are told is compared with what Krang's and the PR2's graphs offer.
"""

from __future__ import annotations

import json
import time
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from pbrl_bringup.graph import Graph, free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.paths import workspace

RVIZ = yaml.safe_load((workspace() / "config/rviz/pbrl.rviz").read_text())["Visualization Manager"]
PANELS = json.loads((workspace() / "config/foxglove/pbrl.json").read_text())["configById"]
ROBOTS = (  # namespace, graph, optional nodes with it, settings
    ("/krang", "krang_push", ("mismatch", "tags"), {"sim.scene": "three_tables", "sim.tags": "rendered"}),
    ("/krang", "namo", (), {}),
    ("/pr2", "pr2", (), {}),
)
SLOWLY = {"sim.rate": "0.05"}
"""Simulated time hardly goes on: what is offered does not depend on it."""
SHOWS = {
    "RobotModel": "std_msgs/msg/String",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Map": "nav_msgs/msg/OccupancyGrid",
    "Path": "nav_msgs/msg/Path",
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "Odometry": "nav_msgs/msg/Odometry",
    "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "Wrench": "geometry_msgs/msg/WrenchStamped",
    "Image": "sensor_msgs/msg/Image",
}
"""What RViz's displays subscribe to, as its plugins' descriptions have it."""
OTHERS = {"Grid", "TF", "MoveCamera", "Select", "FocusCamera", "Measure", "SetGoal"}
"""Displays and tools of its own that need no topic, or one that has its own test."""
IN_3D = {*SHOWS.values(), "tf2_msgs/msg/TFMessage"} - {"nav_msgs/msg/Odometry", "geometry_msgs/msg/WrenchStamped"}
"""What Foxglove's 3D panel draws, of our types."""
GOAL = "/goal_pose"
PATIENCE = 90.0  # [s]


@dataclass(frozen=True)
class Offer:
    """A topic as it is on the wire."""

    type: str
    reliable: bool
    latched: bool


class Wire:
    """What the graphs offer and hear, by the name that it has in its robot's namespace."""

    def __init__(self, node: Node) -> None:
        self.offers: dict[str, list[Offer]] = {}
        self.hears: dict[str, list[Offer]] = {}
        for name, _ in node.get_topic_names_and_types():
            own = next((name.removeprefix(robot[0]) for robot in ROBOTS if name.startswith(f"{robot[0]}/")), name)
            for found, ends in (
                (self.offers, node.get_publishers_info_by_topic(name)),
                (self.hears, node.get_subscriptions_info_by_topic(name)),
            ):
                told = [
                    Offer(
                        end.topic_type,
                        end.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
                        end.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
                    )
                    for end in ends
                ]
                if told:
                    found.setdefault(own, []).extend(told)


def shown() -> list[tuple[str, dict[str, Any]]]:
    """Kind and topic of every display of RViz."""
    found = []
    for display in RVIZ["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        found += [(kind, display[key]) for key in ("Topic", "Description Topic") if key in display]
    return found


def paths() -> list[str]:
    """Every message path of Foxglove's panels."""
    found = [each["value"] for panel in PANELS.values() for each in panel.get("paths", [])]
    return found + [panel["topicPath"] for panel in PANELS.values() if "topicPath" in panel]


def in_3d() -> list[str]:
    return [topic for panel in PANELS.values() for topic in panel.get("topics", {})]


@pytest.fixture(scope="module")
def wire(tmp_path_factory: pytest.TempPathFactory) -> Wire:
    folder = tmp_path_factory.mktemp("displays")
    with free_domain() as domain, ExitStack() as stack:
        stack.enter_context(pytest.MonkeyPatch.context()).setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        running = []
        started: set[tuple[str, str]] = set()
        for robot, name, optional, settings in ROBOTS:
            graph = with_parameters(load_graph(name), settings | SLOWLY, optional)
            nodes = {key: node for key, node in graph.nodes.items() if (robot, key) not in started}
            started |= {(robot, key) for key in nodes}
            graph = Graph(description=graph.description, nodes=nodes)
            running.append(stack.enter_context(running_graph(graph, folder / f"{robot[1:]}_{name}", domain, robot)))
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = Node("looks_on", context=context, enable_rosout=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        wanted = (
            {f"/{topic['Value']}" for _, topic in shown()} | set(in_3d()) | {path.split(".")[0] for path in paths()}
        )
        deadline = time.monotonic() + PATIENCE
        found = Wire(node)
        while time.monotonic() < deadline and not (wanted <= set(found.offers) and len(found.hears.get(GOAL, ())) == 2):
            found = Wire(node)
            for each in running:
                each.check()
            executor.spin_once(timeout_sec=0.2)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
    return found


def named(each: Any) -> str:
    return each if isinstance(each, str) else each["Value"]


@pytest.mark.parametrize(("kind", "topic"), shown(), ids=named)
def test_a_display_of_rviz_shows_what_is_published(kind: str, topic: dict[str, Any], wire: Wire) -> None:
    assert not topic["Value"].startswith("/"), "relative, for robots in a namespace"
    offers = wire.offers.get("/" + topic["Value"])
    assert offers, "nobody publishes it"
    for offer in offers:
        assert offer.type == SHOWS[kind]
        assert offer.reliable or topic["Reliability Policy"] == "Best Effort", "would not be heard"
        assert (topic["Durability Policy"] == "Transient Local") == offer.latched, "not heard, or too late"


@pytest.mark.parametrize("topic", in_3d())
def test_what_foxglove_draws_is_published_and_can_be_drawn(topic: str, wire: Wire) -> None:
    offers = wire.offers.get(topic)
    assert offers, "nobody publishes it"
    assert {offer.type for offer in offers} <= IN_3D


@pytest.mark.parametrize("path", paths())
def test_what_foxglove_plots_is_a_field_of_what_is_published(path: str, wire: Wire) -> None:
    topic, *fields = path.split(".")
    assert wire.offers.get(topic), "nobody publishes it"
    for offer in wire.offers[topic]:
        package, _, name = offer.type.split("/")
        value = getattr(import_module(f"{package}.msg"), name)()
        for field in fields:
            value = getattr(value, field)
        assert isinstance(value, float) or not fields, "a plot is of numbers"


def test_every_display_and_tool_is_one_that_rviz_has() -> None:
    kinds = {each["Class"] for each in (*RVIZ["Displays"], *RVIZ["Tools"])}
    assert kinds <= {f"rviz_default_plugins/{name}" for name in (*SHOWS, *OTHERS)}


def test_goals_are_given_where_they_are_heard(wire: Wire) -> None:
    (tool,) = [tool for tool in RVIZ["Tools"] if tool["Class"].endswith("SetGoal")]
    places = {"/" + tool["Topic"]["Value"]}
    places |= {panel["publish"]["poseTopic"] for panel in PANELS.values() if "publish" in panel}
    assert places == {GOAL}
    hears = wire.hears[GOAL]
    assert len(hears) == 2, "Krang among furniture, and the PR2 with its cart"
    assert {each.type for each in hears} == {"geometry_msgs/msg/PoseStamped"}
    assert not any(each.latched for each in hears), "a volatile goal would not be heard"


def test_what_is_shown_has_a_frame_that_the_configuration_starts_from() -> None:
    assert RVIZ["Global Options"]["Fixed Frame"] == "world"
    assert {panel["followTf"] for panel in PANELS.values() if "followTf" in panel} == {"world"}
