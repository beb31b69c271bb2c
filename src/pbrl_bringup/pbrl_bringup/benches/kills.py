"""Nodes of the NAMO graph killed and frozen at every state of the executive: rest, mission and recording."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pbrl_bringup.benches.carried import Carried
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.kept import keep_run, read_run
from pbrl_bringup.files import write_text
from pbrl_bringup.kills.cases import STATES, Case, draw_cases, lives_of
from pbrl_bringup.kills.striking import NOT_MET, REPORTED, RESUMED, Outcome, live
from pbrl_bringup.terminal import output, progress, table

CASES, QUICK_CASES = 200, 4
REST, LOST = 0.3, 1.0
"""[s] until the robot rests, and of a recording."""
HEADS = ("node", "cases", "robot moved", "longest until rest [s]", "resumed", "reported", "longest recovery [s]")


@dataclass(frozen=True)
class Lived:
    """What became of the cases that shared a graph."""

    outcomes: tuple[Outcome, ...]


CARRIED = Carried(
    ("lives/*.json",),
    (
        "bullet_sim",
        "krang_sim",
        "pbrl_bag",
        "pbrl_bringup.kills",
        "pbrl_bringup.middleware",
        "pbrl_control",
        "pbrl_model",
        "pbrl_namo",
    ),
)


def measure(seed: int, quick: bool, out: Path, *, most: int | None = None, minutes: float | None = None) -> Measured:
    """Strike nodes. What is done is kept: the same command goes on where it was stopped.

    Args:
        seed: of the cases.
        quick: whether there are only a few.
        out: folder that cases are kept in, and a table for docs/reliability.md.
        most: cases in all; None: 200.
        minutes: after which no further graph is started.

    Raises:
        BringupError: other cases are kept there, or a graph does not start.
    """
    count = (QUICK_CASES if quick else CASES) if most is None else most
    lives = lives_of(draw_cases(seed, count))
    end = None if minutes is None else time.monotonic() + 60.0 * minutes
    outcomes: list[Outcome] = []
    with progress("nodes struck", total=count) as bar:
        for life in lives:
            done = _lived(out, life, seed, count, begin=end is None or time.monotonic() < end)
            outcomes += done
            bar(len(outcomes))
    if not outcomes:
        raise BringupError("--minutes: expected time for one graph at least; give more")
    output().print(table("nodes struck", HEADS, cells(outcomes), right=(1, 2, 3, 4, 5, 6)))
    write_text(out / "reliability.md", markdown(outcomes, seed, count))
    return Measured(rows_of(outcomes, count), {"cases": [asdict(each) for each in outcomes]})


def _lived(out: Path, life: Sequence[Case], seed: int, count: int, *, begin: bool) -> tuple[Outcome, ...]:
    """Return what is kept of a graph's cases, or do them; nothing where none are kept and none shall be begun."""
    numbers = [case.number for case in life]
    told = {"seed": seed, "count": count, "cases": numbers}
    path = out / "lives" / f"{numbers[0]:03d}.json"
    kept = read_run(Lived, path, told)
    if kept is None and begin:
        folder = out / "graphs" / f"{numbers[0]:03d}"
        shutil.rmtree(folder, ignore_errors=True)  # of one that was stopped in the middle
        kept = Lived(tuple(live(folder, life, seed + numbers[0])))
        keep_run(path, told, kept)
        for bag in folder.glob("graph_*/bag_*"):
            shutil.rmtree(bag)  # hundreds of megabytes in all, and looked at
    return () if kept is None else kept.outcomes


def rows_of(outcomes: Sequence[Outcome], count: int) -> list[Row]:
    """Return the rows of acceptance for cases, of which there are to be so many.

    Beside the first stands how missions ended that nothing was struck in: their state was met in another graph.
    """
    struck = [each for each in outcomes if each.mission != NOT_MET]
    rests = [each for each in struck if each.rest is not None]
    slow = [each for each in rests if (each.rest or 0.0) > REST]
    told = Counter(each.mission for each in struck)
    lost, found = (
        max((value for each in struck if (value := getattr(each, name)) is not None), default=float("nan"))
        for name in ("lost", "found")
    )
    states = Counter(each.state for each in struck)
    before = Counter(f"before_{end.partition(':')[0]}" for each in outcomes for end in each.before)
    bad = {
        f"case {each.number}": f"{each.node} {each.way} in {each.state}: {each.sentence}"
        for each in struck
        if each.mission not in (RESUMED, REPORTED)
    }
    return [
        at_least("nodes killed or frozen", len(struck), "1", count, not_met=len(outcomes) - len(struck), **before),
        at_least("states in which that was", len(states), "1", min(len(STATES), count), **states),
        at_most(
            "longest until the robot rests, of those in which it moved",
            max((each.rest or 0.0 for each in rests), default=float("nan")),
            "s",
            REST,
            moved=len(rests),
            slower=len(slow),
        ),
        at_least("missions resumed or reported", told[RESUMED] + told[REPORTED], "1", len(struck), **told, **bad),
        at_most("longest stretch that a recording lost", lost, "s", LOST, found=found),
    ]


def cells(outcomes: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """Return the rows of the table: one a node and way."""
    rows: list[tuple[str, ...]] = []
    for node, way in sorted({(each.node, each.way) for each in outcomes}):
        own = [each for each in outcomes if (each.node, each.way) == (node, way) and each.mission != NOT_MET]
        rests = [each.rest for each in own if each.rest is not None]
        told = Counter(each.mission for each in own)
        slowest = f"{max(rests):.2f}" if rests else "–"
        longest = f"{max((each.recovery for each in own), default=0.0):.0f}"
        ends = str(told[RESUMED]), str(told[REPORTED])
        rows.append((f"{node} {way}", str(len(own)), str(len(rests)), slowest, *ends, longest))
    return rows


def markdown(outcomes: Sequence[Outcome], seed: int, count: int) -> str:
    """Return the table of docs/reliability.md: what was done so far of `count` cases."""
    lines = [
        f"`./pbrl bench kills --seed {seed} --most {count}`, {len(outcomes)} of its {count} cases:",
        "",
        f"| {' | '.join(HEADS)} |",
        f"|---{'|---:' * (len(HEADS) - 1)}|",
        *(f"| {' | '.join(row)} |" for row in cells(outcomes)),
    ]
    return "\n".join(lines) + "\n"
