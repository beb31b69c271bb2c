"""Random missions beside places that are kept out of: how near robot and load ever come to them, truly."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from pbrl_bringup.benches.carried import Carried
from pbrl_bringup.benches.fence_missions import LONGEST, Mission, mission
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel
from pbrl_namo.warming import compile_kernels

MISSIONS, QUICK_MISSIONS = 500, 4
"""A quick one has one of each kind."""
LEAST = 0.005
"""[m] that is left, at least, where it is nearest."""


CARRIED = Carried(
    ("missions/*.json",),
    ("bullet_sim", "krang_sim", "pbrl_bringup.benches.fence_missions", "pbrl_control", "pbrl_namo"),
)


def measure(seed: int, quick: bool, out: Path, *, most: int | None = None, minutes: float | None = None) -> Measured:
    """Do missions. What is done is kept: the same command goes on where it was stopped.

    Args:
        seed: of all missions.
        quick: whether there are only a few.
        out: folder that missions are kept in.
        most: missions in all; None: 500.
        minutes: after which none is begun.

    Raises:
        BringupError: other missions are kept there.
    """
    count = (QUICK_MISSIONS if quick else MISSIONS) if most is None else most
    compile_kernels()
    end = None if minutes is None else time.time() + 60.0 * minutes
    found = in_parallel(mission, [(seed, number, out / "missions", end) for number in range(count)], "missions")
    done = [each for each in found if each is not None]
    if not done:
        raise BringupError("--minutes: expected time for one mission at least; give more")
    return Measured(rows_of(done, count), {"missions": [asdict(each) for each in done]})


def rows_of(done: Sequence[Mission], count: int) -> list[Row]:
    """Return the rows of acceptance for missions, of which there are to be so many."""
    nearest = {each.kind: min(other.nearest for other in done if other.kind == each.kind) for each in done}
    crossed = [each for each in done if not each.nearest > 0.0]
    held_back, held = sum(each.fenced for each in done), sum(each.held for each in done)
    return [
        at_least("missions", len(done), "1", count, held_back=held_back, with_a_load=held),
        at_most("missions in which the fence was crossed", len(crossed), "1", 0),
        *(at_least(f"nearest to the fence, {kind}", nearest[kind], "m", LEAST) for kind in LONGEST if kind in nearest),
    ]
