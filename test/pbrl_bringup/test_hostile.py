"""Files and options that nobody should write: one line, exit code 2, nothing left behind."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.paths import workspace

MakeBag = Callable[..., Path]
CONFIG = workspace() / "config"
MAPPING = (CONFIG / "mappings/pr2_cabinet.yaml").read_text()
PLAN = (CONFIG / "params/pushes/turn_table.yaml").read_text()
SCENE = (CONFIG / "scenes/locked_caster.yaml").read_text()
COLUMNS = "t_s,hook_x_m,hook_y_m,hook_z_m,wrist_fx_N,wrist_fy_N,wrist_fz_N"


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *arguments: str) -> str:
    """Run a command that has to be refused; return its one line."""
    before = sorted(folder.rglob("*"))
    assert run_arguments(arguments) == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith("pbrl: ")
    assert "\n" not in error, error
    assert sorted(folder.rglob("*")) == before
    return error


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pulled(rows: int = 60, speed: float = 0.05) -> str:
    """A CSV of a handle that is pulled along x at a steady speed [m/s]."""
    lines = [f"{0.02 * i:.3f},{1 + 0.02 * i * speed:.5f},0,0,1,0,0" for i in range(rows)]
    return "\n".join([COLUMNS, *lines]) + "\n"


def edited(text: str, **changes: Any) -> str:
    """Change values of a YAML document by their key anywhere in it."""

    def walk(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: changes.get(str(key), walk(item)) for key, item in value.items()}
        return [walk(item) for item in value] if isinstance(value, list) else value

    return yaml.safe_dump(walk(yaml.safe_load(text)))


def test_no_command_shows_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_arguments([]) == 0
    shown = capsys.readouterr()
    assert "Commands:" in shown.out
    assert shown.out.count("\n") > 10
    assert shown.err == ""


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "NoneType"),
        ("- room\n", "list"),
        ("room:\n\toutline: []\n", "line 2"),
        ("[" * 3000 + "]" * 3000, "deep"),
        ("name: " + "9" * 5000, "digits"),
        (SCENE + "name: again\n", "'name' is there twice"),
        (edited(SCENE, nominal_mass=1e308), "nominal_mass"),
        (edited(SCENE, height=1e12), "height"),
        (edited(SCENE, pose=[1.0, 0.0, 1e300]), "pose"),
        (edited(SCENE, outline=[[-1.5, -3], [1e9, -3], [1e9, 3], [-1.5, 3]]), "outline"),
        (SCENE.replace("table_a", "../table"), "letters, digits"),
        (SCENE.replace("[1.19, -0.25, 0.0]", "[0.1, 0.0, 0.0]"), "clear of the robot"),
        (SCENE.replace("table_a", "desk"), "no object 'table_a'"),
    ],
    ids=[
        "empty",
        "list",
        "tab",
        "deep",
        "digits",
        "twice",
        "mass",
        "height",
        "angle",
        "room",
        "name",
        "robot",
        "other",
    ],
)
def test_scenes(text: str, word: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "scene.yaml").write_text(text)
    assert word in refused(capsys, here, "simulate", "scene.yaml", "--out", "bag")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (PLAN + "object: table_a\n", "'object' is there twice"),
        ("[" * 3000, "deep"),
        (edited(PLAN, object="tabel_a"), "did you mean 'table_a'"),
        (edited(PLAN, duration=1e9), "at most 180 s"),
        (edited(PLAN, duration=float("nan")), "duration"),
    ],
    ids=["twice", "deep", "unknown object", "endless", "NaN"],
)
def test_push_plans(text: str, word: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "plan.yaml").write_text(text)
    assert word in refused(capsys, here, "simulate", "locked_caster", "--push", "plan.yaml", "--out", "bag")


@pytest.mark.parametrize(
    ("mapping", "table", "word"),
    [
        (MAPPING + "wrenches: {}\n", pulled(), "'wrenches' is there twice"),
        ("[" * 3000, pulled(), "deep"),
        (edited(MAPPING, footprint=[[0, 0], [1, 1], [1, 0], [0, 1]]), pulled(), "cross itself"),
        (edited(MAPPING, footprint=[[0, 0], [1e300, 0], [1, 1]]), pulled(), "within"),
        (MAPPING.replace("door", '"../../door"'), pulled(), "letters"),
        (MAPPING + "  - {gripper: right, object: door, start: 0.5}\n", pulled(), "one object at a time"),
        (MAPPING, pulled(speed=0.0), "poses that change"),
        (MAPPING, pulled(rows=1), "at least 2 rows"),
        (MAPPING, pulled(rows=3), "at least 0.5 s"),
        (MAPPING, pulled().replace("1.00100", "1e300"), "jumps"),
        (MAPPING, pulled().replace(",", ";"), "'t_s'"),
        (MAPPING, pulled().replace(",", ";").replace(".", ","), "delimiter"),
    ],
    ids=[
        "twice",
        "deep",
        "bow tie",
        "huge",
        "name",
        "two at once",
        "still",
        "row",
        "short",
        "jump",
        "semicolon",
        "comma",
    ],
)
def test_mappings_and_tables(
    mapping: str, table: str, word: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "map.yaml").write_text(mapping)
    (here / "pull.csv").write_text(table)
    assert word in refused(capsys, here, "fit", "pull.csv", "--map", "map.yaml", "--out", "out")


@pytest.mark.parametrize("table", ["\ufeff" + pulled(), pulled().replace("\n", "\r\n"), pulled().replace("\n", "\n\n")])
def test_what_spreadsheets_do_to_a_table_is_read(table: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "map.yaml").write_text(MAPPING)
    (here / "pull.csv").write_bytes(table.encode())
    assert run_arguments(["info", "pull.csv", "--map", "map.yaml"]) == 0
    assert "door" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("metadata", "word"),
    [
        ("[" * 3000, "deep"),
        ("", "rosbag2_bagfile_information"),
        ("rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: 3}", "expected a list"),
        ("rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [x.mcap]}", "x.mcap"),
        ("rosbag2_bagfile_information: {storage_identifier: parquet}", "parquet"),
        ("rosbag2_bagfile_information: {storage_identifier: sqlite3}", "relative_file_paths"),
        ("rosbag2_bagfile_information: {storage_identifier: sqlite3, relative_file_paths: [x.db3]}", "x.db3"),
    ],
)
@pytest.mark.parametrize("command", ["info", "fit", "play"])
def test_metadata(command: str, metadata: str, word: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "bag").mkdir()
    (here / "bag/metadata.yaml").write_text(metadata)
    assert word in refused(capsys, here, command, "bag")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "empty"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF" + bytes(500), "expected an MCAP"),
        (b"\x89MCAP0\r\n", "got none"),
        (None, "got neither"),
    ],
    ids=["no bytes", "photograph", "first bytes only", "folder"],
)
@pytest.mark.parametrize("command", ["info", "fit"])
def test_files_that_are_no_recording(
    command: str, content: bytes | None, word: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is None:
        (here / "x.mcap").mkdir()
    else:
        (here / "x.mcap").write_bytes(content)
    assert word in refused(capsys, here, command, "x.mcap")


def test_a_recording_cut_anywhere_is_read_or_refused(
    make_bag: MakeBag, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = next(make_bag().glob("*.mcap")).read_bytes()
    for size in np.random.default_rng(0).integers(0, len(whole), 12).tolist():
        (here / "cut.mcap").write_bytes(whole[:size])
        assert run_arguments(["info", "cut.mcap"]) in (0, 2), size
        error = capsys.readouterr().err
        assert "a fault in pbrl" not in error, size
        assert error.count("\n") == 1, size


@pytest.mark.parametrize("command", ["fit", "info"])
def test_a_body_s_name_leads_nowhere(
    command: str, make_bag: MakeBag, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def renamed(topic: str, index: int, message: Any) -> Any:
        if topic == "/scene":
            message.bodies[0].name = "../../table"
        return message

    make_bag(renamed)
    assert "letters" in refused(capsys, here, command, "bag")


PLACES = ["file", "file/below", "/proc/pbrl", "x" * 300]


@pytest.mark.parametrize("out", [*PLACES, ""])
@pytest.mark.parametrize(
    "command", [("simulate", "locked_caster"), ("record", "--duration", "1")], ids=["simulate", "record"]
)
def test_bags_that_cannot_be_made(
    command: tuple[str, ...], out: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "file").touch()
    refused(capsys, here, *command, "--out", out)


@pytest.mark.parametrize("out", PLACES)
@pytest.mark.parametrize(
    "command", [("fit", "bag"), ("demo", "--headless"), ("bench", "sim")], ids=["fit", "demo", "bench"]
)
def test_results_that_cannot_be_written_are_refused_before_the_work(
    command: tuple[str, ...], out: str, make_bag: MakeBag, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "file").touch()
    make_bag()
    refused(capsys, here, *command, "--out", out)


@pytest.mark.parametrize("setting", ["sim.scene=[", "sim.scene={a: 1}", "sim.scene="])
def test_settings_of_a_graph(setting: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert setting in refused(capsys, here, "run", "krang_push", "--set", setting)


@pytest.mark.parametrize("rate", ["0", "inf", "nan", "-1"])
def test_rates(rate: str, make_bag: MakeBag, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_bag()
    assert "--rate" in refused(capsys, here, "play", "bag", "--rate", rate)


def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pbrl_bringup", "simulate", "locked_caster", "--out", "bag"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        for _ in range(1000):
            if (tmp_path / ".bag.part/bag").exists() or process.poll() is not None:
                break
            with suppress(subprocess.TimeoutExpired):
                process.wait(0.02)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=10)
    assert (process.returncode, error) == (130, "pbrl: stopped\n")
    assert list(tmp_path.iterdir()) == []
