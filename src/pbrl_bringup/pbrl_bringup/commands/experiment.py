"""`./pbrl experiment NAME`: repeat an experiment of the thesis, with its number beside ours."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.commands.measured import run_measured
from pbrl_bringup.measurable import EXPERIMENTS


def command(name: str, out: Path | None, seed: int, quick: bool, scheduler: str | None = None) -> int:
    """Run one experiment.

    Raises:
        BringupError: there is none of that name, or no such scheduler.
    """
    return run_measured("experiment", EXPERIMENTS, name, out, seed, quick, scheduler=scheduler)
