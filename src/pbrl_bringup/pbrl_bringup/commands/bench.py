"""`./pbrl bench NAME`: measure, print a table and, as the last line, the report."""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.commands.measured import run_measured

BENCHES = {
    "sim": "a pushed table against a hand calculation, kinematics, speed",
    "wheel": "the wheel of tables with a locked caster, and held-out prediction",
    "cabinet": "the hinge of a real cabinet pulled by a real PR2",
    "recorder": "a recorder killed in mid-run",
    "mcap": "recordings read by two independent readers",
    "kernel": "steps a second of the compiled world model, against pymunk",
    "inference": "posterior and evidence of one wheel, ours against others given the same likelihood",
    "pose": "a wheel's place from pushes of random tables",
    "calibration": "ranks of the truth among posterior draws, over the prior",
    "concealed": "recordings with one thing concealed: is it noticed, named, and does the repair predict",
}


def command(name: str, out: Path | None, seed: int, quick: bool) -> int:
    """Run one bench.

    Raises:
        BringupError: there is none of that name.
    """
    return run_measured("bench", BENCHES, name, out, seed, quick)
