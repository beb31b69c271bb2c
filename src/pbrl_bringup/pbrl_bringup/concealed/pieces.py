"""A trial in three pieces, each of which goes on where it was stopped: simulate, diagnose, score.

The truth stays in memory: a trial whose bag exists is simulated again, and has to have the seal that was told. The
diagnosis and the rivals are processes of their own, which are given the bag and nothing else.
"""

from __future__ import annotations

import json
import math
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pbrl_bag import read_recording, write_recording
from pbrl_bringup.concealed.oracle import oracle
from pbrl_bringup.concealed.scoring import Comparison, Oracle, Score, failed_score, read_score, score
from pbrl_bringup.concealed.sets import MASS_OFF, Trial, make_trial
from pbrl_bringup.concealed.stage import NAME
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json, write_text
from pbrl_bringup.rivals.samples import regimes_of, take_samples
from pbrl_bringup.terminal import say
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_model.errors import ModelError

PATIENCE = 1800.0
"""For one diagnosis [s]."""
SEAL, BAG, BARE, FOUND, SPENT, FAILED, CLAIMS, SCORE = (
    "seal.txt",
    "bag",
    "bare",
    "found",
    "spent.json",
    "failed.txt",
    "rivals.json",
    "score.json",
)
"""What is kept of a trial in its folder."""


def simulate(trial: Trial, folder: Path) -> Truth | str:
    """Make a trial's bag and its seal.

    Args:
        trial: what to make.
        folder: of the trial.

    Returns:
        The truth, for the memory of whoever scores; or in a line why no seed makes this trial.

    Raises:
        BringupError: the folder's bag was sealed with another truth: it was made by other code.
    """
    try:
        made = make_trial(trial)
    except BringupError as error:
        return str(error)
    seal = made.truth.seal()
    kept = folder / SEAL
    if kept.exists() and kept.read_text().strip() != seal:
        raise BringupError(
            f"{kept}: expected the seal {seal[:12]}..., got {kept.read_text()[:12]}...: other code made the bag; "
            "remove the folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for recording, place in ((made.recording, folder), (made.bare, folder / BARE)):
        if recording is not None and not (place / BAG).exists():
            place.mkdir(exist_ok=True)
            write_recording(recording, place / BAG)
    write_text(kept, f"{seal}\n")
    return made.truth


def diagnose(options: Sequence[str], folder: Path) -> None:
    """Have a bag diagnosed, and looked at by the rivals, each in a process that is given the bag alone.

    Where there is a recording of the bare table, that is diagnosed first, and its repaired model is the baseline. A
    diagnosis that ends with an error leaves its last line in the folder.

    Args:
        options: of the command `diagnose`.
        folder: of the trial.
    """
    if (folder / BARE).exists():
        _diagnose(options, folder / BARE)
        options = [*options, "--baseline", str(repaired_model(folder))]
    _diagnose(options, folder)
    if not (folder / CLAIMS).exists():
        spread = [options[options.index("--mass-spread") + 1]] if "--mass-spread" in options else []
        _, why = _run(["-m", "pbrl_bringup.rivals.run", str(folder / BAG), str(folder / CLAIMS), *spread])
        if why:
            say(f"{folder.name}: the rivals end with {why}")
            write_json(folder / CLAIMS, [])


def repaired_model(folder: Path) -> Path:
    """Return the file of a bare table's model, as its diagnosis writes it."""
    return folder / BARE / FOUND / f"model_{NAME}.json"


def _diagnose(options: Sequence[str], folder: Path) -> None:
    """Diagnose a folder's bag, unless that was done."""
    if (folder / FOUND / "report.json").exists() or (folder / FAILED).exists():
        return
    command = ["-m", "pbrl_bringup", "diagnose", str(folder / BAG), "--out", str(folder / FOUND), "--workers", "1"]
    spent, why = _run([*command, *options])
    write_json(folder / SPENT, {"seconds": spent})
    if why:
        write_text(folder / FAILED, f"{why}\n")


def _run(arguments: Sequence[str]) -> tuple[float, str]:
    """Run Python on something; return CPU seconds, and the last line of what went wrong or nothing."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        ended = subprocess.run(
            [sys.executable, *arguments], capture_output=True, text=True, timeout=PATIENCE, env=os.environ, check=False
        )
        why = (ended.stderr.strip().splitlines() or ["no word"])[-1] if ended.returncode else ""
    except subprocess.TimeoutExpired:
        why = f"no answer in {PATIENCE:.0f} s"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, why


def judge(trial: Trial, truth: Truth, folder: Path, *, ask_oracle: bool = True) -> Score:
    """Score what a trial's diagnosis and rivals said, and keep the score.

    Args:
        trial: the trial.
        truth: what was concealed.
        folder: of the trial.
        ask_oracle: whether to fit what a told oracle reaches.
    """
    seal = (folder / SEAL).read_text().strip()
    if (folder / FAILED).exists():
        why = (folder / FAILED).read_text().strip()
        result = failed_score(trial.name, truth, seal, why, trial.set, trial.withheld)
    else:
        recording = read_recording(folder / BAG)
        track = track_of(recording, truth.body)
        samples = take_samples(track)
        report: dict[str, Any] = json.loads((folder / FOUND / "report.json").read_text())
        result = score(
            trial.name,
            truth,
            report,
            seal,
            float(json.loads((folder / SPENT).read_text())["seconds"]),
            comparison=Comparison(samples, regimes_of(samples), track.outline),
            oracle=_oracle(trial, truth, folder) if ask_oracle and truth.effects else None,
            claims=json.loads((folder / CLAIMS).read_text()),
            group=trial.set,
            withheld=trial.withheld,
        )
    write_json(folder / SCORE, asdict(result))
    return result


def kept_score(folder: Path) -> Score | None:
    """Return the score that a folder keeps, if any."""
    path = folder / SCORE
    return read_score(json.loads(path.read_text())) if path.exists() else None


def _oracle(trial: Trial, truth: Truth, folder: Path) -> Oracle:
    """Return what a told oracle reaches; nothing where the effect is not one that it can fit, and says so."""
    told_of: dict[str, Any] = {"mass_spread": MASS_OFF} if trial.set == "rough" else {}
    if (folder / BARE).exists():
        told_of["baseline"] = (str(repaired_model(folder)),)
    try:
        told = oracle(read_recording(folder / BAG), truth, DiagnoseOptions(**told_of))
    except (MismatchError, ModelError) as error:
        say(f"{trial.name}: no oracle: {error}")
        return Oracle()
    reached = told.fitted.score
    return Oracle(math.nan if reached is None else reached.rmse_position, told.gain)
