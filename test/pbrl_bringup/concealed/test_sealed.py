"""The seal: a diagnosing process cannot know a truth, answers for what it cannot read, and is replaced when it dies."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pbrl_bringup.concealed import diagnoser, pieces
from pbrl_bringup.concealed.cases import Case
from pbrl_bringup.concealed.sealed import SealedDiagnoser
from pbrl_bringup.concealed.sets import Trial
from pbrl_bringup.errors import BringupError


@pytest.fixture(scope="module")
def sealed() -> Iterator[SealedDiagnoser]:
    with SealedDiagnoser(patience=120.0) as made:
        yield made


def test_a_fresh_diagnoser_has_loaded_nothing_that_could_know() -> None:
    script = f"import {diagnoser.__name__} as d; print(d.loaded_secrets())"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_a_process_that_could_know_refuses(tmp_path: Path) -> None:
    job = {"bag": str(tmp_path), "out": str(tmp_path / "found"), "options": {}, "rivals": False}
    assert "pbrl_bringup.concealed.cases" in diagnoser.loaded_secrets()
    with pytest.raises(BringupError, match="expected a process that cannot know the truth, got bullet_sim"):
        diagnoser.work(job)


def test_what_cannot_be_read_is_told_in_a_line_and_the_next_one_is_heard(
    sealed: SealedDiagnoser, tmp_path: Path
) -> None:
    for number in range(2):
        spent, why = sealed.ask(tmp_path / f"none{number}", tmp_path / "found", {}, rivals=True)
        assert f"none{number}" in why and "\n" not in why and spent >= 0.0
    _, why = sealed.ask(tmp_path, tmp_path / "found", {"without": ["tehter"]}, rivals=True)
    assert "tether" in why
    assert not (tmp_path / "found").exists()


def test_one_that_dies_is_told_and_another_takes_its_place(sealed: SealedDiagnoser, tmp_path: Path) -> None:
    sealed.ask(tmp_path / "none", tmp_path / "found", {}, rivals=True)
    assert sealed._process is not None
    sealed._process.kill()
    sealed._process.wait()
    spent, why = sealed.ask(tmp_path / "none", tmp_path / "found", {}, rivals=True)
    assert math.isnan(spent) and "ended with exit code -9" in why
    assert "none" in sealed.ask(tmp_path / "none", tmp_path / "found", {}, rivals=True)[1]


def test_one_that_says_nothing_in_time_is_given_up(tmp_path: Path) -> None:
    with SealedDiagnoser(patience=0.001) as hasty:
        spent, why = hasty.ask(tmp_path / "none", tmp_path / "found", {}, rivals=False)
    assert math.isnan(spent) and why == "no answer in 0 s"


def test_nothing_is_begun_after_its_time(tmp_path: Path) -> None:
    assert pieces.run_trial(Trial("single", Case(("tether",), 1)), tmp_path / "x", until=0.0) is None
    assert not (tmp_path / "x").exists()
