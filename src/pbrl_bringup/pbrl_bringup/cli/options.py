"""Options that several commands have, and the choices that there are."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Likelihood(StrEnum):
    """Windowed multiple shooting, or one of its limits in the thesis: (25) and (39)."""

    WINDOWED = "windowed"
    ONE_STEP = "one_step"
    INTEGRATED = "integrated"


class Sampler(StrEnum):
    """Samplers of `fit`."""

    IMPORTANCE = "importance"
    METROPOLIS = "metropolis"


class Engine(StrEnum):
    """Engines of `fit`."""

    KERNEL = "kernel"
    PYMUNK = "pymunk"


class Form(StrEnum):
    """Forms of `export`."""

    URDF = "urdf"
    SDF = "sdf"
    JSON = "json"
    NETCDF = "netcdf"


Seed = Annotated[int, typer.Option(min=0, help="Seed of every random draw; the same seed gives the same result.")]
Out = Annotated[Path, typer.Option(help="Folder for the results.")]
Bag = Annotated[Path, typer.Argument(help="Bag folder, .mcap, .db3 or .bag file, or .csv with --map.")]
Bags = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="BAG",
        help="Bag folder, .mcap, .db3 or .bag file, or .csv with --map. Several, a folder with bags below it or a "
        "pattern: one folder of results each, and a summary.",
    ),
]
Listed = Annotated[Path | None, typer.Option("--list", help="Text file with a bag on each line, beside or instead.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Where the work is shared out (docs/scale.md): local, local:WORKERS, or a Dask scheduler of your own, "
        "tcp://HOST:PORT. Results do not depend on it. Default: this machine's cores."
    ),
]
Mapping = Annotated[
    Path | None, typer.Option("--map", help="Which topic or column plays which role in a foreign file.")
]
Domain = Annotated[int | None, typer.Option(min=0, max=101, help="ROS_DOMAIN_ID; by default the environment's own.")]
Models = Annotated[
    list[Path] | None,
    typer.Option(help="Learned model to draw: posterior_NAME.nc of fit or model_NAME.json of diagnose; repeatable."),
]
Diagnosis = Annotated[
    Path | None, typer.Option(help="report.json of diagnose: what was left out, where, and the missing force.")
]
Port = Annotated[int | None, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0: any. Default: 8765, or any.")]
Opened = Annotated[
    bool | None, typer.Option("--open/--no-open", help="Open a browser. Default: where there is a display.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A smaller version that still measures, under a minute.")]
Draws = Annotated[
    int | None,
    typer.Option(min=10, help="Posterior draws to keep from each of 4 chains, or a quarter of all. Default: 500."),
]
Namespace = Annotated[
    str, typer.Option(help="Of the robot, such as robot_1: several can share a domain. Default: none, the root.")
]
Many = {"allow_extra_args": True, "ignore_unknown_options": True}
