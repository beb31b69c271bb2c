"""Figures 8 and 9: an eraser is brought round a hole punch that must not be touched."""

from __future__ import annotations

import math
import statistics
from pathlib import Path

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.tabletop_executed import Executed, details_of, executed

STARTS, QUICK_STARTS = 20, 2
SUCCESSES = 19
NEAR, OFF, ALIGNED_WEIGHT = 0.03, math.radians(10.0), 0.1
"""How far from its place, and how far from parallel, the eraser may be [m], [rad]."""
MOVED = 0.001
"""[m] from which on the obstacle moved."""
THESIS_REPLANS, THESIS_SECONDS = 2, 442.0


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Bring the eraser round the hole punch from 20 random starts on the right of it."""
    limit = NEAR + ALIGNED_WEIGHT * OFF
    found = executed("obstacle", "obstacle", seed, out, QUICK_STARTS if quick else STARTS, limit, place="right")
    return Measured(rows_of(found, limit), {**details_of(found), "limit": limit})


def rows_of(found: list[Executed], limit: float) -> list[Row]:
    """Return the acceptance rows."""
    outcomes = [each.outcome for each in found]
    good = sum(each.outcome.cost <= limit and each.obstacles_moved <= MOVED for each in found)
    return [
        at_least(
            "brought there, and the obstacle not moved",
            good,
            f"of {len(found)}",
            math.ceil(SUCCESSES / STARTS * len(found)),
            there=sum(each.cost <= limit for each in outcomes),
        ),
        at_most("way of the obstacle, most", max(each.obstacles_moved for each in found), "m", MOVED),
        at_most(
            "times planned anew, median",
            statistics.median(each.replans for each in outcomes),
            "1",
            6,
            thesis=THESIS_REPLANS,
            most=max(each.replans for each in outcomes),
        ),
        at_most(
            "time that it takes, simulated, median",
            statistics.median(each.simulated for each in outcomes),
            "s",
            THESIS_SECONDS,
            thesis=THESIS_SECONDS,
            pushes=statistics.median(each.pushes for each in outcomes),
        ),
    ]
