"""The command `diagnose` on a recording of the contract: report, page, and one line for what a person can mend."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pbrl_bag import write_recording
from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.commands import diagnose as command
from pbrl_bringup.concealed.cases import Case, make
from pbrl_bringup.diagnosis.residuals import RESULTS


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pbrl_bringup.concealed.stage.PUSHES", 1)
        recording = make(Case((), 3)).recording
    return write_recording(recording, tmp_path_factory.mktemp("clean") / "bag")


def test_a_clean_recording_is_told_to_be_one(bag: Path, tmp_path: Path) -> None:
    assert run_arguments(["diagnose", str(bag), "--out", str(tmp_path / "found")]) == 0
    report = json.loads((tmp_path / "found" / "report.json").read_text())
    assert set(report) == {"recording", "objects", "next_experiment", "seconds"}
    found = report["objects"]["table"]
    assert found["mismatch"] is False and found["p_value"] > 0.05 and found["effects"] == []
    assert found["heldout"]["rmse_position_m"]["baseline"] == found["heldout"]["rmse_position_m"]["repaired"]
    lacking = json.loads((tmp_path / "found" / "residual.json").read_text())["objects"]["table"]
    assert len(lacking["time"]) == len(lacking["wrench"]) == len(lacking["sd"]) > 100
    page = (tmp_path / "found" / "report.html").read_text()
    assert page.count("<svg") >= 3 and 'href="http' not in page and "src=" not in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--baseline", "wheeel"], "expected baselines among"),
        (["--without", "tehter"], "tether"),
    ],
)
def test_options_that_do_not_fit_are_told(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert run_arguments(["diagnose", str(bag), "--out", str(tmp_path / "found"), *arguments]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "found").exists()


def test_results_in_a_folder_are_of_one_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a page cannot be drawn, no report of this run or of one before says that the rest is there."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    for name in (*RESULTS, "notes.txt"):
        (tmp_path / name).write_text("of another run")
    monkeypatch.setattr(command, "write_models", lambda *_: {})
    monkeypatch.setattr(command, "write_diagnosis", interrupted)
    found: Any = SimpleNamespace(objects={}, to_report=dict)
    anything: Any = SimpleNamespace(seed=0)
    with pytest.raises(KeyboardInterrupt):
        command.write_found(found, anything, tmp_path, "./pbrl diagnose", anything)
    assert {each.name for each in tmp_path.iterdir()} == {"residual.json", "notes.txt"}
    assert "another run" not in (tmp_path / "residual.json").read_text()
    monkeypatch.setattr(command, "write_diagnosis", lambda *_, **__: None)
    command.write_found(found, anything, tmp_path, "./pbrl diagnose", anything)
    assert (tmp_path / "report.json").read_text() == "{}\n"
