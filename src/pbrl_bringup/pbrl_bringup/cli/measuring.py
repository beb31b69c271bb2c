"""The commands that measure, benches and the experiments of the thesis, and the cluster that they can use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbrl_bringup.cli.handing import hand_over
from pbrl_bringup.cli.options import Quick, Scheduler, Seed
from pbrl_bringup.measurable import BENCHES, EXPERIMENTS


def bench(
    name: Annotated[
        str,
        typer.Argument(help=f"One of {', '.join(BENCHES)}."),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for report.json. Default: out/bench/NAME.")] = None,
    seed: Seed = 0,
    quick: Quick = False,
    sets: Annotated[
        str | None,
        typer.Option(
            help="Sets of cases of the bench concealed, with commas: clean, single, pairs, withheld, furnished, rough. "
            "Of the bench fuzz: names of readers and nodes. Default: all."
        ),
    ] = None,
    most: Annotated[
        int | None,
        typer.Option(
            min=1, help="Recordings an effect at most, and ten times clean ones; hostile inputs; nodes struck."
        ),
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.0, help="After which no case is begun; what there is is reported.")
    ] = None,
    carry: Annotated[
        Path | None,
        typer.Option(help="A file of cases that are done: they are not done again, and those done now are added."),
    ] = None,
    scheduler: Scheduler = None,
) -> int:
    """Measure one group of acceptance rows; the last line is the report as JSON."""
    wanted = [each.strip() for each in sets.split(",")] if sets is not None else []
    asked = {"sets": wanted, "most": most, "minutes": minutes, "carry": carry, "scheduler": scheduler}
    return hand_over("bench", name=name, out=out, seed=seed, quick=quick, **asked)


def experiment(
    name: Annotated[
        str,
        typer.Argument(help=f"One of {', '.join(EXPERIMENTS)}."),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for report.json. Default: out/experiment/NAME.")] = None,
    seed: Seed = 0,
    quick: Quick = False,
    scheduler: Scheduler = None,
) -> int:
    """Repeat an experiment of the thesis; figure.png in the folder, the last line is the report as JSON."""
    return hand_over("experiment", name=name, out=out, seed=seed, quick=quick, scheduler=scheduler)


def cluster(
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes of one thread each. Default: one for each core.")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address of this machine that the scheduler listens on; beware of open networks.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the scheduler; 0: any.")] = 8786,
    join: Annotated[
        str | None, typer.Option(help="No scheduler, but workers for one that runs: tcp://HOST:PORT.")
    ] = None,
) -> int:
    """Keep a scheduler and workers for --scheduler of other commands, or add this machine's workers to one."""
    return hand_over("cluster", workers=workers, host=host, port=port, join=join)
