"""The RViz configuration: topics that our nodes publish with these types, and a latched one is asked for as latched."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from bullet_sim import messages as shared
from krang_sim.messages import LATCHED as KRANG_LATCHED
from krang_sim.messages import message_types as krang_types
from pbrl_bringup.paths import workspace
from pr2_cart_sim.messages import LATCHED as PR2_LATCHED
from pr2_cart_sim.messages import MESSAGE_TYPES as PR2_TYPES

SHOWS = {
    "RobotModel": "String",
    "MarkerArray": "MarkerArray",
    "Map": "OccupancyGrid",
    "Path": "Path",
    "LaserScan": "LaserScan",
    "Odometry": "Odometry",
    "PoseWithCovariance": "PoseWithCovarianceStamped",
    "Pose": "PoseStamped",
    "Wrench": "WrenchStamped",
    "Image": "Image",
}
OF_NODES = {  # topic: type and whether it is latched; what comes from a simulator is looked up
    "/object_models/markers": ("MarkerArray", False),
    "/global_costmap/costmap": ("OccupancyGrid", True),
    "/local_costmap/costmap": ("OccupancyGrid", True),
    "/plan": ("Path", True),
}
LATCHED = {*shared.LATCHED, *KRANG_LATCHED, *PR2_LATCHED}


def published() -> dict[str, tuple[str, bool]]:
    types = {**krang_types((), 1), **PR2_TYPES}
    return OF_NODES | {topic: (kind.__name__, topic in LATCHED) for topic, kind in types.items()}


def manager() -> dict[str, Any]:
    return yaml.safe_load((workspace() / "config/rviz/pbrl.rviz").read_text())["Visualization Manager"]


def topics() -> list[tuple[str, dict[str, Any]]]:
    found = []
    for display in manager()["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        found += [(kind, display[key]) for key in ("Topic", "Description Topic") if key in display]
    return found


@pytest.mark.parametrize(("kind", "topic"), topics(), ids=lambda each: each if isinstance(each, str) else each["Value"])
def test_a_display_shows_what_is_published(kind: str, topic: dict[str, Any]) -> None:
    assert not topic["Value"].startswith("/"), "relative, for robots in a namespace"
    name, latched = published()["/" + topic["Value"]]
    assert name == SHOWS[kind]
    assert (topic["Durability Policy"] == "Transient Local") == latched


def test_goals_are_given_where_they_are_heard() -> None:
    (goal,) = [tool for tool in manager()["Tools"] if tool["Class"].endswith("SetGoal")]
    assert goal["Topic"]["Value"] == "goal_pose"
    assert manager()["Global Options"]["Fixed Frame"] == "world"
