"""Figure 7: four plates and two platters are laid; planning with and without the descent, and whether it succeeds."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.tabletop_planning import Thesis, measured

THESIS = Thesis(nodes=1898, seconds=32.0, seconds_without=94.0, limit=4.0)
STARTS, QUICK_STARTS = 20, 2
LAID, QUICK_LAID = 50, 2
"""Starts from which the table is to be laid."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Search from 20 random starts, lay 50 tables in plans, and one in the simulator."""
    starts, laid = (QUICK_STARTS, QUICK_LAID) if quick else (STARTS, LAID)
    return measured("table_6", seed, out, THESIS, starts, laid, shown=not quick)
