"""What benches and experiments share: find by name, measure, print a table and, as the last line, the report."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.text import Text

from pbrl_bringup.benches.carried import carry_in, carry_out
from pbrl_bringup.benches.rows import last_line, report
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import output_folder
from pbrl_bringup.terminal import output, say, styled, table


def run_measured(
    kind: str,
    known: Mapping[str, str],
    name: str,
    out: Path | None,
    seed: int,
    quick: bool,
    more: Mapping[str, Any] | None = None,
    scheduler: str | None = None,
    carry: Path | None = None,
) -> int:
    """Run the module `pbrl_bringup.<kind>s.<name>`.

    Args:
        kind: "bench" or "experiment".
        known: what there is of that kind, and a sentence on each.
        name: which to run.
        out: folder of the report; None: out/<kind>/<name>.
        seed: of every random draw.
        quick: whether to do a smaller version.
        more: what only this one can be asked, by name.
        scheduler: where its independent parts are done, as `--scheduler` has it; None: in processes of this machine.
        carry: file of cases that are done, to which those done now are added; of modules that have `CARRIED`.

    Raises:
        BringupError: there is none of that name, no such scheduler, or the file carries something else.
    """
    if name not in known:
        near = difflib.get_close_matches(name, known, 1)
        advice = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
        raise BringupError(f"{kind} {name!r} is not known; {advice}")
    folder = out or Path("out") / kind / name
    if scheduler is not None:
        folder = folder.absolute()  # workers elsewhere have another working directory
    output_folder(folder)
    say(f"pbrl: {kind} {name}: {known[name]}; seed {seed}, results in {folder}")
    module = import_module(f"pbrl_bringup.{PACKAGES[kind]}.{name.replace('-', '_')}")
    told = {"name": name, "seed": seed}
    if carry is not None:
        say(f"pbrl: {carry_in(carry, folder, told, module.CARRIED)} files of cases that were done, from {carry}")
    try:
        with _sent(scheduler):
            summary = report(name, seed, partial(module.measure, **(more or {})), quick, folder)
    finally:  # also what a bench that was interrupted has done
        if carry is not None:
            carry_out(carry, folder, told, module.CARRIED)
    rows = [
        (row["what"], _value(row["value"]), row["unit"], row["goal"], _mark(row["holds"])) for row in summary["rows"]
    ]
    output().print(table(f"{kind} {name}", ("what", "value", "unit", "goal", "holds"), rows, right=(1,)))
    print(last_line(summary))
    return 0


def _sent(scheduler: str | None) -> AbstractContextManager[object]:
    """Have independent parts done on a cluster inside the block, where one is named."""
    # Dask is slow to load, and only this needs it.
    return nullcontext() if scheduler is None else import_module("pbrl_bringup.scale.sending").sent(scheduler)


PACKAGES = {"bench": "benches", "experiment": "experiments"}


def _value(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if value == int(value) else f"{value:.4g}"


def _mark(holds: bool) -> Text:
    return styled("yes", "green") if holds else styled("no", "red")
