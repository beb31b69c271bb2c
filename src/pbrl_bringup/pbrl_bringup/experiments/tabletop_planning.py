"""Figures 6, 7, 9 and 10: a table is laid, with the descent of the objective (DIRECTGD) and without.

The measure is the thesis's: what a search without the descent has reached with as many layouts as the thesis's had; how
long it takes with the descent to reach the same; and how far each gets with the same number of layouts.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.tabletop_figure import draw_costs, draw_run
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.tabletop.desk_run import DeskRun, random_layout
from pbrl_bringup.tabletop.models import best_known, desk_scene, objective_file, random_layouts, taught_model
from pbrl_bringup.tabletop.pictures import Pictures
from pbrl_bringup.tabletop.tidy import tidied
from pbrl_planner.tabletop import (
    Desk,
    LearnedDisplacements,
    Objective,
    TabletopPlanner,
    TabletopSettings,
    Tidying,
    TidyingSettings,
)

PLAIN = TabletopSettings(
    travels=(0.05,), descent=False, climb=False, push_cost=0.0, shorten=False, nodes=100_000, time_limit=60.0
)
"""The thesis's search without its descent."""
WITH_DESCENT = PLAIN.model_copy(update={"descent": True})
OURS = TabletopSettings(nodes=100_000, time_limit=60.0)
PATIENCE = 60.0
"""[s] of a search that does not get there."""
CLOSED = 0.95
"""Share of the way from a start's cost to the best that is known, from which on a table counts as laid."""
DESCENTS = 60


@dataclass(frozen=True)
class Thesis:
    """Figure 9 for one task.

    Attributes:
        nodes: layouts of its search without the descent.
        seconds: with the descent.
        seconds_without: without.
        limit: most that ours may take [s].
    """

    nodes: int
    seconds: float
    seconds_without: float
    limit: float


@dataclass(frozen=True)
class Searched:
    """What became of one start.

    Attributes:
        first: cost at the start.
        without: cost that the search without the descent reached with the thesis's number of layouts.
        seconds_without: that it took [s].
        seconds_with: that the same search with the descent took to get as far [s]; infinite: it did not.
        layouts_with: in its tree then.
        seconds_ours: likewise of ours.
        with_descent: cost that the search with the descent reached with the same number of layouts.
        laid: time after which ours had closed `CLOSED` of the gap [s]; infinite: it did not within `PATIENCE`.
        cost: that ours reached, with that time or when it had closed the gap.
        steps: pushes of its plan.
    """

    first: float
    without: float
    seconds_without: float
    seconds_with: float
    layouts_with: int
    seconds_ours: float
    with_descent: float
    laid: float
    cost: float
    steps: int


def measured(name: str, seed: int, out: Path, thesis: Thesis, starts: int, laid: int, shown: bool) -> Measured:
    """Teach, search from random starts, and lay one table in the simulator.

    Args:
        name: of desk and objective.
        seed: of everything.
        out: folder of the figures.
        thesis: what was printed.
        starts: that are searched from.
        laid: starts from which it is looked whether the table is laid in the end; they are among the former.
        shown: run one in the simulator, for the film strip.
    """
    scene = desk_scene(name, "noise")
    model, _ = taught_model(scene, seed)
    with DeskRun(scene, seed=seed) as run:
        desk = run.desk
    objective = Objective.from_file(desk, objective_file(name))
    best = best_known(objective, random_layouts(desk, seed + 1, DESCENTS))[1]
    told = model.as_dict()
    jobs = [(desk, name, told, seed, number, thesis.nodes, best, number < laid) for number in range(max(starts, laid))]
    found = in_parallel(trial, jobs, "starts")
    draw_costs([asdict(each) for each in found], best, thesis.seconds, out)
    rows = rows_of(found[:starts], found[:laid], thesis)
    details: dict[str, Any] = {"starts": [asdict(each) for each in found], "best": best}
    if shown:
        details["run"] = _shown(name, seed, told, objective, best, out)
    return Measured(rows, details)


def trial(
    desk: Desk,
    name: str,
    told: Mapping[str, Sequence[Mapping[str, object]]],
    seed: int,
    number: int,
    nodes: int,
    best: float,
    lay: bool,
) -> Searched:
    """Search from one start, three ways.

    Args:
        desk: without its arm: dishes are laid by whoever reaches them.
        name: of the objective.
        told: the model.
        seed: of the starts.
        number: of this one.
        nodes: layouts that the search without the descent gets.
        best: cost that is known to be possible.
        lay: whether ours goes on until the table is laid.
    """
    objective, model = Objective.from_file(desk, objective_file(name)), LearnedDisplacements.from_dict(told)
    start = random_layout(desk, np.random.default_rng([seed, number]))
    TabletopPlanner(objective, model, start, seed=1, settings=OURS).improve(0.05)  # compiles, or loads what was

    def search(settings: TabletopSettings) -> TabletopPlanner:
        return TabletopPlanner(objective, model, start, seed=number + 1, settings=settings)

    plain = search(PLAIN.model_copy(update={"nodes": nodes}))
    plain.improve(PATIENCE)
    level = plain.best_cost
    same = search(WITH_DESCENT.model_copy(update={"nodes": nodes}))
    same.improve(PATIENCE)
    helped, ours = search(WITH_DESCENT), search(OURS)
    reached = helped.improve(PATIENCE, level)
    quick = ours.improve(PATIENCE, level)
    seconds_ours = ours.seconds if quick else np.inf
    begun, taken = time.perf_counter(), ours.seconds
    enough = ours.first_cost - CLOSED * (ours.first_cost - best)
    done = ours.improve(PATIENCE - taken, enough) if lay else False
    return Searched(
        ours.first_cost,
        level,
        plain.seconds,
        helped.seconds if reached else np.inf,
        helped.count,
        seconds_ours,
        same.best_cost,
        taken + time.perf_counter() - begun if done else np.inf,
        ours.best_cost,
        len(ours.plan().steps),
    )


def rows_of(found: Sequence[Searched], laid: Sequence[Searched], thesis: Thesis) -> list[Row]:
    """Return the acceptance rows."""
    with_gd, without = (
        statistics.median(each) for each in zip(*((s.seconds_with, s.seconds_without) for s in found), strict=True)
    )
    ours = statistics.median(each.seconds_ours for each in found)
    gain = statistics.median(each.without - each.with_descent for each in found)
    rows = [
        at_most(
            f"time to what {thesis.nodes} layouts reach without the descent, median of {len(found)}",
            with_gd,
            "s",
            thesis.limit,
            thesis=thesis.seconds,
            ours=ours,
        ),
        at_least(
            "gain of the descent: time without it over time with it",
            without / with_gd,
            "1",
            1.0,
            thesis=round(thesis.seconds_without / thesis.seconds, 2),
        ),
        at_least("gain of the descent: cost after as many layouts, median", gain, "1", 0.0),
    ]
    if laid:
        share = sum(each.laid <= PATIENCE for each in laid) / len(laid)
        seconds = statistics.median(each.laid for each in laid)
        rows.append(
            at_least(f"tables laid within {PATIENCE:g} s, of {len(laid)}", share, "1", 0.95, median_seconds=seconds)
        )
    return rows


def _shown(
    name: str,
    seed: int,
    told: Mapping[str, Sequence[Mapping[str, object]]],
    objective: Objective,
    best: float,
    out: Path,
) -> dict[str, Any]:
    """Lay one table in the simulator, and draw it."""
    with DeskRun(desk_scene(name, "rendered"), seed=seed) as run:
        run.place(random_layout(run.desk, np.random.default_rng([seed, 0])))
        own = Objective(run.desk, objective.cost, objective.name)
        first = own(run.truth())
        settings = TidyingSettings(enough=first - 0.9 * (first - best), think=3.0)
        task = Tidying(own, LearnedDisplacements.from_dict(told), seed=seed + 1, settings=settings)
        pictures = Pictures(run.session)
        outcome, layouts = tidied(run, task, pictures.take)
        draw_run(run.desk, layouts, pictures, outcome, out)
    return asdict(outcome)
