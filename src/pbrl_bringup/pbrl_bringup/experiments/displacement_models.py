"""Figure 2: what six pushes do to an eraser, a remote and a scale, learned; and what the model says of 200 more pushes.

Beside the thesis's tables of displacements, the world model (`PhysicsDisplacements`) is given the same pushes, and the
first few of them alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.displacement_figure import draw
from pbrl_bringup.tabletop.desk_run import DeskRun
from pbrl_bringup.tabletop.models import TRAVELS, desk_scene
from pbrl_bringup.tabletop.teaching import Seen, teach
from pbrl_bringup.terminal import progress
from pbrl_control.planar import Array
from pbrl_planner.tabletop import LearnedDisplacements, Lessons, LessonSettings, PhysicsDisplacements, Push, pushes_of

OBSERVED, QUICK_OBSERVED = 200, 40
SHARE = 0.95
LOW, HIGH = 0.90, 0.98
FEW = 6
"""Pushes of an item after which the world model is asked, too."""


@dataclass(frozen=True)
class Compared:
    """One push that came after teaching.

    Attributes:
        item: name.
        primitive: of the push.
        travel: of the push [m].
        moved: (3,) displacement that was seen.
        learned: (3,) mean of the table.
        inside: (3,) whether each coordinate is in the table's 95 % interval.
        physics: (3,) mean of the world model that was given as many pushes.
        physics_few: (3,) of one that was given `FEW` an item.
    """

    item: str
    primitive: str
    travel: float
    moved: tuple[float, ...]
    learned: tuple[float, ...]
    inside: tuple[bool, ...]
    physics: tuple[float, ...]
    physics_few: tuple[float, ...]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Teach the desk's items, seen by the camera, and compare 200 more pushes with what is then believed."""
    pushes = pushes_of(TRAVELS[:1] if quick else TRAVELS)
    with DeskRun(desk_scene("desk", "rendered"), seed=seed) as run, progress("pushes that teach") as bar:
        model, seen = teach(run, pushes, told=bar)
        more = observed(run, model, pushes, QUICK_OBSERVED if quick else OBSERVED)
        items = {item.name: item for item in run.desk.items}
        effector = run.desk.effector
    whole, few = PhysicsDisplacements(effector, seed=seed), PhysicsDisplacements(effector, seed=seed)
    for name, push, moved in seen:
        whole.update(name, push, moved)
        if few.count(name) < FEW:
            few.update(name, push, moved)
    predicted = {
        name: (whole.displacements(item, pushes).mean, few.displacements(item, pushes).mean)
        for name, item in items.items()
    }
    found = [_compared(each, model, pushes.index(each[1]), predicted[each[0]]) for each in more]
    draw(model, [item.name for item in items.values()], out)
    details = {
        "models": model.as_dict(),
        "pushes": [vars(each) for each in found],
        "taught": len(seen),
    }
    return Measured(rows_of(found, len(seen)), details)


def observed(run: DeskRun, model: LearnedDisplacements, pushes: tuple[Push, ...], count: int) -> list[Seen]:
    """Push on, each push of each item in turn where there is room, without learning from it."""
    # Lessons that are never over: they know where there is room, and what was pushed least.
    lessons = Lessons(run.desk, pushes, LessonSettings(least=count, most=count))
    for name, push, each in model.known():
        lessons.expect(name, push, each.mean)
    found: list[Seen] = []
    poses = run.look()
    with progress("pushes that are compared", count) as bar:
        while len(found) < count:
            layout = run.layout(poses)
            asked = lessons.next(layout)
            assert asked is not None, "an item can always be pushed back to where it came from"
            k, push = asked
            run.push_item(k, push, layout[k])
            poses = run.look()
            moved = lessons.learned(k, push, layout[k], poses[run.desk.names[k]])
            found.append((run.desk.names[k], push, moved))
            bar(len(found))
    return found


def rows_of(found: Sequence[Compared], taught: int) -> list[Row]:
    """Return the acceptance rows."""
    inside = float(np.mean([each.inside for each in found]))
    errors = {name: _error(found, name) for name in ("learned", "physics", "physics_few")}
    per_axis = np.mean([each.inside for each in found], axis=0)
    return [
        at_least(
            f"coordinates within the 95 % interval, of {len(found)} pushes",
            inside,
            "1",
            LOW,
            along=per_axis[0],
            across=per_axis[1],
            angle=per_axis[2],
        ),
        at_most("the same, from above", inside, "1", HIGH),
        at_most(
            f"error of the world model after {FEW} pushes an item, root mean square, over the tables'",
            errors["physics_few"][0] / errors["learned"][0],
            "1",
            1.5,
            tables_mm=1e3 * errors["learned"][0],
            few_mm=1e3 * errors["physics_few"][0],
            whole_mm=1e3 * errors["physics"][0],
            taught=taught,
        ),
        at_most(
            "the same of angles",
            errors["physics_few"][1] / errors["learned"][1],
            "1",
            1.5,
            tables_deg=math.degrees(errors["learned"][1]),
            few_deg=math.degrees(errors["physics_few"][1]),
            whole_deg=math.degrees(errors["physics"][1]),
        ),
    ]


def _compared(seen: Seen, model: LearnedDisplacements, number: int, physics: tuple[Array, Array]) -> Compared:
    name, push, moved = seen
    known = model.of(name, push)
    low, high = model.interval(name, push, SHARE)
    inside = (low <= moved) & (moved <= high)
    return Compared(
        name,
        push.primitive,
        push.travel,
        tuple(moved.tolist()),
        tuple(known.mean.tolist()),
        tuple(bool(each) for each in inside),
        tuple(physics[0][number].tolist()),
        tuple(physics[1][number].tolist()),
    )


def _error(found: Sequence[Compared], name: str) -> tuple[float, float]:
    """Return the root mean square error of a model: of the place [m] and of the angle [rad]."""
    off = np.array([np.subtract(getattr(each, name), each.moved) for each in found])
    return float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())), float(np.sqrt((off[:, 2] ** 2).mean()))
