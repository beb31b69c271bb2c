"""A bench that goes on: what was scored is kept, what cannot be made is not tried again, what is left is told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.benches import concealed
from pbrl_bringup.concealed import pieces
from pbrl_bringup.concealed.pieces import SCORE, UNMADE
from pbrl_bringup.concealed.scoring import Score, failed_score
from pbrl_bringup.concealed.sets import Trial
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.files import write_json, write_text


def fake(trial: Trial, folder: Path, until: float) -> Score | str | None:
    """Score a trial from its name alone; leave in the folder what a real one leaves."""
    folder.mkdir(parents=True)
    if trial.case.effects == ("detent",):
        write_text(folder / UNMADE, "detent: no seed makes it\n")
        return "detent: no seed makes it"
    share = float(np.random.default_rng(int(trial.folder, 16)).random())
    truth = Truth(trial.case.effects, "table", {}, {}, {}, share, dict.fromkeys(trial.case.effects, 1.0))
    found = failed_score(trial.name, truth, truth.seal(), "", trial.set, ())
    write_json(folder / SCORE, asdict(found))
    return found


class Run:
    """Stands for all cores: does so many of the trials, then stops or is killed."""

    def __init__(self, most: int, *, killed: bool) -> None:
        self.most, self.killed, self.done = most, killed, 0

    def __call__(
        self, trial: Callable[..., Score | str | None], arguments: Sequence[tuple[Any, ...]], what: str
    ) -> list[Score | str | None]:
        found: list[Score | str | None] = []
        for each in arguments:
            if self.done == self.most and self.killed:
                raise KeyboardInterrupt
            late = self.done == self.most
            found.append(None if late else trial(*each))
            self.done += 0 if late else 1
        return found


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path, Run], concealed.Measured]:
    monkeypatch.setattr(concealed, "run_trial", fake)

    def run(out: Path, cores: Run) -> concealed.Measured:
        monkeypatch.setattr(concealed, "in_parallel", cores)
        return concealed.measure(3, False, out, sets=["single", "clean"], most=1)

    return run


def test_a_killed_run_goes_on_to_the_same_report(
    measured: Callable[[Path, Run], concealed.Measured], tmp_path: Path
) -> None:
    whole = measured(tmp_path / "whole", Run(1000, killed=False))
    with pytest.raises(KeyboardInterrupt):
        measured(tmp_path / "parts", Run(9, killed=True))
    rest = Run(1000, killed=False)
    again = measured(tmp_path / "parts", rest)
    assert 0 < rest.done == len(whole.details["cases"]) + len(whole.details["not_made"]) - 9
    assert str(again) == str(whole) and whole.details["not_begun"] == 0
    assert whole.details["not_made"] == ["detent: no seed makes it"]
    assert measured(tmp_path / "parts", Run(0, killed=True)).details["not_begun"] == 0


def test_what_was_not_begun_in_time_is_counted(
    measured: Callable[[Path, Run], concealed.Measured], tmp_path: Path
) -> None:
    part = measured(tmp_path / "part", Run(12, killed=False))
    done = len(part.details["cases"]) + len(part.details["not_made"])
    assert done == 12 and part.details["not_begun"] > 0
    assert {each["set"] for each in part.details["cases"]} == {"clean", "single"}


def test_a_bag_that_was_being_written_when_all_ended_is_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = [True, False]

    def written(recording: object, path: Path) -> None:
        path.mkdir(parents=True)
        write_text(path / "bag_0.mcap", "half")
        if killed.pop(0):
            raise KeyboardInterrupt
        write_text(path / "bag_0.mcap", "whole")

    monkeypatch.setattr(pieces, "write_recording", written)
    nothing: Any = None
    with pytest.raises(KeyboardInterrupt):
        pieces.write_whole(nothing, tmp_path)
    assert not (tmp_path / pieces.BAG).exists()
    for _ in range(2):  # what is there is left
        pieces.write_whole(nothing, tmp_path)
    assert (tmp_path / pieces.BAG / "bag_0.mcap").read_text() == "whole"
    assert [each.name for each in tmp_path.iterdir()] == [pieces.BAG]
