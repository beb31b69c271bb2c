"""Where is the wheel? Fifty random tables, a push of 20 s each, tags of 3 mm at 15 Hz, wide priors.

Each recording goes the way of `./pbrl fit`. The region is the ellipse of the posterior's own covariance that holds 95 %
of its draws of the wheel's place; `figure.png` shows every table with its true wheel and the draws.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bringup.benches.pose_tables import Table, random_table, record
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most, within
from pbrl_bringup.parallel import in_parallel
from pbrl_model.fitting.fit import FitOptions, ObjectFit, fit_recording
from pbrl_model.symmetry import circular_mean, wrap

Array = NDArray[np.float64]

TABLES, QUICK_TABLES = 50, 4
SHOWN = 200
"""Draws of each table in the figure."""
LEVEL, SLACK = 0.945, 0.045
MEDIAN = 0.03
"""[m]."""
SURE = 0.15
"""A wheel whose turn has less spread than this is reported as rolling in that direction [rad]."""


@dataclass(frozen=True)
class Trial:
    """One table.

    Attributes:
        seed: of the table, its sensors and its fit.
        locked: whether the wheel holds in both directions.
        error: from the posterior's mean to the true place of the wheel [m].
        spread: root mean square distance of the draws from their mean [m].
        level: share of the posterior's draws nearer to its mean than the truth, in its own covariance.
        turn_error: of the reported turn, mod 180 degrees, of a wheel that rolls [rad]; NaN where it holds alike.
        turn_sd: circular standard deviation of the turn [rad].
        mass_level: share of the draws of the mass below the true one.
        delay_error: mean delay minus the true one [s].
        delay_sd: [s].
        converged: whether the evidence did.
        seconds: of the fit.
        footprint: (4, 2) [m].
        truth: (2,) of the wheel [m].
        draws: (n, 2) of the wheel [m].
    """

    seed: int
    locked: bool
    error: float
    spread: float
    level: float
    turn_error: float
    turn_sd: float
    mass_level: float
    delay_error: float
    delay_sd: float
    converged: bool
    seconds: float
    footprint: Array
    truth: Array
    draws: Array


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Push and fit random tables in parallel processes."""
    count = QUICK_TABLES if quick else TABLES
    numbers = np.random.SeedSequence(seed).generate_state(count)
    trials = in_parallel(run_trial, [(int(number),) for number in numbers], "tables")
    figure(trials).savefig(out / "figure.png", dpi=110)
    told = [
        {name: value for name, value in asdict(trial).items() if name not in ("footprint", "truth", "draws")}
        for trial in trials
    ]
    return Measured(rows_of(trials), {"trials": told})


def run_trial(seed: int) -> Trial:
    """Draw a table, push it, fit the recording, and compare."""
    rng = np.random.default_rng(seed)
    table = random_table(rng)
    fit = fit_recording(record(rng, table), FitOptions(seed=seed % 2**31, holdout_share=0.0))
    return score(seed, table, fit.objects["table"], fit.seconds)


def score(seed: int, table: Table, found: ObjectFit, seconds: float) -> Trial:
    """Compare a posterior with the truth."""
    wheels = found.posterior.canonical()
    draws = np.stack([wheels.column(name).ravel() for name in ("wheel_x", "wheel_y")], -1)
    truth = np.array([table.truth.wheel_x, table.truth.wheel_y])
    centre, inverse = draws.mean(axis=0), np.linalg.inv(np.cov(draws.T))
    distance = np.einsum("ni,ij,nj->n", draws - centre, inverse, draws - centre)
    own = float((truth - centre) @ inverse @ (truth - centre))
    turn = circular_mean(wheels.column("wheel_theta"), np.pi)
    summary = found.posterior.summary()
    return Trial(
        seed=seed,
        locked=table.locked,
        error=float(np.hypot(*(centre - truth))),
        spread=float(np.sqrt(np.sum(draws.var(axis=0)))),
        level=float(np.mean(distance < own)),
        turn_error=np.nan if table.locked else abs(float(wrap(np.array(turn - table.truth.wheel_theta), np.pi))),
        turn_sd=float(summary["wheel_theta"]["sd"]),
        mass_level=float(np.mean(wheels.column("mass") < table.truth.mass)),
        delay_error=float(found.delay.mean()) - table.delay,
        delay_sd=float(found.delay.std()),
        converged=bool(np.isfinite(found.posterior.log_evidence)),
        seconds=seconds,
        footprint=table.footprint,
        truth=truth,
        draws=draws[:: max(1, len(draws) // SHOWN)],
    )


def rows_of(trials: list[Trial]) -> list[Row]:
    """Return the acceptance rows."""
    inside = float(np.mean([trial.level <= 0.95 for trial in trials]))
    errors = {kind: [t.error for t in trials if t.locked is kind] for kind in (True, False)}
    rolling = [trial for trial in trials if not trial.locked and trial.turn_sd < SURE]
    right = [trial.turn_error < max(3.0 * trial.turn_sd, 0.05) for trial in rolling]
    mass = [0.05 < trial.mass_level < 0.95 for trial in trials]
    return [
        within(
            f"wheel's true place inside the posterior's 95 % ellipse, share of {len(trials)} tables",
            inside,
            "1",
            LEVEL,
            SLACK,
            mass_in_its_90_percent_interval=float(np.mean(mass)),
            evidences_converged=sum(trial.converged for trial in trials),
        ),
        at_most(
            "wheel's place, median error of the posterior mean",
            float(np.median([trial.error for trial in trials])),
            "m",
            MEDIAN,
            locked_m=_median(errors[True]),
            rolling_m=_median(errors[False]),
            median_spread_m=float(np.median([trial.spread for trial in trials])),
        ),
        at_least(
            "rolling wheels of known turn reported as one pose, at the true turn within 3 sd, share",
            float(np.mean(right)) if right else np.nan,
            "1",
            0.9,
            wheels=len(right),
            median_turn_error_rad=_median([trial.turn_error for trial in rolling]),
        ),
    ]


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def figure(trials: list[Trial]) -> Figure:
    """Return every table from above with its true wheel and the posterior's."""
    columns = min(10, len(trials))
    rows = -(-len(trials) // columns)
    page = Figure(figsize=(1.5 * columns + 0.5, 1.25 * rows + 0.8), layout="constrained")
    page.suptitle(
        "Wheels of random tables after one 20 s push: truth (+), posterior draws (blue: in the 95 % ellipse, red: not)",
        fontsize=9,
    )
    axes = page.subplots(rows, columns, squeeze=False).ravel()
    for cell in axes[len(trials) :]:
        cell.axis("off")
    for cell, trial in zip(axes, trials, strict=False):
        draw_table(cell, trial)
    return page


def draw_table(axes: Axes, trial: Trial) -> Axes:
    """Draw one table [m]."""
    corners = np.vstack([trial.footprint, trial.footprint[:1]])
    axes.plot(*corners.T, color="0.4", lw=0.8)
    color = "#2a6f97" if trial.level <= 0.95 else "#c0392b"
    axes.plot(*trial.draws.T, ".", ms=1.0, color=color, alpha=0.5)
    axes.plot(*trial.truth, "+", ms=8, mew=1.2, color="black")
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    kind = "locked" if trial.locked else "rolls"
    axes.set_title(f"{kind}, {100 * trial.error:.1f} cm", fontsize=7)
    return axes
