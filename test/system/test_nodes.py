"""Every node is found and started as `ros2 run PACKAGE EXECUTABLE` finds and starts it."""

from __future__ import annotations

import subprocess
from configparser import ConfigParser
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_packages_with_prefixes

from pbrl_bringup.graph import free_domain, node_environment
from pbrl_bringup.paths import node_executable, workspace

NODES = [
    ("krang_sim", "sim_node"),
    ("krang_sim", "hand_node"),
    ("pr2_cart_sim", "sim_node"),
    ("tabletop_sim", "sim_node"),
    ("pbrl_bag", "recorder_node"),
    ("pbrl_bag", "player_node"),
    ("pbrl_control", "body_controller_node"),
    ("pbrl_control", "push_node"),
    ("pbrl_model", "model_node"),
    ("pbrl_model", "tag_detector_node"),
    ("pbrl_mismatch", "mismatch_node"),
    ("pbrl_planner", "costmap_node"),
    ("pbrl_planner", "lattice_planner_node"),
    ("pbrl_planner", "cart_controller_node"),
    ("pbrl_planner", "cart_navigator_node"),
    ("pbrl_planner", "tabletop_node"),
    ("pbrl_namo", "namo_node"),
]


def declared_nodes() -> set[tuple[str, str]]:
    """What the built packages' entry points say."""
    found = set()
    for path in workspace().glob("build/*/*.egg-info/entry_points.txt"):
        points = ConfigParser()
        points.read(path)
        package = path.parent.parent.name
        found |= {(package, name) for name in points["console_scripts"] if name.endswith("_node")}
    return found


def test_every_node_is_known_here() -> None:
    assert declared_nodes() == set(NODES)


@pytest.mark.parametrize(("package", "executable"), NODES)
def test_the_ament_index_leads_to_the_executable(package: str, executable: str) -> None:
    path = Path(get_package_prefix(package)) / "lib" / package / executable
    assert path == node_executable(package, executable)
    assert path.is_file()
    assert path.stat().st_mode & 0o111


@pytest.mark.parametrize(
    "package", ["pbrl_msgs", "pbrl_config", "pbrl_description", "pbrl_bringup", *sorted({name for name, _ in NODES})]
)
def test_every_package_is_in_the_index(package: str) -> None:
    prefix = get_packages_with_prefixes()[package]
    assert (Path(prefix) / "share" / package / "package.xml").is_file()


@pytest.mark.parametrize(
    ("package", "executable", "parameter", "word"),
    [
        ("krang_sim", "sim_node", 'scene:="locked_castor"', "locked_caster"),
        ("krang_sim", "hand_node", 'scene:="locked_castor"', "locked_caster"),
        ("tabletop_sim", "sim_node", 'scene:="dekc"', "desk"),
        ("tabletop_sim", "sim_node", 'vision:="blurred"', "rendered, noise or empty"),
        ("pbrl_planner", "tabletop_node", "think:=0.0", "0.05 to 600"),
        ("pbrl_control", "push_node", 'plan:="turn_tabel"', "turn_table"),
        ("pbrl_model", "model_node", 'priors:="nowhere.yaml"', "nowhere.yaml"),
        ("pbrl_mismatch", "mismatch_node", "without:=['carpet']", "carpet"),
        ("pbrl_namo", "namo_node", 'goal:="over there"', "x y theta"),
        ("pbrl_planner", "costmap_node", "rate:=50.0", "0.1 to 20"),
        ("pbrl_planner", "cart_controller_node", 'settings:="nowhere.yaml"', "nowhere.yaml"),
        ("pbrl_bag", "player_node", 'bag:="nowhere"', "nowhere"),
    ],
)
def test_a_wrong_parameter_is_one_line_and_exit_code_2(
    package: str, executable: str, parameter: str, word: str, tmp_path: Path, nothing_left: None
) -> None:
    command = [str(node_executable(package, executable)), "--ros-args", "-p", parameter]
    with free_domain() as domain:
        result = subprocess.run(
            command, cwd=tmp_path, env=node_environment(domain), capture_output=True, text=True, timeout=60
        )
    lines = [line for line in result.stderr.splitlines() if line.strip()]
    assert result.returncode == 2, result.stderr
    assert len(lines) == 1, result.stderr
    assert word in lines[0]
