"""Figures 5 and 9, cleaning a desk: a scale, a remote and an eraser are straightened and brought to the middle."""

from __future__ import annotations

import math
import statistics
from pathlib import Path

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.tabletop_executed import Executed, details_of, executed
from pbrl_bringup.tabletop.desk_run import DeskRun
from pbrl_bringup.tabletop.models import best_known, desk_scene, objective_file, random_layouts
from pbrl_planner.tabletop import Objective

STARTS, QUICK_STARTS = 20, 1
SUCCESSES, REPLANS = 18, 6
NEAR, OFF, ALIGNED_WEIGHT = 0.03, math.radians(5.0), 0.2
"""What the objective counts as reached: each item so far from the best layout known, and so askew [m], [rad]."""
TWO_INCHES = 0.0508
"""The thesis's own measure: how far the middle of all items is from the middle of the table [m]."""
STRAIGHT = math.radians(10.0)
"""And how far from parallel an item may be to count as straight [rad]; the thesis gives no number."""
DESCENTS = 60
THESIS_REPLANS, THESIS_SECONDS = 4, 820.0


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Clean the desk from 20 random starts."""
    best, limit = desk_limit(seed)
    found = executed("desk", "straighten", seed, out, QUICK_STARTS if quick else STARTS, limit)
    return Measured(rows_of(found, limit), {**details_of(found), "best": best, "limit": limit})


def desk_limit(seed: int) -> tuple[float, float]:
    """Return the cost of the best layout known, and the cost at which the desk counts as clean."""
    with DeskRun(desk_scene("desk", "noise"), seed=seed) as run:
        objective = Objective.from_file(run.desk, objective_file("straighten"))
        best = best_known(objective, random_layouts(run.desk, seed + 1, DESCENTS))[1]
    return best, best + len(objective.desk.items) * (NEAR + ALIGNED_WEIGHT * OFF)


def rows_of(found: list[Executed], limit: float) -> list[Row]:
    """Return the acceptance rows."""
    reached = sum(each.outcome.cost <= limit for each in found)
    straight = sum(_as_the_thesis(each) for each in found)
    outcomes = [each.outcome for each in found]
    share = SUCCESSES / STARTS * len(found)
    return [
        at_least("objective reached, as it truly is", reached, f"of {len(found)}", math.ceil(share), cost=limit),
        at_most(
            "times planned anew, median",
            statistics.median(each.replans for each in outcomes),
            "1",
            REPLANS,
            thesis=THESIS_REPLANS,
            most=max(each.replans for each in outcomes),
        ),
        at_least("straight, and the middle of all within two inches of the table's", straight, f"of {len(found)}", 0),
        at_most(
            "time that it takes, simulated, median",
            statistics.median(each.simulated for each in outcomes),
            "s",
            THESIS_SECONDS,
            thesis=THESIS_SECONDS,
            pushes=statistics.median(each.pushes for each in outcomes),
            planning=statistics.median(each.planning for each in outcomes),
        ),
    ]


def _as_the_thesis(run: Executed) -> bool:
    """Say whether a run ended as the thesis's did."""
    last = np.array(run.last)
    right = math.pi / 2.0
    off = np.abs(last[:, 2] - right * np.round(last[:, 2] / right))
    return bool(np.hypot(*last[:, :2].mean(axis=0)) <= TWO_INCHES and off.max() <= STRAIGHT)
