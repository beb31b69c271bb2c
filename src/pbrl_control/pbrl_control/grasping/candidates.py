"""Grasps of an object that the robot can drive to, shortest way first (thesis 6.3.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from shapely import Polygon, orient_polygons

from pbrl_control.errors import ControlError
from pbrl_control.grasp_plan import Grip
from pbrl_control.grasping.contacts import Hands, Reach, face_point, place_plates, reach_contacts
from pbrl_control.grasping.model_rules import GraspModel, ray_hits
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.navigation.floor_map import FloorMap, as_polygon
from pbrl_control.navigation.footprint import KRANG_STOWED, Footprint, reaching_arms
from pbrl_control.navigation.motion import MotionChecker
from pbrl_control.navigation.path import BasePath
from pbrl_control.navigation.route import plan_route
from pbrl_control.percept import BodyShape
from pbrl_control.planar import Array, compose

EVERY_HAND: tuple[Hands, ...] = (("left", "right"), ("left",), ("right",))


@dataclass(frozen=True)
class GraspCandidate:
    """A grasp with a way to it.

    Attributes:
        object: its name.
        sides: who grasps: ("left", "right"), ("left",) or ("right",).
        contacts: (2,) of each side on the outline, in the object's frame [m].
        base_goal: (3,) in `world` to drive to: grippers at their homes are then before the edge [m, rad].
        base_grasp: (3,) in `world` straight ahead of that, where the plates at their homes are past the edge.
        path: from where the base was to `base_goal`.
    """

    object: str
    sides: Hands
    contacts: dict[str, Array]
    base_goal: Array
    base_grasp: Array
    path: BasePath

    @property
    def path_length(self) -> float:
        """Distance to drive [m]."""
        return self.path.length

    def grips(self) -> tuple[Grip, ...]:
        """Return the grasp as a push plan's grips."""
        return tuple(
            Grip.model_validate({"gripper": side, "point": tuple(map(float, self.contacts[side]))})
            for side in self.sides
        )


@dataclass(frozen=True)
class Rejection:
    """A grasp that was looked at and is not to be had.

    Attributes:
        sides: who would have grasped.
        point: (2,) of the outline, in the object's frame [m].
        reason: in one line.
    """

    sides: Hands
    point: Array
    reason: str


@dataclass(frozen=True)
class GraspSearch:
    """What a search found.

    Attributes:
        candidates: shortest path first.
        rejected: in the order in which they were looked at.
        refusal: why there was nothing to look at: a static object, an edge that no gripper fits; else empty.
    """

    candidates: tuple[GraspCandidate, ...]
    rejected: tuple[Rejection, ...]
    refusal: str = ""

    def why(self) -> str:
        """Return why there is no candidate, in one line: the reasons with how often each was met."""
        if self.candidates:
            return ""
        if self.refusal or not self.rejected:
            return self.refusal or "no ray from the centre meets a face that the model class allows"
        reasons = [rejection.reason for rejection in self.rejected]
        counts = sorted({reason: reasons.count(reason) for reason in reasons}.items(), key=lambda item: -item[1])
        return "; ".join(f"{count} x {reason}" for reason, count in counts[:4])


@dataclass(frozen=True)
class _Stand:
    """A grasp that is free where the base would stand, before a way to it is looked for."""

    reach: Reach
    goal: Array
    grasp: Array
    point: Array


def sample_grasps(
    name: str,
    shape: BodyShape,
    pose: Array,
    model: GraspModel,
    base: Array,
    floor: FloorMap,
    rng: np.random.Generator,
    *,
    centre: Array | None = None,
    hands: Sequence[Hands] = EVERY_HAND,
    robot: Footprint = KRANG_STOWED,
    settings: GraspSettings | None = None,
) -> GraspSearch:
    """Sample grasps of an object, keep those that fit and that the base can drive to.

    Args:
        name: of the object; `floor` has it as an obstacle.
        shape: its footprint and height.
        pose: (3,) of it in `world` [m, rad].
        model: how it can move.
        base: (3,) where the base is, in `world`.
        floor: room and obstacles, the object among them.
        rng: draws the rays and the seed of the path planner.
        centre: (2,) of mass in the object's frame; the footprint's centroid where it is not known [m].
        hands: which hands to try at each ray.
        robot: footprint on the way, arms stowed.
        settings: of grippers and search.

    Raises:
        ControlError: a pose is not finite, the object is not on the map, hands are unknown.
    """
    settings = settings or GraspSettings()
    pose, base = _poses(name, pose, base, floor)
    unknown = [sides for sides in hands if tuple(sides) not in EVERY_HAND]
    if unknown:
        raise ControlError(f"grasp of {name!r}: expected hands out of {EVERY_HAND}, got {unknown[0]!r}")
    refusal = model.refusal() or _edge_refusal(shape, settings)
    if refusal:
        return GraspSearch((), (), refusal)
    outline = orient_polygons(as_polygon(shape.footprint, name))
    corners = np.array(outline.exterior.coords)[:-1]
    middle = np.array(outline.centroid.coords[0]) if centre is None else np.asarray(centre, dtype=float)
    checker = MotionChecker(floor, robot, settings.clearance)
    stands: list[_Stand] = []
    rejected: list[Rejection] = []
    for angle in model.angles(corners, middle, settings.samples, rng):
        point = ray_hits(corners, middle, float(angle))
        if point is None:
            continue
        for sides in hands:
            found = _stand(name, corners, pose, point, tuple(sides), model, checker, settings)
            if isinstance(found, _Stand):
                stands.append(found)
            else:
                rejected.append(Rejection(tuple(sides), point, found))
    candidates = _with_paths(name, stands, base, checker, settings, int(rng.integers(1, 2**31)), rejected)
    return GraspSearch(tuple(candidates), tuple(rejected))


def grasps_at(
    name: str,
    shape: BodyShape,
    pose: Array,
    points: Mapping[str, Array],
    base: Array,
    floor: FloorMap,
    rng: np.random.Generator,
    *,
    robot: Footprint = KRANG_STOWED,
    settings: GraspSettings | None = None,
) -> GraspSearch:
    """Find the way to a grasp whose points are told.

    Args:
        name: of the object; `floor` has it as an obstacle.
        shape: its footprint and height.
        pose: (3,) of it in `world` [m, rad].
        points: (2,) by gripper, in the object's frame; the nearest points of its outline are taken [m].
        base: (3,) where the base is, in `world`.
        floor: room and obstacles, the object among them.
        rng: draws the seed of the path planner.
        robot: footprint on the way, arms stowed.
        settings: of grippers and search.

    Returns:
        One candidate, or why there is none.

    Raises:
        ControlError: a pose is not finite, the object is not on the map.
    """
    settings = settings or GraspSettings()
    pose, base = _poses(name, pose, base, floor)
    refusal = _edge_refusal(shape, settings)
    if refusal:
        return GraspSearch((), (), refusal)
    corners = np.array(orient_polygons(as_polygon(shape.footprint, name)).exterior.coords)[:-1]
    reach = reach_contacts(corners, points, settings)
    if isinstance(reach, str):
        return GraspSearch((), (), reach)
    checker = MotionChecker(floor, robot, settings.clearance)
    middle = np.mean([reach.contacts[side] for side in reach.sides], axis=0)
    stand = _free_stand(name, pose, reach, middle, checker, settings)
    if isinstance(stand, str):
        return GraspSearch((), (Rejection(reach.sides, middle, stand),))
    rejected: list[Rejection] = []
    found = _with_paths(name, [stand], base, checker, settings, int(rng.integers(1, 2**31)), rejected)
    return GraspSearch(tuple(found), tuple(rejected))


def _poses(name: str, pose: Array, base: Array, floor: FloorMap) -> tuple[Array, Array]:
    """Return the poses (3,) of object and base as arrays; raise ControlError where one is none or it is not mapped."""
    if name not in floor.obstacles:
        raise ControlError(f"grasp of {name!r}: expected it on the map, got {', '.join(floor.obstacles) or 'nothing'}")
    return _pose(pose, f"pose of {name!r}"), _pose(base, "pose of the base")


def _pose(pose: Array, what: str) -> Array:
    values = np.asarray(pose, dtype=float)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise ControlError(f"{what}: expected a finite pose (x, y, theta), got {pose}")
    return values


def _edge_refusal(shape: BodyShape, settings: GraspSettings) -> str:
    """Return why no gripper fits the object's edge anywhere; empty where one does."""
    thickest = settings.opening - settings.opening_margin
    if settings.edge_thickness > thickest:
        return f"edge: expected at most {thickest:.3f} m thick for the plates to go over, is {settings.edge_thickness}"
    height, (low, high) = shape.height - settings.edge_thickness / 2.0, settings.heights
    return "" if low <= height <= high else f"edge: expected {low} to {high} m above the floor, is at {height:.3f} m"


def _stand(
    name: str,
    corners: Array,
    pose: Array,
    point: Array,
    sides: Hands,
    model: GraspModel,
    checker: MotionChecker,
    settings: GraspSettings,
) -> _Stand | str:
    """Return where the base stands for a grasp at a point (2,) of the outline, or why it cannot."""
    face = face_point(corners, point)
    reach = model.face_fault(face.normal) or place_plates(face, sides, settings)
    return reach if isinstance(reach, str) else _free_stand(name, pose, reach, point, checker, settings)


def _free_stand(
    name: str, pose: Array, reach: Reach, point: Array, checker: MotionChecker, settings: GraspSettings
) -> _Stand | str:
    """Return where the base stands for a reach, or what would be in its way there."""
    grasp = compose(pose, reach.base)
    goal = compose(grasp, np.array([-settings.standoff - settings.depth, 0.0, 0.0]))
    fault = checker.pose_fault(goal) or checker.drive_fault(goal[:2], grasp[:2], float(goal[2]))
    if fault:
        return f"stand: the base would be in {fault}"
    arms = _arms_fault(name, goal, grasp, reach.lateral, checker.floor)
    return f"stand: the arms would be in {arms}" if arms else _Stand(reach, goal, grasp, point)


def _arms_fault(name: str, goal: Array, grasp: Array, lateral: float, floor: FloorMap) -> str:
    """Return what the lowered arms would be in, other than the object; empty where they are free."""
    arms = reaching_arms(lateral)
    covered = arms.swept(goal[:2], grasp[:2], float(goal[2]))
    if not floor.room.covers(covered):
        return "the walls"
    if floor.obstacles[name].intersects(Polygon(arms.at(goal))):
        return f"{name!r} before they are lined up"
    others = (other for other, thing in floor.obstacles.items() if other != name and thing.intersects(covered))
    return next((repr(other) for other in others), "")


def _with_paths(
    name: str,
    stands: list[_Stand],
    base: Array,
    checker: MotionChecker,
    settings: GraspSettings,
    seed: int,
    rejected: list[Rejection],
) -> list[GraspCandidate]:
    """Return the candidates that can be driven to, shortest first; stop where none shorter can follow."""
    found: list[GraspCandidate] = []
    dead_ends = 0
    bounds = [float(np.hypot(*(stand.goal[:2] - base[:2]))) for stand in stands]
    for index in np.argsort(bounds, kind="stable"):
        stand, sides = stands[index], stands[index].reach.sides
        if len(found) >= settings.wanted and bounds[index] >= found[settings.wanted - 1].path_length:
            rejected.append(Rejection(sides, stand.point, "way: longer than those of the candidates found"))
            continue
        if dead_ends >= settings.dead_ends:
            rejected.append(Rejection(sides, stand.point, f"way: not looked for after {dead_ends} dead ends"))
            continue
        route = plan_route(checker, base, stand.goal, seed=seed, time_limit=settings.time_limit, narrow=settings.narrow)
        if route.path is None:
            dead_ends += route.exhausted
            rejected.append(Rejection(sides, stand.point, f"way: {route.reason}"))
            continue
        found.append(GraspCandidate(name, sides, stand.reach.contacts, stand.goal, stand.grasp, route.path))
        found.sort(key=lambda candidate: candidate.path_length)
    return found
