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
Mapping = Annotated[
    Path | None, typer.Option("--map", help="Which topic or column plays which role in a foreign file.")
]
Domain = Annotated[int | None, typer.Option(min=0, max=101, help="ROS_DOMAIN_ID; by default the environment's own.")]
Namespace = Annotated[
    str, typer.Option(help="Of the robot, such as robot_1: several can share a domain. Default: none, the root.")
]
Many = {"allow_extra_args": True, "ignore_unknown_options": True}
