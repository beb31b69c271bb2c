"""`./pbrl bench NAME`: measure, print a table and, as the last line, the report."""

from __future__ import annotations

import difflib
from importlib import import_module
from pathlib import Path

from pbrl_bringup.benches.rows import last_line, report
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import output_folder
from pbrl_bringup.terminal import output, say, table

BENCHES = {
    "sim": "a pushed table against a hand calculation, kinematics, speed",
    "wheel": "the wheel of tables with a locked caster, and held-out prediction",
    "cabinet": "the hinge of a real cabinet pulled by a real PR2",
    "recorder": "a recorder killed in mid-run",
    "mcap": "recordings read by two independent readers",
}


def command(name: str, out: Path | None, seed: int, quick: bool) -> int:
    """Run one bench.

    Raises:
        BringupError: there is none of that name.
    """
    if name not in BENCHES:
        near = difflib.get_close_matches(name, BENCHES, 1)
        advice = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(BENCHES)}"
        raise BringupError(f"bench {name!r} is not known; {advice}")
    folder = out or Path("out/bench") / name
    output_folder(folder)
    say(f"pbrl: bench {name}: {BENCHES[name]}; seed {seed}, results in {folder}")
    module = import_module(f"pbrl_bringup.benches.{name}")
    summary = report(name, seed, module.measure, quick, folder)
    rows = [
        (
            row["what"],
            _value(row["value"]),
            row["unit"],
            row["goal"],
            _mark(row["holds"]),
        )
        for row in summary["rows"]
    ]
    output().print(table(f"bench {name}", ("what", "value", "unit", "goal", "holds"), rows, right=(1,)))
    print(last_line(summary))
    return 0


def _value(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if value == int(value) else f"{value:.4g}"


def _mark(holds: bool) -> str:
    return "[green]yes[/]" if holds else "[red]no[/]"
