"""Runs are made once: what was kept comes back as it was, what is of another run or damaged is refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.kept import kept_run
from pbrl_bringup.namo_run import Moment, NamoOutcome

TOLD = {"seed": 3, "number": 1}


def outcome() -> NamoOutcome:
    moment = Moment(3.5, "Planning", "plans", (0.0, 0.1, 0.2), {"table": (2.6, 0.9, 0.0)}, "table")
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    return NamoOutcome(
        "Done", "at the goal", 100.25, {"plans": 2.0}, (moment,), 0.02, corners, {"t": corners}, (5.0, 0.0)
    )


def never() -> NamoOutcome:
    raise AssertionError("it was kept")


def test_a_run_is_made_once_and_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "runs/01.json"
    assert kept_run(NamoOutcome, path, TOLD, outcome) == outcome()
    assert kept_run(NamoOutcome, path, TOLD, never) == outcome()


def test_a_run_of_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "01.json"
    kept_run(NamoOutcome, path, TOLD, outcome)
    with pytest.raises(BringupError, match=r"expected a run of .*'seed': 4.*remove the folder"):
        kept_run(NamoOutcome, path, {**TOLD, "seed": 4}, never)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"told": {}}', '{"told": {}, "outcome": {"state": 3}}'])
def test_a_damaged_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "01.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BringupError, match="expected a run that was kept"):
        kept_run(NamoOutcome, path, TOLD, never)
