"""Thesis 6.5.2, figure 44: one table is stuck, the other has a locked caster; it is learned, and turned about that."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.namo_rooms import TURNED
from pbrl_bringup.experiments.namo_trials import Told, measured

THESIS = Told(runtime=466.0, planning=52.0, plans=2, updates=2)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run the experiment: three or four casters of the square table and one of the long one are locked."""
    return measured(seed, quick, out, TURNED, THESIS)
