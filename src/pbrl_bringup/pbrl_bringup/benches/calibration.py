"""Simulation-based calibration of the fit (Talts et al. 2018), for every model class; `figure.png` has the histograms.

Whatever the fit takes as unknown is drawn from its own prior, data are drawn from the model, and the truth is ranked
among the posterior's draws. See `pbrl_model.fitting.calibration` and `pbrl_model.inference.sbc`.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binom

from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.parallel import in_parallel
from pbrl_model.fitting.calibration import RANKED, Trial, run_trial
from pbrl_model.inference.sbc import Ranks, Uniformity, judge

CLASSES = ("free", "wheel", "wheel+ground", "hinge")
TRIALS, QUICK_TRIALS = 200, 24
QUICK_CLASSES = ("free", "wheel")
LEAST_P = 0.01
SHADE = "#d5dbe3"


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run the trials of every class in parallel processes and judge their ranks."""
    classes = QUICK_CLASSES if quick else CLASSES
    count = QUICK_TRIALS if quick else TRIALS
    seeds = np.random.SeedSequence(seed).generate_state(count * len(classes)).reshape(len(classes), count)
    jobs = [(name, int(number)) for name, row in zip(classes, seeds, strict=True) for number in row]
    trials = in_parallel(run_trial, jobs, "trials")
    grouped = {name: trials[k * count : (k + 1) * count] for k, name in enumerate(classes)}
    ranks = {name: ranks_of(found) for name, found in grouped.items()}
    judged = {name: judge(found, np.random.default_rng(seed)) for name, found in ranks.items()}
    figure(ranks, judged).savefig(out / "figure.png", dpi=110)
    details = {
        name: {
            "ranks": ranks[name].rank.tolist(),
            "names": ranks[name].names,
            "judged": {parameter: asdict(found) for parameter, found in judged[name].items()},
            "converged": sum(trial.converged for trial in grouped[name]),
        }
        for name in classes
    }
    return Measured([_row(name, judged[name], grouped[name]) for name in classes], details)


def ranks_of(trials: list[Trial]) -> Ranks:
    """Return the ranks of the trials of one class."""
    return Ranks(trials[0].names, np.stack([trial.rank for trial in trials]), RANKED)


def _row(name: str, judged: dict[str, Uniformity], trials: list[Trial]) -> Row:
    worst = min(judged, key=lambda parameter: judged[parameter].p)
    return at_least(
        f"calibration of class {name}: least p of uniform ranks over {len(judged)} parameters",
        judged[worst].p,
        "1",
        LEAST_P,
        parameter=worst,
        trials=len(trials),
        converged=sum(trial.converged for trial in trials),
        widest_spread=max(found.spread for found in judged.values()),
        narrowest_spread=min(found.spread for found in judged.values()),
    )


def figure(ranks: dict[str, Ranks], judged: dict[str, dict[str, Uniformity]]) -> Figure:
    """Return rank histograms: a row for each class, a column for each parameter, 99 % of uniform ones shaded."""
    most = max(len(found.names) for found in ranks.values())
    page = Figure(figsize=(1.75 * most, 2.0 * len(ranks) + 0.7), layout="constrained")
    page.suptitle(
        f"Rank of the truth among {RANKED} posterior draws: uniform if calibrated (shaded: 99 % of uniform histograms' "
        "bars)",
        fontsize=10,
    )
    axes = page.subplots(len(ranks), most, squeeze=False)
    for row, (name, found) in zip(axes, ranks.items(), strict=True):
        for k, cell in enumerate(row):
            if k < len(found.names):
                histogram(cell, found, k, judged[name][found.names[k]])
            else:
                cell.axis("off")
        row[0].set_ylabel(f"{name}\n{found.trials} trials\ntrials in bin")
    return page


def histogram(axes: Axes, ranks: Ranks, column: int, judged: Uniformity) -> Axes:
    """Draw one parameter's rank histogram."""
    low, high = binom.interval(0.99, ranks.trials, 1.0 / ranks.bins)
    edges = np.linspace(0, ranks.draws + 1, ranks.bins + 1)
    axes.axhspan(low, high, color=SHADE, zorder=0)
    axes.stairs(ranks.histogram()[column], edges, fill=True, color="#2a6f97")
    axes.set_title(f"{ranks.names[column]}\np = {judged.p:.2g}", fontsize=8)
    axes.set_xlim(0, ranks.draws + 1)
    axes.set_xlabel("rank", fontsize=7)
    axes.tick_params(labelsize=7)
    return axes
