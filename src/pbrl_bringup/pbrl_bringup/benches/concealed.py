"""Is what was concealed found? Recordings from Bullet, the truth sealed, each diagnosed by a process that has it not.

The truth of a case stays in the memory of the process that scores it. Its SHA-256 is printed and written down before
the diagnosis starts, and the diagnosis is given the recording alone, in a folder whose name says nothing. Everything
that is done is kept in the results' folder: a bench that was stopped goes on case by case.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pbrl_bringup.benches.carried import Carried
from pbrl_bringup.benches.concealed_figures import draw_all
from pbrl_bringup.benches.concealed_rows import rows_of
from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.concealed.pieces import kept_reason, kept_score, run_trial
from pbrl_bringup.concealed.scoring import Score
from pbrl_bringup.concealed.sets import Trial, evenly, trials_of
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.terminal import say

CARRIED = Carried(
    ("cases/*/score.json", "cases/*/unmade.txt"),
    ("bullet_sim", "pbrl_bag", "pbrl_bringup.concealed", "pbrl_bringup.rivals", "pbrl_mismatch", "pbrl_model"),
)


def measure(
    seed: int,
    quick: bool,
    out: Path,
    *,
    sets: Sequence[str] = (),
    most: int | None = None,
    minutes: float | None = None,
) -> Measured:
    """Make, diagnose and score every case of some sets, all cores at work.

    Args:
        seed: which of the scored seeds; no two seeds share a recording.
        quick: a few cases.
        out: folder of results; what it holds of an earlier run of this seed is not done again.
        sets: names; none: all of them, or in a quick run clean and single.
        most: recordings an effect at most, and ten times as many clean ones; None: all.
        minutes: after which no case is begun, and what there is is reported; None: all are done.

    Raises:
        BringupError: there is no set of such a name, or the folder's bags were made by other code.
    """
    folders = {trial: out / "cases" / trial.folder for trial in trials_of(seed, quick, sets, most)}
    scores = {trial: kept for trial, folder in folders.items() if (kept := kept_score(folder)) is not None}
    unmade = {trial: why for trial, folder in folders.items() if (why := kept_reason(folder)) is not None}
    left = [trial for trial in evenly(list(folders)) if trial not in scores and trial not in unmade]
    until = float("inf") if minutes is None else time.time() + 60.0 * minutes
    found = in_parallel(run_trial, [(trial, folders[trial], until) for trial in left], "recordings diagnosed")
    scores |= {trial: each for trial, each in zip(left, found, strict=True) if isinstance(each, Score)}
    unmade |= {trial: each for trial, each in zip(left, found, strict=True) if isinstance(each, str)}
    for why in unmade.values():
        say(f"not made: {why}")
    waiting = len(folders) - len(scores) - len(unmade)
    if waiting:
        say(f"{waiting} of {len(folders)} recordings were not begun; the same command goes on")
    return _measured(folders, scores, list(unmade.values()), waiting, out)


def _measured(
    folders: dict[Trial, Path], scores: dict[Trial, Score], unmade: list[str], waiting: int, out: Path
) -> Measured:
    """Draw the figures and put the report together, cases in their own order."""
    done = [trial for trial in folders if trial in scores]
    ordered = [scores[trial] for trial in done]
    draw_all(ordered, out)
    cases = [{**asdict(scores[trial]), "folder": trial.folder} for trial in done]
    details = {"not_made": unmade, "not_begun": waiting, "bias": bias_of(ordered), "cases": cases}
    return Measured(rows_of(ordered), details)


def bias_of(scores: Sequence[Score]) -> dict[str, dict[str, Any]]:
    """Return medians of how far parameters of effects that were named right are off, and how often by under two sd."""
    found: dict[str, list[tuple[float, float]]] = {}
    for each in scores:
        for name, off in each.bias.items():
            found.setdefault(name, []).append(off)
    return {
        name: {
            "relative": statistics.median(abs(relative) for relative, _ in values),
            "sds": statistics.median(abs(sds) for _, sds in values),
            "within_two_sd": statistics.fmean(abs(sds) < 2.0 for _, sds in values),
            "recordings": len(values),
        }
        for name, values in sorted(found.items())
    }
