"""Is what was concealed found? Recordings from Bullet, the truth sealed, each diagnosed by a process of its own.

The truth of a case stays in the memory of the process that scores it. Its SHA-256 is written down before the diagnosis
starts, and the diagnosis is given the recording alone. Cases that are done are kept in the results' folder: a bench
that was stopped goes on.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import beta, kstest

from pbrl_bag import write_recording
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.concealed.cases import Case, make
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.scoring import Score, score
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_json
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.terminal import say

CLEAN, SEEDS = 100, 10
QUICK_CLEAN, QUICK_EFFECTS = 2, ("ground_friction", "tether", "payload_change", "wrench_bias")
FIRST_SEED = 10_000
"""Scored seeds begin here; those below are for development."""
PATIENCE = 900.0
"""For one diagnosis [s]."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Make, diagnose and score every case, in parallel."""
    cases = cases_of(seed, quick)
    (out / "cases").mkdir(parents=True, exist_ok=True)
    scores = in_parallel(run_case, [(case, out / "cases" / case.name) for case in cases], "recordings")
    confusion(scores).savefig(out / "figure.png", dpi=110)
    return Measured(rows_of(scores), {"cases": [asdict(each) for each in scores]})


def cases_of(seed: int, quick: bool) -> list[Case]:
    """Return the cases of a run: clean ones, then every effect."""
    first = FIRST_SEED * (1 + seed)
    clean = [Case((), first + number) for number in range(QUICK_CLEAN if quick else CLEAN)]
    names = QUICK_EFFECTS if quick else tuple(DRAWS)
    return clean + [Case((name,), first + number) for name in names for number in range(1 if quick else SEEDS)]


def run_case(case: Case, folder: Path) -> Score:
    """Make one case, seal its truth, have its recording diagnosed by another process, and score what that says.

    Raises:
        BringupError: the case cannot be made, or the diagnosis fails.
    """
    done = folder / "score.json"
    if done.exists():
        return _read(done)
    recording, truth = make(case)
    seal = truth.seal()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "seal.txt").write_text(f"{seal}\n")
    say(f"{case.name}: SHA-256 of the truth {seal}")
    bag = folder / "bag"
    if not bag.exists():
        write_recording(recording, bag)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "pbrl_bringup", "diagnose", str(bag), "--out", str(folder / "found")]
    ended = subprocess.run(
        [*command, "--workers", "1"], capture_output=True, text=True, timeout=PATIENCE, env=os.environ, check=False
    )
    if ended.returncode:
        raise BringupError(f"{case.name}: expected a diagnosis, got {ended.stderr.strip().splitlines()[-1:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    report = json.loads((folder / "found" / "report.json").read_text())
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    result = score(case.name, truth, report, seal, spent)
    write_json(done, {name: None if value != value else value for name, value in asdict(result).items()})
    return result


def _read(path: Path) -> Score:
    told: dict[str, Any] = json.loads(path.read_text())
    for name, value in told.items():
        told[name] = tuple(value) if isinstance(value, list) else float("nan") if value is None else value
    return Score(**told)


def rows_of(scores: Sequence[Score]) -> list[Row]:
    """Return the acceptance rows, shares with exact 95 % intervals."""
    clean, hidden = [s for s in scores if not s.effects], [s for s in scores if s.effects]
    alarms = sum(s.mismatch for s in clean)
    gains = [s.before / s.after for s in hidden if s.first and s.after > 0.0]
    uniform = float(kstest([s.p_value for s in clean], "uniform").pvalue) if len(clean) > 1 else float("nan")
    strong = [s for s in hidden if s.strength > 0.5]
    return [
        at_most(
            f"false alarms on {len(clean)} clean recordings at the 5 % level, share",
            alarms / max(len(clean), 1),
            "1",
            0.05,
            interval=interval(alarms, len(clean)),
            p_of_uniform_p_values=uniform,
        ),
        _share("effect named first", [s.first for s in hidden], 0.90, alarm_share=_mean([s.mismatch for s in hidden])),
        _share("effect among the first two", [s.in_two for s in hidden], 0.97),
        _share("effect named first, the stronger half", [s.first for s in strong], 0.97),
        at_least(
            "held-out position error before over after, median of the cases named right",
            float(np.median(gains)) if gains else 0.0,
            "1",
            5.0,
            cases=len(gains),
        ),
        at_most("CPU time of a diagnosis, median", float(np.median([s.seconds for s in scores])), "s", 60.0),
    ]


def _mean(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _share(what: str, told: Sequence[bool], goal: float, **against: Any) -> Row:
    return at_least(
        f"{what}, share of {len(told)} recordings",
        _mean(told) if told else 0.0,
        "1",
        goal,
        interval=interval(sum(told), len(told)),
        **against,
    )


def interval(hits: int, count: int, level: float = 0.95) -> str:
    """Return the exact (Clopper-Pearson) interval of a share."""
    if count == 0:
        return "0 to 1"
    tail = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(1.0 - tail, hits + 1, count - hits))
    return f"{low:.3f} to {high:.3f}"


def confusion(scores: Sequence[Score]) -> Figure:
    """Draw what was concealed against what was named first."""
    rows = list(dict.fromkeys("+".join(s.effects) or "nothing" for s in scores))
    columns = [*dict.fromkeys([*DRAWS, *(name for s in scores for name in s.named[:1])]), "unknown", "nothing"]
    counts = np.zeros((len(rows), len(columns)))
    for each in scores:
        said = "nothing" if not each.mismatch else each.named[0] if each.named else "unknown"
        counts[rows.index("+".join(each.effects) or "nothing"), columns.index(said)] += 1
    shares = counts / counts.sum(axis=1, keepdims=True)
    page = Figure(figsize=(2.6 + 0.36 * len(columns), 2.4 + 0.3 * len(rows)), layout="constrained")
    axes = page.subplots()
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), count in np.ndenumerate(counts):
        if count:
            colour = "white" if shares[row, column] > 0.5 else "black"
            axes.text(column, row, f"{count:.0f}", ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.set_xlabel("named first")
    axes.set_ylabel("concealed")
    axes.set_title("What was concealed, and what the diagnosis named (recordings)", fontsize=10)
    return page
