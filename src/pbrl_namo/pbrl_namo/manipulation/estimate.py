"""How likely an opening is and what it costs: Monte-Carlo manipulation in sampled worlds (thesis 6.2.1, 28, 40, 41).

In each world some manipulation may work, and it need not be the same in all: equation 40 counts the worlds. What is
then done is one manipulation, before anybody knows which world it is: the one that does best over all of them.

The motion of a thing does not depend on how heavy it is, nor on what else of its physics leaves a command as it is, so
each command is followed once with each grasp; what it takes of the grips is then asked in every world.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.planar import Array
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.manipulation.best_plan import best_plan
from pbrl_namo.manipulation.cost import reward
from pbrl_namo.manipulation.effort_kernel import FORCE, SUM, TIME, TORQUE
from pbrl_namo.manipulation.grasps import reachable_grasps
from pbrl_namo.manipulation.in_steps import estimate_in_steps
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.manipulation.rollout import Roller
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.ways_to_move import first_look, second_look, suitable
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import FreeSpace
from pbrl_namo.regions.openings import Opening
from pbrl_namo.regions.roadmap import Roadmap
from pbrl_namo.scene import NamoScene

Flags = NDArray[np.bool_]
OFTEN = 3  # things in the way that a reason tells


def estimate(
    scene: NamoScene,
    free: FreeSpace,
    roadmap: Roadmap,
    opening: Opening,
    beliefs: Mapping[str, ObjectBelief],
    rng: np.random.Generator,
    settings: ManipulationSettings | None = None,
) -> Estimate:
    """Estimate one opening; many of one scene are quicker by `estimate_prepared`.

    Args:
        scene: things where they stand.
        free: its free space.
        roadmap: over it.
        opening: one of theirs.
        beliefs: of what is to be moved.
        rng: draws the worlds.
        settings: of Monte-Carlo manipulation.

    Raises:
        NamoError: nothing is believed of a thing, or a belief is not of it.
    """
    settings = settings or ManipulationSettings()
    yard = Yard.of(scene, free.radius, settings.cell)
    studies = {name: Study.of(scene, name, beliefs, rng, settings) for name in (opening.object, *opening.then)}
    return estimate_prepared(yard, free, roadmap, opening, studies, settings)


def estimate_prepared(
    yard: Yard,
    free: FreeSpace,
    roadmap: Roadmap,
    opening: Opening,
    studies: Mapping[str, Study],
    settings: ManipulationSettings,
    been: Sequence[Array] = (),
) -> Estimate:
    """Estimate one opening.

    Args:
        yard: the scene, prepared.
        free: its free space.
        roadmap: over it.
        opening: one of theirs.
        studies: of the opening's object, and of those that have to go after it.
        settings: of Monte-Carlo manipulation.
        been: poses (3,) of the object to which it is not brought back in steps [m, rad].
    """
    study, name = studies[opening.object], opening.object
    hopeless = Estimate(opening, 0.0, -settings.cost.alpha, None)
    if not len(study.commands):
        return replace(hopeless, reason=f"{name!r} cannot be moved: {_static(study)}")
    target = target_point(yard.scene, free, roadmap, opening)
    found, works = _in_one_grasp(yard, roadmap, opening, study, target, settings)
    if settings.steps > 1 and not works[study.worlds.usual()].any():
        several = estimate_in_steps(yard, free, opening, study, target, settings, been)
        if several is not None and _worth(several, settings) > _worth(found, settings):
            found = several
    if found.plan is None:
        return found
    probability, mean = found.probability, found.reward
    for other in opening.then:  # it has to go too, about which nothing is known yet but whether it can be moved at all
        probability *= studies[other].worlds.mobile()
        mean += 0.5 * hopeless.reward
    return replace(found, probability=probability, reward=mean)


def _worth(found: Estimate, settings: ManipulationSettings) -> float:
    return found.probability * settings.cost.terminal + found.reward


def _in_one_grasp(
    yard: Yard, roadmap: Roadmap, opening: Opening, study: Study, target: Array, settings: ManipulationSettings
) -> tuple[Estimate, Flags]:
    """Return what is expected of an opening that is made in one manipulation, and the worlds (w,) in which it can."""
    name, hopeless = opening.object, Estimate(opening, 0.0, -settings.cost.alpha, None)
    nowhere: Flags = np.zeros(len(study.worlds), dtype=bool)
    grasps = reachable_grasps(yard.scene, roadmap, name, opening.start, settings)
    grasps, usable = suitable(grasps, study.worlds, study.commands, settings)
    if not grasps:
        return replace(hopeless, reason=f"{name!r}: no grasp that suits it from where the robot is"), nowhere
    roller = Roller(yard, opening, study.body, grasps, target, settings)
    ways, met = first_look(roller, study.commands, usable, settings)
    loose: Flags = np.array(study.worlds.classes()) == ModelClass.UNCONSTRAINED
    if settings.second_look and loose.any() and not ways.obeyed(loose):
        ways = ways.and_(second_look(roller, study.worlds, settings))
    if not len(ways):
        return replace(hopeless, reason=_blocked(name, int(usable.sum()), met, yard)), nowhere
    taken = ways.efforts(study.worlds, grasps, settings.constraints.torque_arm)
    limit = settings.constraints.grip_force
    works: Flags = np.nan_to_num(taken[..., SUM], nan=np.inf) <= limit
    if not works.any():
        obeyed = taken[..., SUM][~np.isnan(taken[..., SUM])]
        why = f"takes {obeyed.min():.0f} N at least, the grips give {limit:.0f} N" if len(obeyed) else "would not obey"
        return replace(hopeless, reason=f"{name!r}: {why}"), nowhere
    rewards = reward(taken[..., TIME], taken[..., FORCE], taken[..., TORQUE], settings.cost)
    best = np.where(works, rewards, hopeless.reward).max(axis=1)
    plan = best_plan(grasps, roller.pose, name, target, study.worlds, ways, taken, rewards, works, settings)
    possible: Flags = np.asarray(works.any(axis=1))
    return Estimate(opening, float(possible.mean()), float(best.mean()), plan), possible


def target_point(scene: NamoScene, free: FreeSpace, roadmap: Roadmap, opening: Opening) -> Array:
    """Return the point (2,) to which a way has to be open: the goal, or of another region a place to work from [m].

    That place is where another thing can be grasped, as far as may be from what is moved; else any point inside.
    """
    region = free.regions[opening.end]
    if shapely.intersects_xy(region, *scene.goal[:2]):
        return np.array(scene.goal[:2], dtype=float)
    outline = scene.outlines[opening.object]
    stands = [
        sample.point
        for name, samples in roadmap.grasps.items()
        for sample in samples
        if name != opening.object and roadmap.regions[sample.component] == opening.end
    ]
    if not stands:
        return shapely.get_coordinates(region.representative_point())[0]
    return stands[int(np.argmax(shapely.distance(outline, shapely.points(np.array(stands)))))]


def _static(study: Study) -> str:
    """Return why a thing is static in the first world in which it is."""
    return next(each.reason for each in study.worlds.freedoms if each.model_class == ModelClass.STATIC)


def _blocked(name: str, count: int, met: Counter[tuple[int, bool]], yard: Yard) -> str:
    """Return what was in the way of all that was tried, what was met most often first."""
    names = [yard.names[0], *map(repr, yard.names[1:])]
    often = ", ".join(
        f"{'the robot' if robot else repr(name)} meets {names[hit]} ({times})"
        for (hit, robot), times in met.most_common(OFTEN)
    )
    return f"{name!r}: none of {count} ways to move it opens a path" + (f"; {often}" if often else "")
