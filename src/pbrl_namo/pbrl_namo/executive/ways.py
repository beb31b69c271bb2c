"""What a thinker finds once it is known what to move: a grasp with a way to it; or the way to the goal."""

from __future__ import annotations

import math
import time

import numpy as np
from shapely import orient_polygons

from pbrl_control.constraints.classes import Freedom
from pbrl_control.errors import ControlError
from pbrl_control.fetching import grasp_model
from pbrl_control.grasping import EVERY_HAND, GraspCandidate, GraspModel, GraspSettings, grasps_at, sample_grasps
from pbrl_control.grasping.contacts import face_point, place_plates
from pbrl_control.navigation import BasePath, MotionChecker, plan_route
from pbrl_control.navigation.floor_map import as_polygon
from pbrl_control.percept import BodyShape
from pbrl_control.planar import Array, wrap
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import GraspAnswer, GraspJob
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.scene import NamoScene

SAME_FACE = math.radians(45.0)
"""Between the normals of the planned face and of one that will do in its place [rad]."""

APART = 0.25
"""Nearer than this to a stand where a grasp has failed none is tried [m]."""

HEADINGS = 8
"""At a goal of any heading, looked at one after the other."""


def find_grasp(job: GraspJob, settings: GraspSettings | None = None) -> GraspAnswer:
    """Find a grasp for a move, and the way to it.

    First where the plan has it, with the hands that it has in mind, then with others; then any that the object's model
    class allows on that side of it (thesis 6.3.2), shortest way first.

    Args:
        job: what is moved, and where a grasp has failed already.
        settings: of grippers and search; None: those of a fetch.

    Raises:
        ControlError: an outline or pose is none.
    """
    begun = time.perf_counter()
    settings = (settings or ExecutiveSettings().fetch.grasps).model_copy(update={"narrow": True})
    scene, move = job.scene, job.move
    thing, pose, floor = scene.movable[move.object], scene.poses[move.object], scene.floor()
    shape, rng = BodyShape(thing.footprint, thing.height), np.random.default_rng(job.seed)
    corners = np.array(orient_polygons(as_polygon(thing.footprint, move.object)).exterior.coords)[:-1]
    wanted = face_point(corners, move.contact)
    reasons: list[str] = []
    for hands in sorted(EVERY_HAND, key=lambda sides: sides != move.hands):
        reach = place_plates(wanted, hands, settings)
        if isinstance(reach, str):
            reasons.append(reach)
            continue
        found = grasps_at(
            move.object, shape, pose, reach.contacts, scene.start, floor, rng, robot=scene.robot, settings=settings
        )
        reasons.append(found.why())
        for candidate in found.candidates:
            if not _avoided(candidate, job):
                return GraspAnswer(candidate, seconds=time.perf_counter() - begun)
            reasons[-1] = "a grasp has failed there"
    model = _model(job)
    sampled = sample_grasps(
        move.object, shape, pose, model, scene.start, floor, rng, robot=scene.robot, settings=settings
    )
    for candidate in sampled.candidates:
        middle = np.mean(list(candidate.contacts.values()), axis=0)
        aside = abs(wrap(face_point(corners, middle).normal - wanted.normal))
        if aside < SAME_FACE and not _avoided(candidate, job):
            return GraspAnswer(candidate, seconds=time.perf_counter() - begun)
    others = sampled.why() or "none on the side that is to be held"
    reason = f"where it was planned: {'; '.join(dict.fromkeys(filter(None, reasons)))}; elsewhere: {others}"
    return GraspAnswer(reason=reason, seconds=time.perf_counter() - begun)


def find_way(scene: NamoScene, seed: int, margin: float = 0.03, time_limit: float = 5.0) -> BasePath:
    """Find the way to a scene's goal; where any heading will do, one that is easily arrived at.

    Args:
        scene: things where they stand.
        seed: of the search.
        margin: kept around the robot [m].
        time_limit: of each search [s].

    Raises:
        NamoError: there is none, and why.
    """
    checker = MotionChecker(scene.floor(), scene.robot, margin)
    reason = ""
    for goal in _goals(scene):
        route = plan_route(checker, scene.start, goal, seed=seed, time_limit=time_limit, narrow=True)
        if route.path is None:
            reason = reason or route.reason
            continue
        if math.isnan(scene.goal[2]) and route.path.legs:
            end = np.array([*goal[:2], route.path.legs[-1].heading])
            return BasePath(route.path.start, end, route.path.legs)
        return route.path
    raise NamoError(f"way to the goal: {reason}")


def _goals(scene: NamoScene) -> list[Array]:
    """Return the poses (3,) that count as the goal, the most natural first."""
    if not math.isnan(scene.goal[2]):
        return [scene.goal]
    x, y = scene.goal[:2] - scene.start[:2]
    first = math.atan2(y, x) if x or y else float(scene.start[2])
    turns = sorted((wrap(2.0 * math.pi * k / HEADINGS) for k in range(HEADINGS)), key=lambda turn: (abs(turn), turn))
    return [np.array([*scene.goal[:2], wrap(first + turn)]) for turn in turns]


def _model(job: GraspJob) -> GraspModel:
    """Return what grasping has to know of the object."""
    if job.move.model is None:
        return GraspModel("unconstrained")
    try:
        return grasp_model(Freedom.of(job.move.model, job.scene.poses[job.move.object]))
    except ControlError:  # a model whose freedom is not known restricts nothing
        return GraspModel("unconstrained")


def _avoided(candidate: GraspCandidate, job: GraspJob) -> bool:
    return any(float(np.hypot(*(candidate.base_goal[:2] - stand))) < APART for stand in job.avoid)
