"""Runs of the thesis's NAMO experiments (6.5.1, 6.5.2) in Bullet, and their rows."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bullet_sim.catalogue import OfficeTable
from bullet_sim.scene import Scene
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.kept import kept_run
from pbrl_bringup.experiments.namo_figure import draw
from pbrl_bringup.experiments.namo_rooms import LONG, SQUARE, Layout, draw_room
from pbrl_bringup.namo_run import NamoOutcome, run_namo
from pbrl_bringup.parallel import in_parallel

RUNS, ENOUGH = 40, 38
RUNS_KEPT = "runs"
"""Folder below an experiment's own: what was stopped goes on with what is in it."""
MOVED = 0.1
"""[m] and [rad] together by which a table is elsewhere at the end of a run."""
PLANNING = 2.0
"""Sum over a run [s]."""
PLANS, UPDATES, SURPRISES, PLANNED = (
    "calls to the planner",
    "calls to UpdateModel",
    "surprises",
    "overall planning time [s]",
)


@dataclass(frozen=True)
class Told:
    """What the thesis says of an experiment, one run (figure 45).

    Attributes:
        runtime: [s].
        planning: [s].
        plans: calls to the planner.
        updates: calls to UpdateModel.
    """

    runtime: float
    planning: float
    plans: int
    updates: int


def trial(seed: int, number: int, layout: Layout, folder: Path) -> NamoOutcome:
    """Draw a room and let the robot find its way in it, unless that is done already.

    Args:
        seed: of the experiment.
        number: of the run.
        layout: of the rooms.
        folder: where runs are kept.

    Raises:
        BringupError: a run of another seed or layout is kept there.
    """

    def run() -> NamoOutcome:
        rng = np.random.default_rng([seed, number])
        return run_namo(*draw_room(rng, layout))

    told = {"seed": seed, "number": number, "half_width": layout.half_width, "surprises": layout.surprises}
    return kept_run(NamoOutcome, folder / f"{number:02d}.json", told, run)


def measured(seed: int, quick: bool, out: Path, layout: Layout, thesis: Told) -> Measured:
    """Run an experiment and draw its first run that went as in the thesis.

    Args:
        seed: of all runs.
        quick: one run.
        out: folder of the figure.
        layout: of the rooms.
        thesis: its numbers.
    """
    count = 1 if quick else RUNS
    runs = in_parallel(trial, [(seed, k, layout, out / RUNS_KEPT) for k in range(count)], "rooms")
    shown = max(range(count), key=lambda k: runs[k].reached + _as_told(runs[k]))
    scene, *_ = draw_room(np.random.default_rng([seed, shown]), layout)
    draw(runs[shown], out, braked=braked(scene))
    return Measured(rows_of(runs, thesis), {"runs": [told(run) for run in runs]})


def braked(scene: Scene) -> dict[str, list[tuple[float, float]]]:
    """Return where the locked casters of each table are, in its own frame [m]."""
    tables = {name: body for name, body in scene.bodies.items() if isinstance(body, OfficeTable)}
    return {
        name: [tables[name].swivels[caster] for caster in casters]
        for name, casters in scene.concealed.locked_casters.items()
        if name in tables
    }


def rows_of(runs: Sequence[NamoOutcome], thesis: Told) -> list[Row]:
    """Return the rows of an experiment."""
    count = len(runs)
    reached = [run for run in runs if run.reached]
    failed = Counter(run.sentence for run in runs if not run.reached)
    updates = [run.rows[UPDATES] for run in runs]
    return [
        at_least("runs that reach the goal", len(reached), f"of {count}", ENOUGH * count / RUNS, **failed),
        at_most(
            "planning time, sum over a run, largest",
            max(run.rows[PLANNED] for run in runs),
            "s",
            PLANNING,
            median=statistics.median(run.rows[PLANNED] for run in runs),
            thesis=thesis.planning,
        ),
        at_most(
            "model updates, median, off the thesis's",
            abs(statistics.median(updates) - thesis.updates),
            "1",
            0.0,
            median=statistics.median(updates),
            surprises=statistics.median(run.rows[SURPRISES] for run in runs),
            thesis=thesis.updates,
        ),
        at_most(
            "runs in which updates and surprises differ",
            sum(r.rows[UPDATES] != r.rows[SURPRISES] for r in runs),
            "1",
            0,
        ),
        at_most(
            "run time, simulated, median",
            statistics.median([run.seconds for run in reached] or [float("nan")]),
            "s",
            thesis.runtime,
            thesis=thesis.runtime,
            plans=statistics.median(run.rows[PLANS] for run in runs),
            plans_thesis=thesis.plans,
        ),
        at_most(
            "goal missed by, worst of those that reach it",
            max([run.error for run in reached] or [float("nan")]),
            "m",
            0.1,
        ),
        at_least(
            "of these, runs that left the stuck table and moved the other one",
            sum(map(_as_told, reached)),
            f"of {count}",
            ENOUGH * count / RUNS,
        ),
    ]


def _as_told(run: NamoOutcome) -> bool:
    """Say whether a run went as in the thesis: something was learned, the square table stayed, the long one did not."""
    begun, ended = (np.array([run.moments[k].poses[name] for name in (SQUARE, LONG)]) for k in (0, -1))
    moved = np.hypot(*(ended - begun)[:, :2].T) + np.abs(ended - begun)[:, 2] > MOVED
    return run.rows[UPDATES] > 0.0 and not moved[0] and bool(moved[1])


def told(run: NamoOutcome) -> dict[str, Any]:
    """Return a run for the report."""
    return asdict(run)
