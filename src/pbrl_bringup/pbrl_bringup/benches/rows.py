"""The one form of what benches report: a row for each acceptance row that they measure."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pbrl_bringup.files import output_folder, without_nan, write_json


@dataclass(frozen=True)
class Row:
    """One measured number and what it has to reach.

    Attributes:
        what: what was measured, in words.
        value: the measured number.
        unit: of `value`.
        goal: what it has to reach, e.g. "<= 0.05".
        holds: whether it does.
        against: what it is compared with and that thing's number in the same run; empty if nothing.
    """

    what: str
    value: float
    unit: str
    goal: str
    holds: bool
    against: dict[str, float | str] = field(default_factory=dict)


def at_most(what: str, value: float, unit: str, limit: float, **against: float | str) -> Row:
    """Return a row whose value may not be greater than `limit`; NaN does not hold."""
    return Row(what, float(value), unit, f"<= {limit:g}", bool(value <= limit), dict(against))


def at_least(what: str, value: float, unit: str, limit: float, **against: float | str) -> Row:
    """Return a row whose value may not be smaller than `limit`; NaN does not hold."""
    return Row(what, float(value), unit, f">= {limit:g}", bool(value >= limit), dict(against))


def within(what: str, value: float, unit: str, centre: float, slack: float, **against: float | str) -> Row:
    """Return a row whose value may not be further than `slack` from `centre`."""
    return Row(what, float(value), unit, f"{centre:g} +- {slack:g}", bool(abs(value - centre) <= slack), dict(against))


def without_goal(what: str, value: float, unit: str, **against: float | str) -> Row:
    """Return a row that has nothing to reach; NaN, which was not measured, does not hold."""
    return Row(what, float(value), unit, "none", not math.isnan(value), dict(against))


@dataclass(frozen=True)
class Measured:
    """What a bench returns: its rows, and details that are written to report.json beside them."""

    rows: list[Row]
    details: dict[str, Any] = field(default_factory=dict)


Bench = Callable[[int, bool, Path], Measured]
"""A bench is a function of the seed, whether to be quick, and a folder for what it makes."""


def report(name: str, seed: int, bench: Bench, quick: bool, out: Path) -> dict[str, Any]:
    """Run a bench, write `report.json` into `out` and return what the last line says."""
    output_folder(out)
    started = time.perf_counter()
    measured = bench(seed, quick, out)
    summary = {
        "name": name,
        "seed": seed,
        "seconds": round(time.perf_counter() - started, 2),
        "rows": [asdict(row) for row in measured.rows],
    }
    write_json(out / "report.json", {**summary, "quick": quick, "details": measured.details})
    return without_nan(summary)


def last_line(summary: dict[str, Any]) -> str:
    """Return a report as one line of strict JSON."""
    return json.dumps(summary, allow_nan=False)
