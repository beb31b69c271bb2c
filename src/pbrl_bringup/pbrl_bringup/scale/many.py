"""Many recordings: each is a piece of work with a folder of its own; at the end a summary of all."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pbrl_bringup.cli.errors import told_of
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import output_folder, result_folder, write_json, write_text
from pbrl_bringup.scale.cluster import cluster
from pbrl_bringup.scale.pieces import Failed, run_pieces
from pbrl_bringup.scale.recordings import folder_names
from pbrl_bringup.terminal import output, progress, say, styled, table

Row = dict[str, str | float | bool | None]
"""What is said of one object in a summary, by column."""
Work = Callable[[Path, Path, Any], list[Row]]
"""What is done with one recording: bag, folder for its results, what was asked; a row for each object."""

SHOWN = 40
"""Rows at most that the terminal shows; the files have all."""
SUMMARY, REPORT = "summary.csv", "report.json"


@dataclass(frozen=True)
class Recorded:
    """What became of one recording.

    Attributes:
        recording: its path.
        folder: of its results, below that of all.
        failed: why there are none, in a line; empty: there are.
        rows: what was found, by object.
    """

    recording: str
    folder: str
    failed: str
    rows: list[Row]


def run_many(
    work: Work, bags: Sequence[Path], asked: Any, out: Path, scheduler: str, shown: Mapping[str, str], what: str
) -> int:
    """Do the same with many recordings on a cluster, and write a summary.

    A recording that fails costs itself only; `report.json` and `summary.csv` say why.

    Args:
        work: what is done with each, a function of a module; it runs in a worker.
        bags: the recordings.
        asked: what was asked for, of all alike; picklable and small.
        out: folder; each recording's results go into one below it.
        scheduler: as `--scheduler` has it.
        shown: columns of the rows that the terminal shows, and their headings.
        what: that is done, for the headings.

    Raises:
        BringupError: the results cannot be written, there is no such cluster, or recordings failed.
    """
    started, names = time.perf_counter(), folder_names(bags)
    with result_folder(out), cluster(scheduler) as client:
        # Paths are the same for workers that were started elsewhere.
        place = out.absolute()
        say(f"pbrl: {what}: {len(bags)} recordings with {len(client.nthreads())} workers, results in {out}")
        found: dict[int, Recorded] = {}
        jobs: Iterator[tuple[Any, ...]] = (
            (work, bag.absolute(), place / name, asked) for bag, name in zip(bags, names, strict=True)
        )
        with progress("recordings", len(bags)) as bar, closing(run_pieces(client, do_one, jobs)) as ended:
            for each in ended:
                rows, failed = ([], told_of(each.error)) if isinstance(each, Failed) else each.result
                found[each.index] = Recorded(str(bags[each.index]), names[each.index], failed, rows)
                bar(len(found))
        ordered = [found[index] for index in range(len(bags))]
        write_summary(ordered, time.perf_counter() - started, out)
    print_summary(ordered, shown, what)
    output().print(styled(str(out / SUMMARY), "bold"))
    failures = [each for each in ordered if each.failed]
    if failures:
        raise BringupError(
            f"{len(failures)} of {len(bags)} recordings failed, first {failures[0].recording}: {failures[0].failed}; "
            f"{out / SUMMARY} says why each did"
        )
    return 0


def do_one(work: Work, bag: Path, folder: Path, asked: Any) -> tuple[list[Row], str]:
    """Do the work of one recording in a worker; an error is a line."""
    for path in folder.glob(".*.part"):  # of a worker that was killed
        path.unlink(missing_ok=True)
    try:
        with result_folder(folder):
            return work(bag, folder, asked), ""
    except Exception as error:
        return [], told_of(error)


def write_summary(recorded: Sequence[Recorded], seconds: float, out: Path) -> None:
    """Write `report.json` and `summary.csv`, a line for each object of each recording or for its failure."""
    output_folder(out)
    write_json(out / REPORT, {"recordings": [asdict(each) for each in recorded], "seconds": seconds})
    rows = [
        {"recording": each.recording, "folder": each.folder, **row, "failed": each.failed}
        for each in recorded
        for row in each.rows or [{}]
    ]
    columns = list(dict.fromkeys(name for row in rows for name in row if name != "failed"))
    text = io.StringIO()
    writer = csv.DictWriter(text, [*columns, "failed"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(out / SUMMARY, text.getvalue())


def print_summary(recorded: Sequence[Recorded], shown: Mapping[str, str], what: str) -> None:
    """Print some columns of the first rows."""
    lines = [
        (each.recording, *(["–"] * len(shown) if each.failed else [_text(row.get(name)) for name in shown]))
        for each in recorded
        for row in each.rows or [{}]
    ]
    right = tuple(range(2, len(shown) + 1))
    output().print(table(what, ("recording", *shown.values()), lines[:SHOWN], right=right))
    if len(lines) > SHOWN:
        output().print(f"and {len(lines) - SHOWN} more")


def _text(value: str | float | bool | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
