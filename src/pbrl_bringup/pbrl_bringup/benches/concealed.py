"""Is what was concealed found? Recordings from Bullet, the truth sealed, each diagnosed by a process of its own.

The truth of a case stays in the memory of the process that scores it. Its SHA-256 is printed and written down before
any diagnosis starts, and a diagnosis is given the recording alone. Everything that is done is kept in the results'
folder: a bench that was stopped goes on, case by case, in each of its three pieces.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pbrl_bringup.benches.concealed_figures import draw_all
from pbrl_bringup.benches.concealed_rows import rows_of
from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.concealed.pieces import SEAL, diagnose, judge, kept_score, simulate
from pbrl_bringup.concealed.scoring import Score
from pbrl_bringup.concealed.sets import Trial, trials_of
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.terminal import say


def measure(seed: int, quick: bool, out: Path, *, sets: Sequence[str] = (), most: int | None = None) -> Measured:
    """Make, diagnose and score every case of some sets, all cores at work.

    Args:
        seed: which of the scored seeds; no two seeds share a recording.
        quick: a few cases.
        out: folder of results; what it holds of an earlier run of this seed is not done again.
        sets: names; none: all of them, or in a quick run clean and single.
        most: recordings an effect at most, and ten times as many clean ones; None: all.

    Raises:
        BringupError: there is no set of such a name, or the folder's bags were made by other code.
    """
    folders = {trial: out / "cases" / trial.name for trial in trials_of(seed, quick, sets, most)}
    scores = {trial: kept for trial, folder in folders.items() if (kept := kept_score(folder)) is not None}
    left = [trial for trial in folders if trial not in scores]
    truths, unmade = _simulated(left, folders)
    in_parallel(diagnose, [(trial.options, folders[trial]) for trial in truths], "recordings diagnosed")
    judged = in_parallel(judge, [(trial, truth, folders[trial]) for trial, truth in truths.items()], "diagnoses scored")
    scores |= dict(zip(truths, judged, strict=True))
    ordered = [scores[trial] for trial in folders if trial in scores]
    draw_all(ordered, out)
    details = {"not_made": unmade, "bias": bias_of(ordered), "cases": [asdict(each) for each in ordered]}
    return Measured(rows_of(ordered), details)


def _simulated(trials: Sequence[Trial], folders: dict[Trial, Path]) -> tuple[dict[Trial, Truth], list[str]]:
    """Make the bags, tell the seals, and keep the truths in memory; also return which trials cannot be made."""
    made = in_parallel(simulate, [(trial, folders[trial]) for trial in trials], "recordings made")
    truths = {trial: truth for trial, truth in zip(trials, made, strict=True) if isinstance(truth, Truth)}
    for trial in truths:
        say(f"{trial.name}: SHA-256 of the truth {(folders[trial] / SEAL).read_text().strip()}")
    unmade = [why for why in made if isinstance(why, str)]
    for why in unmade:
        say(f"not made: {why}")
    return truths, unmade


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
