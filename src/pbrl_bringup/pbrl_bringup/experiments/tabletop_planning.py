"""Figures 6, 7, 9 and 10: a table is laid, with the descent of the objective (DIRECTGD) and without.

Three measures. The thesis's: how long a search with the descent takes to what one without it has reached with as many
layouts as the thesis's had. What each reaches with that number of layouts. And how long each takes until the table is
laid but for a tenth, which the thesis's own figures end with.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.tabletop_figure import draw_costs, draw_run
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.tabletop.desk_run import DeskRun, random_layout
from pbrl_bringup.tabletop.models import best_known, desk_scene, objective_file, random_layouts, taught
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
    travels=(0.05,),
    descent=False,
    climb=False,
    carry=False,
    push_cost=0.0,
    shorten=False,
    nodes=100_000,
    time_limit=60.0,
)
"""The thesis's search without its descent."""
WITH_DESCENT = PLAIN.model_copy(update={"descent": True})
OURS = TabletopSettings(nodes=100_000, time_limit=60.0)
PATIENCE = 60.0
"""[s] of a search that does not get there."""
CLOSED, NEARLY = 0.95, 0.9
"""Share of the way from a start's cost to the best that is known, from which on a table counts as laid, or nearly."""
DESCENTS = 60
WARM = 300
"""Layouts of a search that is only made for what it compiles."""


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
    """What became of one start. Times are infinite where it was not reached within `PATIENCE`, NaN where not asked for.

    Attributes:
        first: cost at the start.
        without: cost that the search without the descent reached with the thesis's number of layouts.
        seconds_without: that it took [s].
        with_descent: cost that the search with the descent reached with the same number.
        seconds_with: time of a search with the descent until it was as good as `without` [s].
        seconds_ours: the same of ours.
        nearly: times until `NEARLY` of the gap is closed: without the descent, with it, ours [s].
        laid: time until ours had closed `CLOSED` of the gap [s].
        cost: of ours in the end.
        steps: pushes of its plan.
    """

    first: float
    without: float
    seconds_without: float
    with_descent: float
    seconds_with: float
    seconds_ours: float
    nearly: tuple[float, float, float]
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
    told = taught(scene, seed).data
    with DeskRun(scene, seed=seed) as run:
        desk = run.desk
    objective = Objective.from_file(desk, objective_file(name))
    best = best_known(objective, random_layouts(desk, seed + 1, DESCENTS))[1]
    jobs = [
        (desk, name, told, seed, number, thesis.nodes if number < starts else 0, best, number < laid)
        for number in range(max(starts, laid))
    ]
    found = in_parallel(trial, jobs, "starts")
    draw_costs([asdict(each) for each in found[:starts]], best, thesis.seconds, out)
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
        nodes: layouts that the search without the descent gets; 0: searches are not compared, only ours is made.
        best: cost that is known to be possible.
        lay: whether ours goes on until the table is laid.
    """
    objective, model = Objective.from_file(desk, objective_file(name)), LearnedDisplacements.from_dict(told)
    start = random_layout(desk, np.random.default_rng([seed, number]))

    def search(settings: TabletopSettings) -> TabletopPlanner:
        return TabletopPlanner(objective, model, start, seed=number + 1, settings=settings)

    for settings in (PLAIN, OURS):  # what is compiled, or loaded, is no part of a search
        search(settings.model_copy(update={"nodes": WARM})).improve(PATIENCE)
    ours = search(OURS)
    first = ours.first_cost
    level, seconds, same, as_good, nearly = np.nan, np.nan, np.nan, (np.nan, np.nan), (np.nan,) * 3
    if nodes:
        plain, descending = (search(each.model_copy(update={"nodes": nodes})) for each in (PLAIN, WITH_DESCENT))
        plain.improve(PATIENCE)
        descending.improve(PATIENCE)
        level, seconds, same = plain.best_cost, plain.seconds, descending.best_cost
        searches = [search(PLAIN), search(WITH_DESCENT), ours]
        as_good = _until(searches[1], level), _until(ours, level)
        target = first - NEARLY * (first - best)
        nearly = _until(searches[0], target), _until(searches[1], target), _until(ours, target)
    laid = _until(ours, first - CLOSED * (first - best)) if lay else np.nan
    steps = len(ours.plan().steps)
    return Searched(first, level, seconds, same, *as_good, nearly, laid, ours.best_cost, steps)


def _until(search: TabletopPlanner, cost: float) -> float:
    """Go on with a search until it is as good as a cost; return its time in all [s], infinite where it is not."""
    reached = search.best_cost <= cost or search.improve(max(PATIENCE - search.seconds, 0.0), cost)
    return search.seconds if reached else np.inf


def rows_of(found: Sequence[Searched], laid: Sequence[Searched], thesis: Thesis) -> list[Row]:
    """Return the acceptance rows."""
    ours = statistics.median(each.seconds_ours for each in found)
    gain = statistics.median(each.without - each.with_descent for each in found)
    times = [statistics.median(each.nearly[k] for each in found) for k in range(3)]
    shares = [sum(np.isfinite(each.nearly[k]) for each in found) / len(found) for k in range(3)]
    rows = [
        at_most(
            f"time to what {thesis.nodes} layouts reach without the descent, median of {len(found)}",
            statistics.median(each.seconds_with for each in found),
            "s",
            thesis.limit,
            thesis=thesis.seconds,
            ours=ours,
        ),
        at_least("gain of the descent: cost after as many layouts, median", gain, "1", 0.0),
        at_least(
            "gain of the descent: time without it over time with it to the same cost, median",
            statistics.median(each.seconds_without / each.seconds_with for each in found),
            "1",
            1.0,
            thesis=round(thesis.seconds_without / thesis.seconds, 2),
            nearly_laid_without=shares[0],
            nearly_laid_with=shares[1],
            nearly_laid_ours=shares[2],
            seconds_until_nearly_laid_ours=times[2],
        ),
    ]
    if math.isfinite(times[1]):  # else there are no two times to compare
        gained = min(times[0], PATIENCE) / times[1]
        what = "gain of the descent: time without it until the table is nearly laid, over time with it, medians"
        rows.append(at_least(what, gained, "1", 1.0, seconds_without=times[0], seconds_with=times[1]))
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
