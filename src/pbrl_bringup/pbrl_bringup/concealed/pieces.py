"""A trial in three pieces, each of which goes on where it was stopped: simulate, diagnose, score.

The truth stays in memory: a trial whose bag exists is simulated again, and has to have the seal that was told. The
diagnosis and the rivals are another process, which is given the bag and nothing else.
"""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path
from typing import Any

from pbrl_bag import write_recording
from pbrl_bag.types import Recording
from pbrl_bringup.concealed.diagnoser import CLAIMS, REPORT
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.furnished import OF_CASTERS
from pbrl_bringup.concealed.scoring import Comparison, Oracle, Score, failed_score, read_score, score
from pbrl_bringup.concealed.sealed import SealedDiagnoser
from pbrl_bringup.concealed.sets import MadeTrial, Trial, make_trial
from pbrl_bringup.concealed.stage import NAME
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json, write_text
from pbrl_bringup.rivals.samples import regimes_of, take_samples
from pbrl_bringup.terminal import say
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.told_baseline import ToldBaseline, baseline_from_model

SEAL, BAG, PART, BARE, FOUND, SPENT, FAILED, SCORE, UNMADE = (
    "seal.txt",
    "bag",
    "part",
    "bare",
    "found",
    "spent.json",
    "failed.txt",
    "score.json",
    "unmade.txt",
)
"""What is kept of a trial in its folder."""


@cache
def diagnoser() -> SealedDiagnoser:
    """Return this process's partner, which diagnoses for it."""
    return SealedDiagnoser()


def run_trial(trial: Trial, folder: Path, until: float = math.inf) -> Score | str | None:
    """Make, diagnose and score a trial.

    Args:
        trial: what to make.
        folder: of the trial.
        until: wall-clock time [s since the epoch] after which nothing new is begun.

    Returns:
        Its score; or in a line why no seed makes it; or nothing, because it was too late to begin.

    Raises:
        BringupError: the folder's bag was sealed with another truth: it was made by other code.
    """
    if time.time() > until:
        return None
    made = simulate(trial, folder)
    if isinstance(made, str):
        write_text(folder / UNMADE, f"{made}\n")
        return made
    say(f"{trial.name}: SHA-256 of the truth {(folder / SEAL).read_text().strip()}, in {folder.name}")
    models = {} if made.model is None else {"models": [str(made.model)]}
    diagnose({**trial.options, **models}, folder)
    return judge(trial, made, folder)


def simulate(trial: Trial, folder: Path) -> MadeTrial | str:
    """Make a trial's bag and its seal.

    Args:
        trial: what to make.
        folder: of the trial.

    Returns:
        The trial with its truth, for the memory of whoever scores; or in a line why no seed makes it.

    Raises:
        BringupError: the folder's bag was sealed with another truth: it was made by other code.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        made = make_trial(trial, partial(learn, folder=folder))
    except (BringupError, MismatchError) as error:
        # A recording that is refused, as where the gripper lost the table, shows no effect to anybody.
        return f"{trial.name}: {error}"
    seal = made.truth.seal()
    kept = folder / SEAL
    if kept.exists() and kept.read_text().strip() != seal:
        raise BringupError(
            f"{kept}: expected the seal {seal[:12]}..., got {kept.read_text()[:12]}...: other code made the bag; "
            "remove the folder"
        )
    write_whole(made.recording, folder)
    write_text(kept, f"{seal}\n")
    return made


def learn(recording: Recording, seed: int, folder: Path) -> tuple[Path, ToldBaseline]:
    """Have a table diagnosed with nothing concealed, and return its repaired model and the file of that.

    Anybody can see that it stands on casters: nothing else is looked for.

    Args:
        recording: of the table.
        seed: of the case.
        folder: of the trial.

    Raises:
        BringupError: the diagnosis ends with an error.
    """
    place, known = folder / f"{BARE}-{seed}", DiagnoseOptions()
    place.mkdir(exist_ok=True)
    write_whole(recording, place)
    diagnose({"without": [name for name in DRAWS if name not in OF_CASTERS]}, place, rivals=False)
    if (place / FAILED).exists():
        raise BringupError(f"{place}: expected a model of the table, got {(place / FAILED).read_text().strip()}")
    path = place / FOUND / f"model_{NAME}.json"
    told = baseline_from_model(path, inertia_spread=known.inertia_spread, delay_spread=known.delay_spread)
    return path, told


def write_whole(recording: Recording, folder: Path) -> None:
    """Write a recording's bag into a folder, whole or not at all, unless it is there."""
    if (folder / BAG).exists():
        return
    part = folder / PART
    shutil.rmtree(part, ignore_errors=True)
    write_recording(recording, part / BAG)  # a bag's files have its folder's name
    (part / BAG).replace(folder / BAG)
    part.rmdir()


def diagnose(options: Mapping[str, Any], folder: Path, *, rivals: bool = True) -> None:
    """Have a folder's bag diagnosed by a process that is given the bag alone, unless that was done.

    A diagnosis that ends with an error leaves its last line in the folder.

    Args:
        options: settings of the diagnosis, by name.
        folder: with the bag.
        rivals: whether the rivals are asked as well.
    """
    if (folder / FOUND / REPORT).exists() or (folder / FAILED).exists():
        return
    spent, why = diagnoser().ask(folder / BAG, folder / FOUND, options, rivals=rivals)
    write_json(folder / SPENT, {"seconds": spent})
    if why:
        write_text(folder / FAILED, f"{why}\n")


def judge(trial: Trial, made: MadeTrial, folder: Path) -> Score:
    """Score what a trial's diagnosis and rivals said, and keep the score.

    Args:
        trial: the trial.
        made: with the truth, and what a told oracle reaches.
        folder: of the trial.
    """
    seal, truth = (folder / SEAL).read_text().strip(), made.truth
    if (folder / FAILED).exists():
        why = (folder / FAILED).read_text().strip()
        result = failed_score(trial.name, truth, seal, why, trial.set, trial.withheld)
    else:
        track = track_of(made.recording, truth.body)
        samples = take_samples(track)
        report: dict[str, Any] = json.loads((folder / FOUND / REPORT).read_text())
        result = score(
            trial.name,
            truth,
            report,
            seal,
            _seconds(folder),
            comparison=Comparison(samples, regimes_of(samples), track.outline),
            oracle=_reached(made),
            claims=json.loads((folder / FOUND / CLAIMS).read_text()),
            group=trial.set,
            withheld=trial.withheld,
        )
    write_json(folder / SCORE, asdict(result))
    return result


def _seconds(folder: Path) -> float:
    if not (folder / SPENT).exists():
        return math.nan  # stopped between a diagnosis and this
    told = json.loads((folder / SPENT).read_text())["seconds"]
    return math.nan if told is None else float(told)


def kept_score(folder: Path) -> Score | None:
    """Return the score that a folder keeps, if any."""
    path = folder / SCORE
    return read_score(json.loads(path.read_text())) if path.exists() else None


def kept_reason(folder: Path) -> str | None:
    """Return why a folder's trial cannot be made, if it cannot."""
    path = folder / UNMADE
    return path.read_text().strip() if path.exists() else None


def _reached(made: MadeTrial) -> Oracle | None:
    """Return what a told oracle reaches, if one was asked."""
    if made.oracle is None:
        return None
    reached, told = made.oracle.fitted.score, made.oracle
    error = math.nan if reached is None else reached.rmse_position
    return Oracle(error, told.gain, told.times_detectable)
