"""Runs on the simulated desk from random starts: taught once, then seen by a camera, pushed, looked at again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pbrl_bringup.experiments.tabletop_figure import draw_run
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.tabletop.desk_run import DeskRun, random_layout
from pbrl_bringup.tabletop.models import Taught, desk_scene, objective_file, taught
from pbrl_bringup.tabletop.pictures import Pictures
from pbrl_bringup.tabletop.tidy import Outcome, tidied
from pbrl_control.planar import Array
from pbrl_planner.tabletop import Desk, Objective, Tidying, TidyingSettings

TIGHTER = 0.01
"""By which a run aims better than its limit: the camera is not the truth."""


@dataclass(frozen=True)
class Executed:
    """One run, and where everything truly was in the end.

    Attributes:
        outcome: in numbers.
        last: (n, 3) layout.
        obstacles_moved: most that one of them moved [m].
        taught: pushes that taught what was known at the start.
    """

    outcome: Outcome
    last: list[list[float]]
    obstacles_moved: float
    taught: int


def executed(
    name: str,
    objective: str,
    seed: int,
    out: Path,
    starts: int,
    limit: float,
    place: str = "anywhere",
    forward: str = "tables",
) -> list[Executed]:
    """Teach, then tidy from random starts; the first run is drawn into `out`.

    Args:
        name: of the desk.
        objective: its name.
        seed: of everything.
        out: folder of the figures.
        starts: how many.
        limit: cost at which the objective counts as reached.
        place: where items start: "anywhere", or "right", on the right third of the table.
        forward: which forward model, of `FORWARD_MODELS`.
    """
    known = taught(desk_scene(name, "rendered"), seed, forward)
    jobs = [(name, objective, known, seed, number, limit, place, str(out)) for number in range(starts)]
    return in_parallel(trial, jobs, "runs")


def trial(
    name: str,
    objective: str,
    known: Taught,
    seed: int,
    number: int,
    limit: float,
    place: str,
    out: str,
) -> Executed:
    """Tidy from one start; see `executed`."""
    with DeskRun(desk_scene(name, "rendered"), seed=seed + number) as run:
        run.place(_start(run.desk, np.random.default_rng([seed, number]), place))
        own = Objective.from_file(run.desk, objective_file(objective))
        settings = TidyingSettings(enough=limit - TIGHTER)
        model = known.model(run.desk.effector, seed)
        task = Tidying(own, model, seed=seed + 1000 * number + 1, settings=settings)
        before = _obstacles(run)
        pictures = Pictures(run.session) if number == 0 else None
        outcome, layouts = tidied(run, task, pictures.take if pictures is not None else None)
        if pictures is not None:
            draw_run(run.desk, layouts, pictures, outcome, Path(out))
        moved = np.hypot(*(_obstacles(run) - before)[:, :2].T) if len(before) else np.zeros(1)
        return Executed(outcome, layouts[-1].tolist(), float(moved.max()), known.pushes)


def details_of(found: Sequence[Executed]) -> dict[str, object]:
    """Return the runs as plain data."""
    return {"runs": [asdict(each) for each in found]}


def _start(desk: Desk, rng: np.random.Generator, place: str) -> Array:
    """Draw a layout (n, 3)."""
    while True:
        layout = random_layout(desk, rng)
        if place == "anywhere" or (layout[:, 0] > desk.table.high[0] / 3.0).all():
            return layout


def _obstacles(run: DeskRun) -> Array:
    """Return where the obstacles truly are (o, 3)."""
    return np.array([run.session.world.pose(item.name) for item, _ in run.desk.obstacles]).reshape(-1, 3)
