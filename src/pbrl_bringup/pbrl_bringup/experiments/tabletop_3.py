"""Figure 6: two plates and a platter are laid; planning with and without the descent of the objective."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.tabletop_planning import Thesis, measured

THESIS = Thesis(nodes=1399, seconds=18.0, seconds_without=33.0, limit=2.0)
STARTS, QUICK_STARTS = 20, 4


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Search from 20 random starts, and lay one table in the simulator."""
    return measured("table_3", seed, out, THESIS, QUICK_STARTS if quick else STARTS, 0, shown=not quick)
