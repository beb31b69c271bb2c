"""Thesis chapter 4 and section 6.3: a grasped object is turned about points that are chosen freely.

Krang holds a table with both arms and turns it by 20 degrees to each side about points of the table and in front of
it, in Bullet, with a base that cannot go sideways; and a table with a locked caster about that caster. From the true
poses comes the point about which it turned. How far turns can go is found without physics, with the base and without.

The stops for unexpected force are taken off, to show how far turns go; which turns they would have ended is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bullet_sim.scene import load_scene
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.benches.wheel import locked_contacts
from pbrl_bringup.experiments.articulation_figure import draw
from pbrl_bringup.experiments.articulation_reach import RATE, SPEED, centre_of_rotation, reach, turn_about
from pbrl_bringup.experiments.body_jacobian_scenes import told
from pbrl_bringup.experiments.body_jacobian_trials import UNSTOPPED, Held, Job, largest, least, run
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.paths import config_file
from pbrl_control.planar import compose
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan

Array = NDArray[np.float64]

TABLE = "table_a"
GRIPS = ((-0.375, 0.28), (-0.375, -0.28))
"""Where left and right gripper hold the table, in its frame [m]: apart, for casters that swing round resist a turn."""
ANGLES = (5.0, 10.0, 15.0, 20.0)
"""At which the centre is looked for; the last one is asked for [deg]."""
QUICK_ANGLE = 15.0
NEAR, ENOUGH, MARGIN, RATIO = 0.03, 0.95, 0.05, 1.5
"""Of a centre [m], of the asked angle, of grippers in their workspace [m], of a force to the expected one."""


@dataclass(frozen=True)
class Pivot:
    """A point that something is to turn about.

    Attributes:
        name: as people say it.
        point: in the table's frame [m].
        scene: of the simulator.
    """

    name: str
    point: tuple[float, float]
    scene: str = "free_table"


PIVOTS = (
    Pivot("its middle", (0.0, 0.0)),
    Pivot("a near corner", (-0.375, -0.75)),
    Pivot("a far corner", (0.375, 0.75)),
    Pivot("the point between its grips", (-0.375, 0.0)),
    Pivot("a point before the base", (-0.675, 0.0)),
    Pivot("its locked caster", (-0.315, -0.69), "locked_caster"),
)
QUICK = (PIVOTS[3], PIVOTS[5])
SIGNS = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True)
class Turned:
    """What became of one turn.

    Attributes:
        pivot: that was chosen.
        way: "left" or "right".
        held: what was kept.
        asked: angle [rad], not negative.
        angle: that was reached [rad].
        centres: (a, 2) found in the table's frame from the start to each of `ANGLES` [m]; NaN where it was not reached.
        wander: farthest that the chosen point got from its place [m].
        driven: way of the base [m].
        spun: what it turned in all, to and fro [rad].
    """

    pivot: Pivot
    way: str
    held: Held
    asked: float
    angle: float
    centres: Array
    wander: float
    driven: float
    spun: float

    @property
    def off(self) -> Array:
        """Distance (a,) of each centre from the chosen point [m]."""
        return np.hypot(*(self.centres - np.array(self.pivot.point)).T)

    @property
    def last_off(self) -> float:
        """That of the largest angle that was reached [m]; NaN where none was."""
        return float(np.hypot(*(self.last - np.array(self.pivot.point))))

    @property
    def last(self) -> Array:
        """Centre (2,) of the largest angle that was reached [m]; NaN where none was."""
        known = self.centres[np.isfinite(self.centres).all(axis=1)]
        return known[-1] if len(known) else np.full(2, math.nan)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Turn tables about each point, both ways, in parallel processes; draw them."""
    pivots = QUICK if quick else PIVOTS
    asked = math.radians(QUICK_ANGLE if quick else ANGLES[-1])
    ways = [(pivot, way) for pivot in pivots for way in (("right",) if quick else SIGNS)]
    done = in_parallel(run, [(job_of(pivot, way, asked, seed),) for pivot, way in ways], "turns")
    turned = [turned_of(pivot, way, asked, held) for (pivot, way), held in zip(ways, done, strict=True)]
    arguments = [(pivot.point, SIGNS[way], driving) for pivot, way in ways for driving in (False, True)]
    angles = in_parallel(reach_of, arguments, "reaches")
    reaches = {(pivot.name, way): (angles[2 * k], angles[2 * k + 1]) for k, (pivot, way) in enumerate(ways)}
    draw(turned, reaches, ANGLES, out)
    details = {"turns": [_told(each) for each in turned], "reach_deg": _degrees(reaches)}
    return Measured(rows_of(turned, reaches), details)


def reach_of(point: tuple[float, float], sign: float, driving: bool) -> float:
    """Return how far something turns about a point before the workspace ends [rad]; see `reach`."""
    return reach(point, sign, np.array(GRIPS), driving=driving)


def job_of(pivot: Pivot, way: str, angle: float, seed: int) -> Job:
    """Return a trial: one turn by an angle [rad]."""
    twist = turn_about(np.array(pivot.point), SIGNS[way] * RATE)
    grips = [{"gripper": side, "point": point} for side, point in zip(("left", "right"), GRIPS, strict=True)]
    plan = TrajectoryPlan.model_validate(
        {
            "name": f"{pivot.name} {way}",
            "object": TABLE,
            "grips": grips,
            "segments": [{"twist": twist.tolist(), "duration": angle / abs(float(twist[2]))}],
            "motion": {"speed": SPEED, "yaw_rate": RATE},
            "abort": UNSTOPPED,
            "limits": {"force": UNSTOPPED["force"]},
        }
    )
    return Job(way, pivot.scene, plan, told(load_scene(config_file("scenes", pivot.scene)), TABLE), seed=seed)


def turned_of(pivot: Pivot, way: str, asked: float, held: Held) -> Turned:
    """Score a turn against the truth."""
    if len(held.time) < 2:
        return Turned(pivot, way, held, asked, 0.0, np.full((len(ANGLES), 2), math.nan), math.nan, math.nan, math.nan)
    angle = SIGNS[way] * (np.unwrap(held.object[:, 2]) - held.object[0, 2])
    points = np.array([compose(pose, np.array([*pivot.point, 0.0]))[:2] for pose in held.object])
    return Turned(
        pivot,
        way,
        held,
        asked,
        float(angle[-1]),
        np.array([centre_up_to(held.object, angle, math.radians(each), asked) for each in ANGLES]),
        float(np.hypot(*(points - points[0]).T).max()),
        float(np.hypot(*np.diff(held.base[:, :2], axis=0).T).sum()),
        float(np.abs(np.diff(np.unwrap(held.base[:, 2]))).sum()),
    )


def centre_up_to(poses: Array, angle: Array, least: float, asked: float) -> Array:
    """Return the centre (2,) in the body's frame of the turn from the start to an angle [m]; NaN: not reached.

    Args:
        poses: (n, 3) [m, rad].
        angle: (n,) turned by then, the asked way [rad].
        least: to be reached [rad]; of the asked angle, `ENOUGH` of it.
        asked: angle [rad].
    """
    if least > asked + 1e-9:
        return np.full(2, math.nan)
    beyond = np.flatnonzero(angle >= ENOUGH * least)
    if not len(beyond):
        return np.full(2, math.nan)
    last = len(poses) if least >= asked - 1e-9 else int(beyond[0]) + 1
    return centre_of_rotation(poses[:last]).body


def rows_of(turned: list[Turned], reaches: dict[tuple[str, str], tuple[float, float]]) -> list[Row]:
    """Return the rows."""
    free = [each for each in turned if each.pivot.scene == "free_table"]
    locked = [each for each in turned if each.pivot.scene != "free_table"]
    whole = [each.angle >= ENOUGH * each.asked for each in turned]
    offs = {f"{each.pivot.name}, {each.way}, m": each.last_off for each in turned}
    angles = {f"{each.pivot.name}, {each.way}, deg": math.degrees(each.angle) for each in turned}
    driving = {f"{name}, {way}, deg": math.degrees(each[1]) for (name, way), each in reaches.items()}
    standing = {f"{name}, {way}, deg": math.degrees(each[0]) for (name, way), each in reaches.items()}
    asked = math.degrees(turned[0].asked)
    return [
        at_least(
            f"turns of {asked:.0f} degrees that are done, of {len(turned)}", sum(whole), "1", len(turned), **angles
        ),
        at_most(
            "found centre from the chosen one, free table, worst", _most([e.last_off for e in free]), "m", NEAR, **offs
        ),
        at_most(
            "found centre from the locked caster's swivel axis, worst",
            _most([e.last_off for e in locked]),
            "m",
            NEAR,
            from_where_it_touches_m=_most([from_contact(e) for e in locked]),
        ),
        at_most(
            "how far the chosen point strayed, worst",
            _most([e.wander for e in turned]),
            "m",
            NEAR,
            **{f"{each.pivot.name}, {each.way}, m": each.wander for each in turned},
        ),
        at_most(
            "grip force over the expected, locked caster, worst",
            _most([largest(e.held) / e.held.peak for e in locked]),
            "1",
            RATIO,
            force_N=_most([largest(e.held) for e in locked]),
        ),
        at_most(
            "grip force, free table, worst",
            _most([largest(e.held) for e in free]),
            "N",
            40.0,
            expected_N=_most([e.held.peak for e in free]),
            **{f"{e.pivot.name}, {e.way}, N": largest(e.held) for e in free},
        ),
        at_most(
            "turns that unexpected force would have ended",
            sum(e.held.stopped == e.held.stopped for e in turned),
            "1",
            0,
        ),
        at_least("workspace margin, least", float(np.min([least(e.held) for e in turned])), "m", MARGIN),
        at_least(
            "reachable angle with the base driving, least over points",
            math.degrees(min(each[1] for each in reaches.values())),
            "deg",
            ANGLES[-1],
            thesis="chapter 4: arbitrary points in the reachable workspace, no angle given",
            **driving,
        ),
        at_least(
            "reachable angle with arms alone, least over points",
            math.degrees(min(each[0] for each in reaches.values())),
            "deg",
            ANGLES[0],
            thesis="6.3: small displacements from the middle of the workspace, no angle given",
            **standing,
        ),
    ]


def from_contact(turned: Turned) -> float:
    """Return how far the last centre is from where a locked caster touches the floor, its trail off its axis [m]."""
    scene = load_scene(config_file("scenes", turned.pivot.scene))
    contacts = locked_contacts(scene, TABLE, turned.held.job.seed)
    return float(np.hypot(*(contacts - turned.last).T).min())


def _most(values: list[float]) -> float:
    """Return the largest; NaN where one is."""
    return float(np.max(values)) if values else math.nan


def _degrees(reaches: dict[tuple[str, str], tuple[float, float]]) -> dict[str, dict[str, float]]:
    return {
        f"{name}, {way}": {"arms_alone": math.degrees(alone), "with_base": math.degrees(base)}
        for (name, way), (alone, base) in reaches.items()
    }


def _told(turned: Turned) -> dict[str, Any]:
    """Return the numbers of one turn, for the report."""
    held = turned.held
    return {
        "about": turned.pivot.name,
        "way": turned.way,
        "phase": held.phase,
        "status": held.status,
        "angle_deg": math.degrees(turned.angle),
        "angles_deg": ANGLES,
        "centre_off_m": turned.off.tolist(),
        "chosen_point_wander_m": turned.wander,
        "would_have_stopped_s": held.stopped,
        "force_N": largest(held),
        "expected_N": held.peak,
        "margin_m": least(held),
        "base_driven_m": turned.driven,
        "base_turned_deg": math.degrees(turned.spun),
        "seconds": float(held.time[-1]) if len(held.time) else 0.0,
    }
