"""The whole graph over DDS, as a person starts it: push, recording, posterior over its topic, page."""

from __future__ import annotations

import json
import math
import re
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from pbrl_bag import cut_episodes, describe, read_recording
from pbrl_bringup.graph import free_domain
from pbrl_bringup.report_data import Report

CONTRACT = {
    "/clock",
    "/joint_states",
    "/odom",
    "/tf",
    "/tf_static",
    "/robot_description",
    "/scene",
    "/grasps",
    "/wrist_ft/left",
    "/wrist_ft/right",
    "/ar_tags/table_a/pose",
    "/ar_tags/left_gripper/pose",
    "/ar_tags/right_gripper/pose",
    "/markers",
    "/cmd_vel",
    "/left_arm_velocity_controller/commands",
    "/right_arm_velocity_controller/commands",
    "/object_twist_command",
    "/push/status",
}


@pytest.fixture(scope="module")
def finished_demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[subprocess.CompletedProcess[str], Path]:
    """One run of the demo, shared by the tests of this file."""
    folder = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-m", "pbrl_bringup", "demo", "--headless", "--seed", "1", "--out", "demo"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=280)
    return result, folder / "demo"


def test_the_demo_ends_with_the_page_s_path(finished_demo: tuple[subprocess.CompletedProcess[str], Path]) -> None:
    result, folder = finished_demo
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == str(folder / "report.html")


def test_the_recording_holds_the_contract(finished_demo: tuple[subprocess.CompletedProcess[str], Path]) -> None:
    _, folder = finished_demo
    info = describe(folder / "bag")
    assert info.finished
    assert {topic.name for topic in info.topics} >= CONTRACT
    (episode,) = cut_episodes(read_recording(folder / "bag"))
    assert episode.object == "table_a"
    assert episode.duration > 5.0


def test_what_is_concealed_is_not_in_the_recording(
    finished_demo: tuple[subprocess.CompletedProcess[str], Path],
) -> None:
    _, folder = finished_demo
    for file in folder.glob("bag/*"):
        assert b"concealed" not in file.read_bytes()
        assert b"rear_right" not in file.read_bytes()


def test_the_page_and_the_numbers_are_about_the_table(
    finished_demo: tuple[subprocess.CompletedProcess[str], Path],
) -> None:
    _, folder = finished_demo
    page = (folder / "report.html").read_text()
    found = re.search(r'id="report">(.*?)</script>', page, re.DOTALL)
    assert found
    (table,) = Report.model_validate_json(found.group(1)).objects
    assert table.name == "table_a"
    assert table.wheel is not None
    assert table.truth is not None
    assert table.truth.distance == pytest.approx(min(math.dist(table.wheel.mean, at) for at in table.truth.locked))
    parameters = json.loads((folder / "report.json").read_text())["objects"]["table_a"]["parameters"]
    assert set(parameters) >= {"mass", "wheel_x", "wheel_y", "mu_x", "mu_y"}


def test_no_node_is_left(finished_demo: tuple[subprocess.CompletedProcess[str], Path]) -> None:
    assert finished_demo[0].returncode == 0
    running = [" ".join(each.info["cmdline"] or []) for each in psutil.process_iter(["cmdline"])]
    assert not [line for line in running if str(finished_demo[1]) in line]


def test_ctrl_c_in_mid_run_leaves_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pbrl_bringup", "run", "krang", "--logs", "logs", "--domain"]
    with (
        free_domain() as domain,
        subprocess.Popen([*command, str(domain)], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process,
    ):
        assert process.stderr is not None
        for line in process.stderr:
            if "Ctrl-C stops them" in line:
                break
        nodes = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    assert len(nodes) == 2
    assert not [node for node in nodes if node.is_running()]
