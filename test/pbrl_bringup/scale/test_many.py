"""`fit` and `diagnose` of several recordings: what each alone gives, whatever the number of workers."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pbrl_bringup.cli.app import run_arguments

FEW = ("--draws", "20", "--model-class", "free")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, write_push: Callable[[Path, float], Path]) -> Path:
    """Two pushes, each with its own force, and a file that is none."""
    folder = tmp_path_factory.mktemp("runs")
    for number in range(2):
        write_push(folder / f"{number}/bag", -10.0 - number)
    (folder / "torn.bag").write_bytes(b"#ROSBAG V2.0\n")
    return folder


def without_seconds(text: str) -> Any:
    return {name: value for name, value in json.loads(text).items() if name not in ("seconds", "recording")}


def test_results_do_not_depend_on_the_number_of_workers(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, bags = runs.parent / "out", [str(runs / f"{number}/bag") for number in range(2)]
    for workers in (1, 2):
        many = ("fit", *bags, "--out", str(out / str(workers)), "--scheduler", f"local:{workers}", *FEW)
        assert run_arguments(many) == 0, capsys.readouterr().err
    assert run_arguments(["fit", bags[1], "--out", str(out / "alone"), *FEW]) == 0
    one, two = out / "1", out / "2"
    assert (one / "summary.csv").read_bytes() == (two / "summary.csv").read_bytes()
    assert without_seconds((one / "report.json").read_text()) == without_seconds((two / "report.json").read_text())
    for number in range(2):
        here, there = (folder / f"{number}_bag" for folder in (one, two))
        assert (here / "model_table.json").read_bytes() == (there / "model_table.json").read_bytes()
        reports = [without_seconds((folder / "report.json").read_text()) for folder in (here, there)]
        assert reports[0] == reports[1]
    assert (out / "alone/model_table.json").read_bytes() == (one / "1_bag/model_table.json").read_bytes()
    assert reports[0] != without_seconds((one / "0_bag/report.json").read_text()), "the pushes differ"
    assert f"./pbrl fit {bags[1]} --out" in (one / "1_bag/report.html").read_text()


def test_a_recording_that_cannot_be_read_costs_itself(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = runs.parent / "partly"
    assert run_arguments(["fit", str(runs), "--out", str(out), "--scheduler", "local:1", *FEW]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("pbrl: 1 of 3 recordings failed")
    assert "torn.bag" in error
    with (out / "summary.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [bool(row["failed"]) for row in rows] == [False, False, True]
    assert [row["object"] for row in rows] == ["table", "table", ""]
    assert not (out / "torn").exists()
