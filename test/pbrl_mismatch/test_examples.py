"""The examples run as they stand in `examples/`, in a process of their own, and find what is there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pbrl_bag import Recording, write_recording

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
LIBRARIES = ("fit_a_bag.py", "diagnose_a_bag.py")


def run(name: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=280)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, concealed_recording: Callable[..., Recording]) -> Path:
    path = tmp_path_factory.mktemp("examples") / "bag"
    write_recording(concealed_recording("viscous_drag", 1), path)
    return path


def test_learning_from_a_bag(bag: Path) -> None:
    done = run("fit_a_bag.py", str(bag), "--draws", "50", "--out", "fit", folder=bag.parent)
    assert done.returncode == 0, done.stderr
    assert "wheel_x" in done.stdout and "kg" in done.stdout
    assert {path.name for path in (bag.parent / "fit").iterdir()} == {"posterior_table.nc", "table.png"}


def test_diagnosing_a_bag(bag: Path) -> None:
    done = run("diagnose_a_bag.py", str(bag), "--quick", "--out", "diagnose", folder=bag.parent)
    assert done.returncode == 0, done.stderr
    report = json.loads((bag.parent / "diagnose" / "report.json").read_text())
    assert [each["effect"] for each in report["objects"]["table"]["effects"]] == ["viscous_drag"]
    assert json.loads((bag.parent / "diagnose" / "model_table.json").read_text())["effects"]


def test_an_effect_of_one_s_own_is_found(tmp_path: Path) -> None:
    done = run("your_own_effect.py", "--quick", "--out", "fan", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "fan" / "report.json").read_text())["objects"]["table"]
    assert [each["effect"] for each in found["effects"]] == ["fan"]
    told = found["effects"][0]["parameters"]
    assert set(told) == {f"fan_{name}" for name in ("force", "x", "y", "heading", "width")}
    assert told["fan_heading"]["unit"] == "rad" and abs(told["fan_heading"]["mean"] - 2.0) < 0.1
    assert abs(told["fan_force"]["mean"] - 9.0) < 2.0
    heldout = found["heldout"]["rmse_position_m"]
    assert heldout["repaired"] < 0.7 * heldout["baseline"]
    assert "fan" in (tmp_path / "fan" / "report.html").read_text()


@pytest.mark.parametrize("name", LIBRARIES)
def test_what_cannot_be_read_is_told_without_a_traceback(name: str, tmp_path: Path) -> None:
    done = run(name, "nowhere", folder=tmp_path)
    assert done.returncode == 1 and "nowhere" in done.stderr and "./pbrl simulate" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", LIBRARIES)
def test_those_for_bags_need_the_libraries_alone(name: str) -> None:
    text = (EXAMPLES / name).read_text()
    assert not any(word in text for word in ("rclpy", "pbrl_bringup", "bullet_sim", "pbrl_msgs"))
