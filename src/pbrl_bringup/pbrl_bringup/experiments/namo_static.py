"""Thesis 6.5.1, figure 43: the table that seems best is stuck; the robot learns that and moves the other one."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.namo_rooms import STUCK
from pbrl_bringup.experiments.namo_trials import Told, measured

THESIS = Told(runtime=288.0, planning=37.0, plans=1, updates=1)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run the experiment: three or four casters of the square table are locked, drawn anew in each room."""
    return measured(seed, quick, out, STUCK, THESIS)
