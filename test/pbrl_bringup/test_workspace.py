"""The set-up: what it refuses, what it repairs, what it leaves alone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pbrl_bringup import workspace

ROOT = Path(__file__).resolve().parents[2]


def test_no_ros_sourced_means_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert workspace.sourced_ros() is None


def test_sourced_jazzy_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")
    assert workspace.sourced_ros() == "/opt/ros/jazzy"


def test_another_distribution_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "humble")
    with pytest.raises(workspace.SetupError, match=r"jazzy.*got 'humble'"):
        workspace.sourced_ros()


def test_wrong_python_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 10, 0, "final", 0))
    with pytest.raises(workspace.SetupError, match=r"expected Python 3\.11.*got 3\.10"):
        workspace.require_tools(ros=False)


def test_missing_compiler_is_one_line_and_stops(tmp_path: Path) -> None:
    """The real script, with a PATH on which there is everything but a compiler."""
    clone = tmp_path / "clone"
    shutil.copytree(ROOT / "src/pbrl_bringup", clone / "src/pbrl_bringup")
    shutil.copy(ROOT / "pbrl", clone / "pbrl")
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("bash", "cat", "cksum", "dirname", "readlink", "ls", "flock", "make", "cmake"):
        (tools / name).symlink_to(shutil.which(name) or f"/usr/bin/{name}")
    (tools / "python3.11").symlink_to(Path(sys.executable).resolve())
    env = {key: value for key, value in os.environ.items() if not key.startswith(("ROS", "AMENT", "PYTHON"))}
    result = subprocess.run([clone / "pbrl"], env=env | {"PATH": str(tools)}, capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr.strip().count("\n") == 0
    assert "expected the program 'cc'" in result.stderr
    assert not (clone / ".venv").exists()


def test_repair_puts_this_machine_where_the_builder_was(tmp_path: Path) -> None:
    (tmp_path / "lib/python3.11/site-packages").mkdir(parents=True)
    exported = tmp_path / "share/some_msgs/cmake/export.cmake"
    exported.parent.mkdir(parents=True)
    exported.write_text(
        f'set(A "{workspace.WHEEL_PYTHON}/include/python3.11")\n'
        f'set(B "{workspace.WHEEL_PYTHON}/lib/python3.11/site-packages/numpy")\n'
    )
    untouched = exported.with_name("other.cmake")
    untouched.write_text("set(C 1)\n")
    before = untouched.stat().st_mtime_ns
    workspace.repair_wheels(tmp_path)
    assert workspace.WHEEL_PYTHON not in exported.read_text()
    assert str(tmp_path / "lib/python3.11/site-packages/numpy") in exported.read_text()
    assert untouched.stat().st_mtime_ns == before


def test_interface_package_of_the_underlay_is_complete(tmp_path: Path) -> None:
    workspace.write_interface_package(tmp_path / "tf2_msgs", "tf2_msgs")
    assert "TransformStamped[] transforms" in (tmp_path / "tf2_msgs/msg/TFMessage.msg").read_text()
    assert "find_package(geometry_msgs REQUIRED)" in (tmp_path / "tf2_msgs/CMakeLists.txt").read_text()
    assert "<depend>geometry_msgs</depend>" in (tmp_path / "tf2_msgs/package.xml").read_text()
