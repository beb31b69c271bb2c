"""Schemas: complete, each dependency once, understood by readers that know no package."""

from __future__ import annotations

import re

import pytest
from mcap_ros2._dynamic import generate_dynamic

from pbrl_bag import BagError
from pbrl_bag.schema import dependencies, fields_of, message_definition, type_hash

TYPES = [
    "pbrl_msgs/msg/Scene",
    "pbrl_msgs/msg/Grasps",
    "pbrl_msgs/msg/ObjectModels",
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
    "visualization_msgs/msg/MarkerArray",
    "std_msgs/msg/Empty",
]


@pytest.mark.parametrize("name", TYPES)
def test_a_schema_holds_every_dependency_once(name: str) -> None:
    text = message_definition(name)
    heads = re.findall(r"^={80}\nMSG: (\S+)$", text, flags=re.MULTILINE)
    assert heads == [other.replace("/msg/", "/") for other in dependencies(name)]
    assert len(heads) == len(set(heads))
    assert name in generate_dynamic(name, text)


def test_dependencies_are_found_through_all_levels() -> None:
    assert set(dependencies("pbrl_msgs/msg/Grasps")) == {
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
        "pbrl_msgs/msg/Grasp",
        "geometry_msgs/msg/Point",
    }


def test_fields_are_those_of_the_wire() -> None:
    fields = fields_of("geometry_msgs/msg/PoseWithCovariance")
    assert [(field.name, field.type, field.array, field.length) for field in fields] == [
        ("pose", "geometry_msgs/msg/Pose", False, None),
        ("covariance", "float64", True, 36),
    ]
    names = [field.name for field in fields_of("visualization_msgs/msg/Marker")]
    assert "ARROW" not in names
    assert {"header", "points", "mesh_use_embedded_materials"} <= set(names)


def test_hashes_are_those_that_the_packages_install() -> None:
    point = "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881"
    assert type_hash("geometry_msgs/msg/Point") == point
    assert type_hash("no_such/msg/Thing") == ""


@pytest.mark.parametrize("name", ["PoseStamped", "geometry_msgs/PoseStamped", "a/srv/B", "", "../msg/Thing"])
def test_a_name_of_another_form_is_refused(name: str) -> None:
    with pytest.raises(BagError, match="expected a name like"):
        message_definition(name)


def test_a_type_that_is_not_installed_says_what_to_source() -> None:
    with pytest.raises(BagError, match=r"no_such/msg/Thing\.msg.*source the workspace"):
        message_definition("no_such/msg/Thing")
