"""Monte-Carlo manipulation and the kinodynamic RRT asked the same: open this, of known physics, in this room.

Both know the truth. Both are asked for the first opening from where the robot is, whose thing can be moved at all; both
have done it when the exact free space joins the robot's start and the same point beyond. Ours may let go and take hold
again, at most three times, planning anew each time; the RRT plans one manipulation. It may use three grasps,
ours first where it has one, in equal parts of its time; of the base it is only asked that it is in nothing, not that
it can drive as the thing goes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from pbrl_bringup.benches.namo_kinematic import carry_out, certain, true_models
from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import Array, compose, inverse
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.manipulation.estimate import estimate, target_point
from pbrl_namo.manipulation.grasps import reachable_grasps
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.regions.free_space import ARC, FreeSpace, as_regions, free_space
from pbrl_namo.regions.openings import Opening, openings
from pbrl_namo.regions.roadmap import Roadmap, build_roadmap
from pbrl_namo.scene import NamoScene
from pbrl_namo.scenes import draw_hidden, random_office
from pbrl_namo.settings import NamoSettings
from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic import Goal, KinodynamicSettings, PushProblem, WrenchLimits, plan_push

COUNT = 10
"""Movable things in a room."""
STEPS = 4
"""Manipulations at most that make one opening."""
DRAWS = 100
"""Offices that are drawn until one has an opening."""
GRASPS = 3
"""That the RRT may use."""
PATIENCE = 15.0
"""Of the RRT, over all of them [s]."""


@dataclass(frozen=True)
class Duel:
    """One room.

    Attributes:
        object: to be moved.
        ours: whether Monte-Carlo manipulation opened it.
        our_seconds: that it took [s].
        our_way: duration of the manipulations; NaN where there is none [s].
        theirs: whether the kinodynamic RRT did.
        their_seconds: likewise [s].
        their_way: likewise [s].
    """

    object: str
    ours: bool
    our_seconds: float
    our_way: float
    theirs: bool
    their_seconds: float
    their_way: float


def duel(seed: int, number: int) -> Duel:
    """Draw an office with an opening and ask both to make it.

    Args:
        seed: of the bench.
        number: of the office.
    """
    rng = np.random.default_rng([seed, COUNT, number, 1])
    for _ in range(DRAWS):
        scene = random_office(COUNT, rng, move_needed=True)
        truth = true_models(scene, draw_hidden(scene, rng))
        free, roadmap = free_space(scene), build_roadmap(scene, rng)
        start = free.index(scene.start)
        first = next((each for each in openings(scene, free, roadmap) if _fits(each, start, scene, truth)), None)
        if first is not None:
            return _duel(scene, free, roadmap, first, truth, seed)
    raise PlannerError(f"office: expected one of {DRAWS} with an opening of a thing that can be moved, got none")


def _fits(opening: Opening, start: int | None, scene: NamoScene, truth: Mapping[str, ObjectModel]) -> bool:
    name = opening.object
    mobile = Freedom.of(truth[name], scene.poses[name]).model_class != ModelClass.STATIC
    return opening.start == start and not opening.then and mobile


def _duel(
    scene: NamoScene, free: FreeSpace, roadmap: Roadmap, opening: Opening, truth: Mapping[str, ObjectModel], seed: int
) -> Duel:
    name = opening.object
    target = target_point(scene, free, roadmap, opening)
    opened = check_of(scene, free, name, target)
    rng = np.random.default_rng(seed)
    beliefs = {name: certain(truth[name])}
    estimate(scene, free, roadmap, opening, beliefs, np.random.default_rng(seed))  # loads what was compiled
    began = time.perf_counter()
    plan = _ours(scene, free, roadmap, opening, beliefs, rng)
    our_seconds = time.perf_counter() - began
    ours, more_seconds, our_way = _carried_out(scene, target, plan, beliefs, truth[name], rng)
    way, their_seconds = _rrt(scene, roadmap, opening, truth[name], plan, opened, seed)
    theirs = way == way
    return Duel(name, ours, our_seconds + more_seconds, our_way, theirs, their_seconds, way)


def _ours(
    scene: NamoScene,
    free: FreeSpace,
    roadmap: Roadmap,
    opening: Opening,
    beliefs: Mapping[str, ObjectBelief],
    rng: np.random.Generator,
) -> ManipulationPlan | None:
    """Plan one opening as `pbrl_namo.planner.plan` would: at first quickly, and harder where that finds none."""
    plan = estimate(scene, free, roadmap, opening, beliefs, rng).plan
    for settings in NamoSettings().harder():
        if plan is not None:
            break
        dense = build_roadmap(scene, rng, settings.regions)
        plan = estimate(scene, free, dense, opening, beliefs, rng, settings.manipulation).plan
    return plan


def _carried_out(
    scene: NamoScene,
    target: Array,
    plan: ManipulationPlan | None,
    beliefs: Mapping[str, ObjectBelief],
    model: ObjectModel,
    rng: np.random.Generator,
) -> tuple[bool, float, float]:
    """Carry a plan out, and whatever is planned after it with the same thing.

    Returns:
        Whether the robot can then get to a point (2,), the time of the further plans and of all manipulations [s].
    """
    seconds, way, open_ = 0.0, 0.0, False
    for _ in range(STEPS):
        if plan is None:
            break
        name, way = plan.object, way + plan.duration
        scene, refused, hit = carry_out(scene, plan, model)
        free = free_space(scene)
        here, there = free.index(scene.start), free.index(target)
        open_ = not refused and not hit and here is not None and here == there
        if open_ or refused or hit or plan.more == 0:
            break
        began = time.perf_counter()
        roadmap = build_roadmap(scene, rng)
        further = [
            each
            for each in openings(scene, free, roadmap)
            if (each.object, each.start, each.end) == (name, here, there) and not each.then
        ]
        plan = _ours(scene, free, roadmap, further[0], beliefs, rng) if further else None
        seconds += time.perf_counter() - began
    return open_, seconds, way if way > 0.0 else float("nan")


def check_of(scene: NamoScene, free: FreeSpace, name: str, target: Array) -> Callable[[Array], bool]:
    """Return what says of a pose (3,) of a thing whether the start is joined to a point (2,), all else as it stands."""
    without = shapely.union_all(list(free_space(scene, free.radius, leave_out=name).regions))
    thing, start, end = scene.movable[name], shapely.Point(scene.start[:2]), shapely.Point(target)

    def opened(pose: Array) -> bool:
        regions = as_regions(without.difference(thing.at(pose).buffer(free.radius, quad_segs=ARC)))
        return any(region.intersects(start) and region.intersects(end) for region in regions)

    return opened


def _rrt(
    scene: NamoScene,
    roadmap: Roadmap,
    opening: Opening,
    model: ObjectModel,
    ours: ManipulationPlan | None,
    opened: Callable[[Array], bool],
    seed: int,
) -> tuple[float, float]:
    """Return the duration of what the RRT found, NaN where it found nothing, and the time it took [s]."""
    name = opening.object
    pose = scene.poses[name]
    held = [
        (np.mean(list(grasp.contacts.values()), axis=0), grasp.base)
        for grasp in reachable_grasps(scene, roadmap, name, opening.start, ManipulationSettings())
    ]
    if len(held) > GRASPS:
        held = [held[k] for k in np.linspace(0, len(held) - 1, GRASPS).round().astype(int)]
    if ours is not None:
        held = [(np.mean(list(ours.contacts.values()), axis=0), compose(inverse(pose), ours.stand)), *held[:-1]]
    settings = KinodynamicSettings(time_limit=PATIENCE / max(len(held), 1))
    began = time.perf_counter()
    for contact, base in held:
        try:
            problem = PushProblem(
                model,
                pose,
                contact,
                WrenchLimits.to_move(model),
                scene.floor(leave_out=name),
                Goal(opened),
                scene.robot.at(base),
            )
        except PlannerError:  # there is no room for the robot as it stands when it has grasped
            continue
        found = plan_push(problem, seed=seed + 1, settings=settings).plan
        if found is not None:
            return found.duration, time.perf_counter() - began
    return float("nan"), time.perf_counter() - began
