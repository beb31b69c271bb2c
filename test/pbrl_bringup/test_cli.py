"""The command line as a person meets it: exit codes, one line for each mistake, and that in a process of its own."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from pbrl_bringup.cli.app import app, run_arguments

MakeBag = Callable[..., Path]
NAMED = [
    *("demo", "test", "fit", "diagnose", "simulate", "run", "record", "play", "info", "map"),
    *("view", "export", "bench", "experiment", "cluster"),
]
COMMANDS = sorted(command.name or command.callback.__name__ for command in app.registered_commands if command.callback)


@dataclass
class Ended:
    """How a command ended, and what it said."""

    returncode: int
    stdout: str
    stderr: str


Pbrl = Callable[..., Ended]


@pytest.fixture
def pbrl(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Pbrl:
    """Run a command in this process: one of its own takes seconds to import all that a fit needs."""

    def run(*arguments: str, cwd: Path) -> Ended:
        monkeypatch.chdir(cwd)
        capsys.readouterr()
        return Ended(run_arguments(arguments), *capsys.readouterr())

    return run


def assert_one_line(result: Ended | subprocess.CompletedProcess[str], *words: str) -> None:
    """The mistake is told in one line on stderr that holds every word, and the exit code is 2."""
    lines = result.stderr.strip().splitlines()
    assert result.returncode == 2, result.stderr
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("pbrl: ")
    for word in words:
        assert word in lines[0]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_arguments([name, "--help"]) == 0
    assert f"Example: ./pbrl {name}" in capsys.readouterr().out


def test_the_contract_s_commands_are_there() -> None:
    assert sorted(NAMED) == COMMANDS


@pytest.mark.parametrize("name", ["demo", "fit", "diagnose", "simulate", "bench", "experiment"])
def test_randomness_has_a_seed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run_arguments([name, "--help"])
    assert "--seed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fti",), ("'fti'", "fit")),
        (("fit",), ("bag",)),
        (("fit", "nowhere.mcap"), ("nowhere.mcap",)),
        (("fit", "x.csv", "--seed", "-1"), ("--seed",)),
        (("simulate", "locked_castor", "--out", "bag"), ("locked_castor", "locked_caster")),
        (("simulate", "locked_caster", "--out", "bag", "--push", "nothing"), ("nothing", "turn_table")),
        (("bench", "wheal"), ("wheal", "wheel")),
        (("experiment", "apartement"), ("apartement", "apartment")),
        (("run", "krang_puhs"), ("krang_puhs", "krang_push")),
        (("run", "krang_push", "--set", "sim"), ("'sim'", "NODE.PARAMETER=VALUE")),
        (("run", "krang_push", "--with", "camera"), ("'camera'", "recorder")),
        (("info", "nowhere"), ("nowhere",)),
        (("play", "nowhere"), ("nowhere",)),
    ],
)
def test_mistakes_are_one_line(arguments: tuple[str, ...], words: tuple[str, ...], pbrl: Pbrl, tmp_path: Path) -> None:
    assert_one_line(pbrl(*arguments, cwd=tmp_path), *words)
    assert list(tmp_path.iterdir()) == []


def test_so_they_are_in_a_process_of_its_own(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pbrl_bringup", "fit", "nowhere.mcap"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert_one_line(ended, "nowhere.mcap")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_scene_key_is_named(pbrl: Pbrl, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("room: {outline: [[0, 0], [4, 0], [4, 4], [0, 4]]}\nbodeis: {}\n")
    result = pbrl("simulate", "scene.yaml", "--out", "bag", cwd=tmp_path)
    assert_one_line(result, "scene.yaml", "bodeis", "bodies")
    assert not (tmp_path / "bag").exists()


def test_a_recording_is_not_written_over(pbrl: Pbrl, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/precious").touch()
    for arguments in (("simulate", "locked_caster"), ("record",)):
        assert_one_line(pbrl(*arguments, "--out", "bag", cwd=tmp_path), "bag", "exists")
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["precious"]


def without(topic_left_out: str) -> Callable[[str, int, Any], Any]:
    return lambda topic, index, message: None if topic == topic_left_out else message


def nan_in_a_wrench(topic: str, index: int, message: Any) -> Any:
    if topic == "/wrist_ft/left" and index == 250:
        message.wrench.force.y = math.nan
    return message


def a_jump(topic: str, index: int, message: Any) -> Any:
    if topic == "/ar_tags/table/pose" and index >= 45:
        message.pose.position.x += 3.0
    return message


def no_duration(topic: str, index: int, message: Any) -> Any:
    if topic == "/grasps" and index == 2:
        message.header.stamp.sec = 2
    return message


@pytest.mark.parametrize("command", ["info", "fit"])
@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (without("/scene"), ("/scene",)),
        (without("/ar_tags/table/pose"), ("table",)),
        (without("/wrist_ft/left"), ("left",)),
        (nan_in_a_wrench, ("/wrist_ft/left", "force", "2.5")),
        (a_jump, ("/ar_tags/table/pose", "3.0")),
        (no_duration, ("table", "2.0")),
    ],
    ids=["no scene", "no pose", "no wrench", "NaN", "jump", "zero length"],
)
def test_a_malformed_recording_is_one_line(
    command: str, edit: Callable[[str, int, Any], Any], words: tuple[str, ...], pbrl: Pbrl, make_bag: MakeBag
) -> None:
    bag = make_bag(edit)
    result = pbrl(command, "bag", *(["--out", "out"] if command == "fit" else []), cwd=bag.parent)
    assert_one_line(result, *words)
    assert not list((bag.parent / "out").glob("*"))


@pytest.mark.parametrize("command", ["info", "fit"])
def test_a_truncated_file_is_one_line(command: str, pbrl: Pbrl, make_bag: MakeBag) -> None:
    bag = make_bag()
    file = next(bag.glob("*.mcap"))
    with file.open("r+b") as opened:
        opened.truncate(file.stat().st_size // 4)
    result = pbrl(command, str(file), *(["--out", "out"] if command == "fit" else []), cwd=bag.parent)
    assert_one_line(result, file.name)
    assert not (bag.parent / "out").exists()


def test_info_tells_what_a_recording_holds(pbrl: Pbrl, make_bag: MakeBag) -> None:
    bag = make_bag()
    result = pbrl("info", "bag", cwd=bag.parent)
    assert result.returncode == 0, result.stderr
    for word in ("/wrist_ft/left", "geometry_msgs/msg/WrenchStamped", "600", "100.0 Hz", "table", "3.00 s"):
        assert word in result.stdout


def test_a_fault_of_ours_is_one_line_too(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> None:
        raise TypeError("two\nlines")

    monkeypatch.setattr("pbrl_bringup.cli.handing.import_module", broken)
    monkeypatch.delenv("PBRL_TRACEBACK", raising=False)
    assert run_arguments(["info", "bag"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("pbrl: a fault in pbrl at test_cli.py")
