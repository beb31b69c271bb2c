"""Hostile files and messages by the thousand: each is read, or refused in a line that a person can act on."""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz.campaign import Tally, attack, shares_of
from pbrl_bringup.fuzz.subjects import FILES, NODES
from pbrl_bringup.fuzz.worker import MOST_MEMORY, PATIENCE
from pbrl_bringup.terminal import Advance, output, progress, table

INPUTS, QUICK_INPUTS = 100_000, 2000
HANG, MEMORY, OUTSIDE = "still reading", "MiB of memory", "outside of its folder"
"""Words by which findings are told apart; all others are errors that nobody foresaw, or ends of the process."""


def measure(
    seed: int,
    quick: bool,
    out: Path,
    *,
    sets: Sequence[str] = (),
    most: int | None = None,
    minutes: float | None = None,
) -> Measured:
    """Give inputs to readers and nodes.

    Args:
        seed: of every input.
        quick: whether there are fewer.
        out: folder that a table for docs/reliability.md goes into.
        sets: names of readers and nodes; none: all.
        most: inputs in all; None: 100,000.
        minutes: after which no further input is read; each reader has a part of them, like its part of the inputs.

    Raises:
        BringupError: there is no such reader, or there are fewer inputs than readers.
    """
    shares = {**FILES, **NODES}
    unknown = [name for name in sets if name not in shares]
    if unknown:
        raise BringupError(f"--sets: expected some of {'; '.join(shares)}, got {unknown[0]!r}")
    chosen = {name: shares[name] for name in sets} if sets else shares
    count = (QUICK_INPUTS if quick else INPUTS) if most is None else most
    if count < len(chosen):
        raise BringupError(f"--most: expected one input a reader at least, {len(chosen)}, got {count}")
    tallies: dict[str, Tally] = {}
    given = shares_of(chosen, count)
    end = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
    with progress("hostile inputs", total=count) as bar:
        for name, number in given.items():
            done = sum(each.inputs for each in tallies.values())
            left = count - sum(given[other] for other in tallies)
            begun = time.monotonic()
            share = begun + (end - begun) * (0.5 * number / left + 0.5 / (len(given) - len(tallies)))
            tallies[name] = attack(name, seed, number, partial(_show, bar, done, name), partial(_is_past, share))
    output().print(_table(tallies))
    (out / "reliability.md").write_text(markdown(tallies, seed), encoding="utf-8")
    return Measured(rows_of(tallies), {name: asdict(each) for name, each in tallies.items()})


def _show(bar: Advance, before: int, name: str, at: int) -> None:
    bar(before + at, name)


def _is_past(end: float) -> bool:
    return time.monotonic() > end


def rows_of(tallies: Mapping[str, Tally]) -> list[Row]:
    """Return the rows of acceptance."""
    found = [finding.fault for each in tallies.values() for finding in each.findings]
    inputs = sum(each.inputs for each in tallies.values())
    refused = sum(each.refused for each in tallies.values())
    outside = sum(OUTSIDE in fault or "beside its folder" in fault for fault in found)
    hangs = sum(fault.startswith((HANG, "silent")) for fault in found)
    large = sum(fault.endswith(MEMORY) for fault in found)
    slowest = max(tallies, key=lambda name: tallies[name].slowest)
    largest = max(tallies, key=lambda name: tallies[name].memory)
    return [
        at_least("hostile inputs", inputs, "1", min(inputs, INPUTS), refused=refused, readers=len(tallies)),
        at_most("places where an error nobody foresaw came from", len(found) - outside - hangs - large, "1", 0),
        at_most("places that wrote outside of their folder", outside, "1", 0),
        at_most(f"places that took more than {PATIENCE:g} s", hangs, "1", 0),
        at_most("slowest input", tallies[slowest].slowest, "s", PATIENCE, reader=slowest),
        at_most(
            "peak memory", max(t.memory for t in tallies.values()) / 2**20, "MiB", MOST_MEMORY / 2**20, reader=largest
        ),
    ]


def _table(tallies: Mapping[str, Tally]) -> object:
    rows = [_cells(name, each) for name, each in tallies.items()]
    return table("hostile inputs", HEADS, rows, right=(1, 2, 3, 4, 5))


HEADS = ("reader", "inputs", "refused", "findings", "slowest [ms]", "peak memory [MiB]")


def _cells(name: str, tally: Tally) -> tuple[str, ...]:
    numbers = (tally.inputs, tally.refused, tally.faults, round(1e3 * tally.slowest), tally.memory >> 20)
    return (name, *map(str, numbers))


def markdown(tallies: Mapping[str, Tally], seed: int) -> str:
    """Return the table of docs/reliability.md."""
    inputs = sum(each.inputs for each in tallies.values())
    minutes = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) / 60.0
    lines = [
        f"`./pbrl bench fuzz --seed {seed} --most {inputs}`, {minutes:.0f} minutes of one core:",
        "",
        f"| {' | '.join(HEADS)} |",
        f"|---{'|---:' * (len(HEADS) - 1)}|",
        *(f"| {' | '.join(_cells(name, each))} |" for name, each in tallies.items()),
        "| " + " | ".join(_cells("all", _all(tallies))) + " |",
    ]
    return "\n".join(lines) + "\n"


def _all(tallies: Mapping[str, Tally]) -> Tally:
    """Return the sum of counts, and the worst of the rest."""
    whole = Tally()
    for each in tallies.values():
        whole.inputs, whole.refused, whole.faults = (
            whole.inputs + each.inputs,
            whole.refused + each.refused,
            whole.faults + each.faults,
        )
        whole.slowest, whole.memory = max(whole.slowest, each.slowest), max(whole.memory, each.memory)
    return whole
