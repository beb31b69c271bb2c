"""Rooms that conceal something: who asks where model and recording part, against who only learns the model again.

Both plan, push, are surprised and learn alike; the plain one then plans with what it learned, the other is told what
the table met and where, and plans in that world. Rooms, seeds and simulator are the same for both.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.experiments.figures import FIGURE
from pbrl_bringup.experiments.kept import kept_run
from pbrl_bringup.experiments.namo_concealed_rooms import Concealing, draw_concealing
from pbrl_bringup.experiments.namo_concealing import KINDS
from pbrl_bringup.experiments.namo_figure import draw
from pbrl_bringup.experiments.namo_trials import RUNS_KEPT
from pbrl_bringup.namo_run import NamoOutcome, run_namo
from pbrl_bringup.parallel import in_parallel
from pbrl_namo.executive.settings import ExecutiveSettings

ROOMS, MARGIN = 18, 0.2
"""Rooms, and by how much the share of those in which the goal is reached is to be above the plain learner's."""
LONGEST = 600.0
"""Simulated time after which a run has failed [s]."""
REPAIRED, SURPRISES = "repaired models", "surprises"


@dataclass(frozen=True)
class Pair:
    """One room, twice.

    Attributes:
        kind: of what is concealed.
        asked: who asks what was met.
        plain: who only learns again.
    """

    kind: str
    asked: NamoOutcome
    plain: NamoOutcome


def room_of(seed: int, number: int) -> Concealing:
    """Draw a room; the kinds take turns.

    Args:
        seed: of the experiment.
        number: of the room.
    """
    return draw_concealing(np.random.default_rng([seed, number]), KINDS[number % len(KINDS)])


def trial(seed: int, number: int, ask: bool, folder: Path) -> NamoOutcome:
    """Let the robot find its way in a room, unless that is done already.

    Args:
        seed: of the experiment.
        number: of the room.
        ask: whether it asks what it met.
        folder: where runs are kept.

    Raises:
        BringupError: a run of another seed is kept there.
    """

    def run() -> NamoOutcome:
        room = room_of(seed, number)
        return run_namo(room.scene, room.goal, room.seed, ExecutiveSettings(ask_mismatch=ask), longest=LONGEST)

    who = "asked" if ask else "plain"
    return kept_run(NamoOutcome, folder / f"{number:02d}_{who}.json", {"seed": seed, "number": number, "ask": ask}, run)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Run the experiment and draw a room in which asking helped.

    Args:
        seed: of all rooms.
        quick: one room of each kind.
        out: folder of the figures.
    """
    count = len(KINDS) if quick else ROOMS
    trials = [(seed, k, ask, out / RUNS_KEPT) for k in range(count) for ask in (True, False)]
    runs = in_parallel(trial, trials, "runs")
    pairs = [Pair(KINDS[k % len(KINDS)], runs[2 * k], runs[2 * k + 1]) for k in range(count)]
    shown = next((k for k, pair in enumerate(pairs) if pair.asked.reached and not pair.plain.reached), 0)
    room = room_of(seed, shown)
    for run, name in ((pairs[shown].asked, FIGURE), (pairs[shown].plain, "plain")):
        draw(run, out, room.outlines(), name, cords=room.cords())
    return Measured(rows_of(pairs), {"rooms": [told(pair) for pair in pairs]})


def rows_of(pairs: Sequence[Pair]) -> list[Row]:
    """Return the rows of the experiment."""
    asked, plain = (_share([getattr(pair, who) for pair in pairs]) for who in ("asked", "plain"))
    rows = [
        at_least(
            "share of rooms in which the goal is reached, above the plain learner's",
            asked - plain,
            "1",
            MARGIN,
            asked=asked,
            plain=plain,
            rooms=float(len(pairs)),
        )
    ]
    for kind in KINDS:
        of_kind = [pair for pair in pairs if pair.kind == kind]
        better, worse = _share([pair.asked for pair in of_kind]), _share([pair.plain for pair in of_kind])
        rows.append(
            at_least(
                f"{kind}: share reached", better, "1", worse, plain=worse, rooms=float(len(of_kind)), **_times(of_kind)
            )
        )
    surprised = [pair.asked for pair in pairs if pair.asked.rows[SURPRISES] > 0.0]
    found = [run for run in surprised if run.rows[REPAIRED] > 0.0]
    rows.append(
        at_least(
            "of rooms with a surprise, those in which something met was found",
            len(found),
            f"of {len(surprised)}",
            0.0,
        )
    )
    return rows


def _share(runs: Sequence[NamoOutcome]) -> float:
    return sum(run.reached for run in runs) / max(len(runs), 1)


def _times(pairs: Sequence[Pair]) -> dict[str, float]:
    """Return median times of both in the rooms in which both reach the goal [s]."""
    both = [pair for pair in pairs if pair.asked.reached and pair.plain.reached]
    if not both:
        return {}
    return {
        "seconds": statistics.median(pair.asked.seconds for pair in both),
        "seconds_plain": statistics.median(pair.plain.seconds for pair in both),
    }


def told(pair: Pair) -> dict[str, Any]:
    """Return a room for the report."""
    return asdict(pair)
