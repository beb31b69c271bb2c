"""Thesis figures 36 to 38 and section 6.3.1: the same path of an object with and without what the body Jacobian knows.

Two objects in Bullet, both arms on each. A cart whose right wheels do not swivel is to go straight ahead, across them
(figure 36). A table whose casters swivel is carried 2 m aslant of a base that cannot go sideways (figures 37, 38).

    unknown     constraint not known, everything else as ours
    unsteered   constraint known, the thesis's body Jacobian without steering (42 to 44)
    waypoint    constraint known, the same with the thesis's steering (45, 46)
    ours        constraint known, the whole-body program with steering that looks ahead
    program     as ours without that steering

The stops for unexpected force are taken off, to show how far forces go; where they would have ended it is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bullet_sim.scene import load_scene
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.body_jacobian_figure import draw
from pbrl_bringup.experiments.body_jacobian_scenes import believed_free, told
from pbrl_bringup.experiments.body_jacobian_trials import UNSTOPPED, Held, Job, largest, least, run
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.paths import config_file
from pbrl_control.constraints.classes import Freedom
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan

WAYS = {
    "unknown": ("program", "predictive"),
    "unsteered": ("pseudo-inverse", "none"),
    "waypoint": ("pseudo-inverse", "waypoint"),
    "program": ("program", "none"),
    "ours": ("program", "predictive"),
}
"""Method and steering of each."""
QUICK = {"cart": ("unknown", "ours"), "table": ("unsteered", "ours")}
QUICK_SHARE = 0.4
END, MARGIN, MANY = 0.03, 0.05, 3.0
"""Of a path's end [m], of grippers in their workspace [m], of a force to the expected one."""


@dataclass(frozen=True)
class Subject:
    """One object and the path that is wanted of it.

    Attributes:
        name: as people say it.
        scene: of the simulator.
        object: its name there.
        grips: points on its edge, left and right gripper [m].
        below: middle of that edge below the top [m].
        way: last pose in the object's first one: x, y [m], theta [rad].
    """

    name: str
    scene: str
    object: str
    grips: tuple[tuple[float, float], tuple[float, float]]
    below: float
    way: tuple[float, float, float]


CART = Subject("cart", "utility_cart", "cart_a", ((-0.15, -0.30), (0.15, -0.30)), 0.016, (0.0, 0.40, 0.0))
TABLE = Subject("table", "free_table", "table_a", ((-0.375, 0.16), (-0.375, -0.16)), 0.0125, (1.80, 0.80, 0.0))
SUBJECTS = (CART, TABLE)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Move both objects in each way, in parallel processes; draw them side by side."""
    chosen = [(subject, way) for subject in SUBJECTS for way in (QUICK[subject.name] if quick else WAYS)]
    longest_first = sorted(chosen, key=lambda each: each[0].name != TABLE.name)
    done = in_parallel(run, [(job_of(subject, way, seed, quick),) for subject, way in longest_first], "ways")
    held = {(subject.name, way): each for (subject, way), each in zip(longest_first, done, strict=True)}
    draw(held, out)
    return Measured(rows_of(held), {"ways": [_told(*key, held[key]) for key in held]})


def job_of(subject: Subject, way: str, seed: int, quick: bool) -> Job:
    """Return a trial; a quick one goes part of the way."""
    share = QUICK_SHARE if quick else 1.0
    grips = [{"gripper": side, "point": point} for side, point in zip(("left", "right"), subject.grips, strict=True)]
    plan = TrajectoryPlan.model_validate(
        {
            "name": f"{subject.name} {way}",
            "object": subject.object,
            "grips": grips,
            "approach": {"edge_below_top": subject.below},
            "waypoints": [[share * part for part in subject.way]],
            "abort": UNSTOPPED,
            "limits": {"force": UNSTOPPED["force"]},
        }
    )
    model = told(load_scene(config_file("scenes", subject.scene)), subject.object)
    method, steering = WAYS[way]
    return Job(way, subject.scene, plan, _unlearned(model) if way == "unknown" else model, method, steering, seed)


def _unlearned(model: ObjectModel) -> ObjectModel | None:
    """Return what is believed where the constraint is not known: a free object, and of a free object nothing."""
    return believed_free(model) if Freedom.of(model).rows.size else None


def rows_of(held: dict[tuple[str, str], Held]) -> list[Row]:
    """Return the rows, the thesis's claim beside ours."""
    unknown, cart = held["cart", "unknown"], held["cart", "ours"]
    unsteered, table = held["table", "unsteered"], held["table", "ours"]
    return [
        at_least(
            "cart, constraint not known: largest grip force over what it takes where it is known",
            largest(unknown) / largest(cart),
            "1",
            MANY,
            unknown_N=largest(unknown),
            known_N=largest(cart),
            would_have_stopped_s=unknown.stopped,
            thesis="figure 36b: large gripper forces, no number",
        ),
        at_most("cart, both: largest grip force", largest(cart), "N", cart.limit, expected_N=cart.peak),
        at_most(
            "cart, both: end from where it was foreseen",
            ending(cart)[0],
            "m",
            END,
            turned_deg=math.degrees(ending(cart)[1]),
            unknown_m=ending(unknown)[0],
            thesis="relying on compliance, one finds out when it is executed",
            **_beside(held, "cart", lambda each: ending(each)[0]),
        ),
        at_least("cart, both: least workspace margin", least(cart), "m", MARGIN, **_beside(held, "cart", least)),
        at_most(
            "table, without steering (42 to 44): least workspace margin",
            least(unsteered),
            "m",
            0.0,
            thesis="figures 37a, 38a: drifts out of the reachable workspace, infeasible",
        ),
        at_least(
            "table, both: least workspace margin",
            least(table),
            "m",
            MARGIN,
            thesis="figures 37b, 38b: remains in the middle of its workspace, no number",
            **_beside(held, "table", least),
        ),
        at_most(
            "table, both: end from where it was wanted",
            ending(table)[0],
            "m",
            END,
            turned_deg=math.degrees(ending(table)[1]),
            **_beside(held, "table", lambda each: ending(each)[0]),
        ),
        at_most(
            "table, both: largest grip force",
            largest(table),
            "N",
            table.limit,
            expected_N=table.peak,
            **_beside(held, "table", largest),
        ),
    ]


def ending(held: Held) -> tuple[float, float]:
    """Return how far from where it was foreseen the object ended [m, rad]."""
    return held.off(held.path[-1]) if len(held.path) else (math.nan, math.nan)


def _beside(held: dict[tuple[str, str], Held], name: str, number: Callable[[Held], float]) -> dict[str, float | str]:
    """Return a number of the other ways with the same object."""
    return {way: number(each) for (subject, way), each in held.items() if subject == name and way != "ours"}


def _told(subject: str, way: str, held: Held) -> dict[str, Any]:
    """Return the numbers of one trial, for the report."""
    distance, turned = ending(held)
    away, aside = held.off(held.wanted)
    return {
        "object": subject,
        "way": way,
        "phase": held.phase,
        "status": held.status,
        "seconds": float(held.time[-1]) if len(held.time) else 0.0,
        "progress": held.progress,
        "force_N": largest(held),
        "expected_N": held.peak,
        "force_limit_N": held.limit,
        "would_have_stopped_s": held.stopped,
        "margin_m": least(held),
        "from_foreseen_m": distance,
        "from_foreseen_rad": turned,
        "from_wanted_m": away,
        "from_wanted_rad": aside,
    }
