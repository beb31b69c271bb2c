"""The NAMO planner in a kinematic world: rooms whose furniture is not what it looks like, without forces and control.

What is true of a thing is an `ObjectModel`; held, it moves as `achievable_twist` lets it. The robot is where a plan
says: it is not driven there, and does not grasp. A manipulation fails where the thing refuses the commanded motion or
where thing or robot would be in something; where it is planned to push others, these go as in contact worlds. Of what
refused everything is told at once, as if its model were learned perfectly. So this tests plans and what follows from
them; driving, grasping, forces and learning are not in it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from pbrl_bringup.benches.namo_oracle import out_of_reach
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.planar import Array, compose, inverse
from pbrl_control.types import PlanarTwist
from pbrl_model.parameters import BodyParameters
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.manipulation.contact_worlds import ContactWorlds
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.planner import NamoPlan, plan, prior_beliefs
from pbrl_namo.scene import NamoScene
from pbrl_namo.scenes import draw_hidden, random_office
from pbrl_namo.scenes.hidden import CASTERS
from pbrl_namo.settings import NamoSettings
from pbrl_namo.warming import compile_kernels

ROLLING, TREAD, INSET = 0.02, 0.7, 0.06
"""Friction coefficient of a thing whose casters roll, and of a locked one's tread; how far casters are inwards [m]."""
STEP = 0.05
"""[s] of a motion between two looks for collisions."""
TOUCH = 1e-3
"""[m] by which what touches may overlap, by rounding."""
REFUSED = ManipulationSettings().refused
"""Share of a commanded motion, by its kinetic energy's root, that a thing may refuse unnoticed."""
MOST = 3
"""Manipulations for each thing in a room, after which a run is given up."""
REACHED, RIGHTLY, WRONGLY, LOST, LONG = (
    "reached",
    "rightly said to be out of reach",
    "wrongly said to be out of reach",
    "robot stands where it is in no region",
    "no end",
)
"""How a run can end."""


@dataclass(frozen=True)
class Run:
    """What became of one room.

    Attributes:
        end: one of `REACHED`, `RIGHTLY`, `WRONGLY`, `LOST`, `LONG`.
        reason: what the planner said last.
        moves: manipulations begun.
        failed: of those, how many the thing refused or something was in the way of.
        refused: the things that refused, in order.
        planning: sum over all plans, prior beliefs apart [s].
        longest: the longest plan [s].
    """

    end: str
    reason: str
    moves: int
    failed: int
    planning: float
    longest: float
    refused: tuple[str, ...] = ()


def office_run(seed: int, number: int, count: int) -> Run:
    """Draw an office in which something has to be moved, what is hidden in it, and find a way in it.

    Args:
        seed: of the bench.
        number: of the office.
        count: of movable things.
    """
    compile_kernels()  # in each process: planning is timed, loading is not planning
    rng = np.random.default_rng([seed, count, number])
    scene = random_office(count, rng, move_needed=True)
    return find_way(scene, true_models(scene, draw_hidden(scene, rng)), seed)


def find_way(
    scene: NamoScene,
    truth: Mapping[str, ObjectModel],
    seed: int,
    settings: NamoSettings | None = None,
    believed: Mapping[str, ObjectBelief] | None = None,
    seeds: Callable[[int], int] | None = None,
) -> Run:
    """Plan and carry out manipulations until the goal can be driven to, or is said to be out of reach.

    Args:
        scene: as seen.
        truth: what each thing is, of which the planner knows nothing.
        seed: of beliefs and plans.
        settings: of the planner.
        believed: of each thing before it was moved; None: drawn.
        seeds: seed of the plan after so many manipulations; None: counted up from `seed`.
    """
    first, beliefs = scene, dict(prior_beliefs(scene, seed, settings) if believed is None else believed)
    seconds: list[float] = []
    been: dict[str, list[Array]] = {}
    moves = failed = 0
    unwilling: list[str] = []
    while moves < MOST * len(scene.movable):
        began = time.perf_counter()
        made = plan(scene, beliefs, seed + moves if seeds is None else seeds(moves), settings, been)
        seconds.append(time.perf_counter() - began)
        if made.drive or made.chosen is None or made.chosen.plan is None:
            end = _end(first, made, truth)
            return Run(end, made.reason, moves, failed, sum(seconds), max(seconds), tuple(unwilling))
        name = made.chosen.plan.object
        been.setdefault(name, []).append(np.array(scene.poses[name]))
        scene, refused, hit = carry_out(scene, made.chosen.plan, truth[name], truth)
        moves, failed = moves + 1, failed + (refused or hit)
        unwilling += [name] if refused else []
        if refused or hit:
            beliefs[name] = certain(truth[name])
    return Run(LONG, "", moves, failed, sum(seconds), max(seconds, default=math.nan), tuple(unwilling))


def carry_out(
    scene: NamoScene, what: ManipulationPlan, model: ObjectModel, truth: Mapping[str, ObjectModel] | None = None
) -> tuple[NamoScene, bool, bool]:
    """Move a thing as its true physics lets it.

    Args:
        scene: before.
        what: to do.
        model: of the thing.
        truth: of all things; needed where others are to be pushed.

    Returns:
        The scene after it, the robot backed off; whether the thing refused the motion; whether something was in the
        way.
    """
    if what.pushes:
        return _push_through(scene, what, model, truth or {})
    pose = np.array(scene.poses[what.object], dtype=float)
    stand, leave = (compose(inverse(pose), place) for place in (what.stand, what.drive_to))
    room = scene.floor(leave_out=what.object).free.buffer(TOUCH)
    shapely.prepare(room)
    thing = scene.movable[what.object]
    there, refused, hit = np.empty(3), False, False
    for motion in what.motions:
        steps = max(1, math.ceil(motion.duration / STEP))
        for _ in range(steps):
            wanted = PlanarTwist(*map(float, motion.twist))
            allowed = achievable_twist(model, wanted, pose)
            whole = math.sqrt(float(wanted.array() @ model.inertia_shape @ wanted.array()))
            refused = allowed.refused_speed > REFUSED * whole
            if refused:
                break
            moved(pose, allowed.twist.array(), motion.duration / steps, there)
            covers = thing.at(there), shapely.Polygon(scene.robot.at(compose(there, stand)))
            hit = not all(room.covers(cover) for cover in covers)
            if hit:
                break
            pose = there.copy()
        if refused or hit:
            break
    return scene.moved({what.object: compose(pose, np.zeros(3))}, compose(pose, leave)), refused, hit


def _push_through(
    scene: NamoScene, what: ManipulationPlan, model: ObjectModel, truth: Mapping[str, ObjectModel]
) -> tuple[NamoScene, bool, bool]:
    """Do the same where others are pushed on the way; what is refused or jams is given up, and all is as it was."""
    pose = np.array(scene.poses[what.object], dtype=float)
    for motion in what.motions:
        wanted = PlanarTwist(*map(float, motion.twist))
        whole = math.sqrt(float(wanted.array() @ model.inertia_shape @ wanted.array()))
        if achievable_twist(model, wanted, pose).refused_speed > REFUSED * whole:
            return scene, True, False
    settings = ManipulationSettings()
    others = {name: (each,) for name, each in truth.items() if name != what.object}
    worlds = ContactWorlds(scene, what.object, others, settings)
    base = compose(inverse(pose), what.stand)
    carried = worlds.carry(base, [(motion.twist, motion.duration) for motion in what.motions])
    if carried.force[0] > settings.constraints.grip_force:
        return scene, False, True
    poses = {name: found[0] for name, found in carried.poses.items()}
    leave = compose(inverse(pose), what.drive_to)
    return scene.moved({**poses, what.object: carried.end}, compose(carried.end, leave)), False, False


def true_models(scene: NamoScene, hidden: Mapping[str, Mapping[str, Any]]) -> dict[str, ObjectModel]:
    """Return the physics of each movable thing, as far as one wheel and sliding feet can tell it.

    Args:
        scene: with the things.
        hidden: what is not seen of them, as `draw_hidden` gives it.
    """
    return {name: _model(scene.movable[name].footprint, told) for name, told in hidden.items()}


def _model(footprint: Array, told: Mapping[str, Any]) -> ObjectModel:
    """Return the physics of an outline (k, 2) with locked casters, as of one wheel in their middle."""
    mass, locked = float(told["mass"]), list(told["locked_casters"])
    free = ObjectModel.uniform(BodyParameters(mass=mass, mu_ground=ROLLING), footprint)
    if not locked:
        return free
    low, high = footprint.min(axis=0) + INSET, footprint.max(axis=0) - INSET
    corners = dict(
        zip(CASTERS, ((high[0], high[1]), (high[0], low[1]), (low[0], high[1]), (low[0], low[1])), strict=True)
    )
    places = np.array([corners[name] for name in locked])
    middle, friction = places.mean(axis=0), TREAD * len(locked) / len(CASTERS)
    lever = float(np.hypot(*(places - middle).T).mean())
    parameters = BodyParameters(
        mass=mass,
        wheel_x=float(middle[0]),
        wheel_y=float(middle[1]),
        mu_x=friction,
        mu_y=friction,
        mu_ground=ROLLING + friction * lever / math.sqrt(free.inertia_per_mass),
    )
    return ObjectModel.uniform(parameters, footprint)


def certain(model: ObjectModel) -> ObjectBelief:
    """Return the belief of who knows the truth."""
    return ObjectBelief(model.footprint, model.parameters.to_vector()[None])


def _end(scene: NamoScene, made: NamoPlan, truth: Mapping[str, ObjectModel]) -> str:
    """Say how a run ended whose last plan moves nothing; out of reach it has to have been from the first scene on."""
    if made.drive:
        return REACHED
    if made.start is None:
        return LOST
    return RIGHTLY if out_of_reach(scene, truth) else WRONGLY
