"""A desk is cleaned from the same starts with both forward models: tables of displacements, and the world model.

The tables have seen each push of each item several times, the world model each primitive once.
"""

from __future__ import annotations

import math
import statistics
from pathlib import Path

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.tabletop_clean import desk_limit
from pbrl_bringup.experiments.tabletop_executed import Executed, details_of, executed
from pbrl_planner.tabletop import FORWARD_MODELS

STARTS, QUICK_STARTS = 8, 1
SHARE = 0.9
MORE_PUSHES = 1.25
"""Over what the tables need, in the median."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Clean the desk from the same random starts with each."""
    best, limit = desk_limit(seed)
    count = QUICK_STARTS if quick else STARTS
    found: dict[str, list[Executed]] = {}
    for forward in FORWARD_MODELS:
        folder = out / forward
        folder.mkdir(parents=True, exist_ok=True)
        found[forward] = executed("desk", "straighten", seed, folder, count, limit, forward=forward)
    details: dict[str, object] = {name: details_of(runs) for name, runs in found.items()}
    return Measured(rows_of(found["tables"], found["physics"], limit), {**details, "best": best, "limit": limit})


def rows_of(tables: list[Executed], physics: list[Executed], limit: float) -> list[Row]:
    """Return the rows; what is compared is side by side in each."""
    both = (tables, physics)
    reached = [sum(each.outcome.cost <= limit for each in runs) for runs in both]
    pushes, replans, planning = (
        [statistics.median(getattr(each.outcome, name) for each in runs) for runs in both]
        for name in ("pushes", "replans", "planning")
    )
    return [
        at_least(
            "objective reached with the world model",
            reached[1],
            f"of {len(physics)}",
            math.ceil(SHARE * len(physics)),
            tables=reached[0],
        ),
        at_least(
            "pushes that taught the tables, over those that taught the world model",
            tables[0].taught / physics[0].taught,
            "1",
            5.0,
            tables=tables[0].taught,
            world_model=physics[0].taught,
        ),
        at_most(
            "pushes that tidy with the world model, over those with the tables, medians",
            pushes[1] / pushes[0],
            "1",
            MORE_PUSHES,
            tables=pushes[0],
            world_model=pushes[1],
        ),
        at_most(
            "times planned anew with the world model, median",
            replans[1],
            "1",
            6,
            tables=replans[0],
            planning_tables=planning[0],
            planning_world_model=planning[1],
        ),
    ]
