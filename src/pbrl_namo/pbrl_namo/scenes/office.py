"""Random offices: rooms with doors, full of furniture on casters, of which some stands where the robot wants to go."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import Polygon

from pbrl_control.navigation.footprint import KRANG_STOWED, Footprint
from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.free_space import FreeSpace, drive_radius, free_space
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes.floor_plan import Door, FloorPlan, draw_plan
from pbrl_namo.scenes.furniture import MAKES, of_make
from pbrl_namo.scenes.settings import OfficeSettings

FEWEST, MOST = 5, 80
"""Movable things that an office can have."""

TRIES = 60
"""Places that are drawn for one thing before it is tried in another room."""

BESIDE_DOOR = 0.5
"""How far [m] from the middle of a door a thing that blocks it may stand, to either side of the wall."""

PAIRS = 400
"""Pairs of start and goal that are drawn in one office."""


def random_office(
    count: int,
    rng: np.random.Generator,
    *,
    move_needed: bool = False,
    robot: Footprint = KRANG_STOWED,
    settings: OfficeSettings | None = None,
) -> NamoScene:
    """Draw an office.

    Without its furniture every room could be reached; start and goal are such that it could be driven from one to the
    other then, and that the robot can turn all the way round in both.

    Args:
        count: of movable things, 5 to 80.
        rng: draws everything; same state, same office.
        move_needed: start and goal are in different regions, so something has to be moved; else as it happens.
        robot: what drives there.
        settings: of rooms and furniture.

    Raises:
        NamoError: the count is out of range, or none of the offices drawn was as asked.
    """
    if not FEWEST <= count <= MOST:
        raise NamoError(f"office: expected {FEWEST} to {MOST} movable things, got {count}")
    settings = settings or OfficeSettings()
    for _ in range(settings.attempts):
        plan = draw_plan(count, rng, settings)
        movable, poses = _furnish(plan, count, rng, settings)
        if len(movable) < count:
            continue
        scene = NamoScene(plan.outline, plan.fixed, movable, poses, np.zeros(3), np.zeros(3), robot)
        ends = _start_and_goal(scene, rng, move_needed, settings)
        if ends is not None:
            return NamoScene(plan.outline, plan.fixed, movable, poses, *ends, robot)
    raise NamoError(
        f"office: expected one of {settings.attempts} rooms with {count} things to do, got none; give more floor to "
        "each or draw again from another seed"
    )


def _furnish(
    plan: FloorPlan, count: int, rng: np.random.Generator, settings: OfficeSettings
) -> tuple[dict[str, Movable], dict[str, Array]]:
    """Put things into doors first, then into rooms in turn; what finds no place in any of them is missing."""
    shares = np.array([make.share for make in MAKES.values()])
    makes = [str(make) for make in rng.choice(list(MAKES), count, p=shares / shares.sum())]
    waiting = sorted(makes, key=lambda make: -MAKES[make].size[0] * MAKES[make].size[1])  # large ones find room first
    rooms = [plan.room(room, settings.wall) for room in plan.rooms]
    standing = list(plan.fixed.values())
    movable: dict[str, Movable] = {}
    poses: dict[str, Array] = {}

    def stand(make: str, pose: Array) -> None:
        name = f"{make}_{1 + sum(thing.make == make for thing in movable.values())}"  # type: ignore[attr-defined]
        movable[name], poses[name] = of_make(make), pose
        standing.append(movable[name].at(pose))

    for door in plan.doors:
        if waiting and len(movable) < count - len(rooms) // 2 and rng.random() < settings.blocked:
            make = waiting[int(rng.integers(len(waiting)))]
            pose = _beside(door, make, plan.outline, standing, rng, settings)
            if pose is not None:
                waiting.remove(make)
                stand(make, pose)
    for number, make in enumerate(waiting):
        for shift in range(len(rooms)):
            pose = _inside(rooms[(number + shift) % len(rooms)], make, standing, rng, settings)
            if pose is not None:
                stand(make, pose)
                break
    return movable, poses


def _beside(
    door: Door, make: str, floor: Polygon, standing: list[Polygon], rng: np.random.Generator, settings: OfficeSettings
) -> Array | None:
    """Draw a free pose (3,) of a thing in a doorway or close to it; None if there is none."""
    for _ in range(TRIES):
        across = rng.uniform(-BESIDE_DOOR, BESIDE_DOOR) + np.sign(rng.uniform(-1.0, 1.0)) * 0.3
        along = rng.uniform(-0.3, 0.3) * door.width
        offset = (across, along) if door.upright else (along, across)
        pose = np.array([door.x + offset[0], door.y + offset[1], _heading(rng, settings)])
        if _free(make, pose, floor, standing, settings):
            return pose
    return None


def _inside(
    room: Polygon, make: str, standing: list[Polygon], rng: np.random.Generator, settings: OfficeSettings
) -> Array | None:
    """Draw a free pose (3,) of a thing in a room; None if there is none."""
    low, high = np.reshape(room.bounds, (2, 2))
    for _ in range(TRIES):
        pose = np.array([*rng.uniform(low, high), _heading(rng, settings)])
        if _free(make, pose, room, standing, settings):
            return pose
    return None


def _heading(rng: np.random.Generator, settings: OfficeSettings) -> float:
    """Draw how a thing is turned [rad]: mostly along a wall."""
    square = float(rng.integers(4)) * math.pi / 2.0 - math.pi / 2.0 + float(rng.normal(0.0, settings.askew))
    any_way = float(rng.uniform(-math.pi, math.pi))
    return square if rng.random() < settings.squared else any_way


def _free(make: str, pose: Array, floor: Polygon, standing: list[Polygon], settings: OfficeSettings) -> bool:
    """Say whether a thing can stand at a pose (3,): inside, and clear of what stands there by the gap."""
    outline = of_make(make).at(pose)
    if not floor.covers(outline):
        return False
    return not shapely.dwithin(np.array(standing, dtype=object), outline, settings.gap).any()


def _start_and_goal(
    scene: NamoScene, rng: np.random.Generator, move_needed: bool, settings: OfficeSettings
) -> tuple[Array, Array] | None:
    """Draw start (3,) and goal (3,); None if no pair that was drawn is as asked."""
    roomy = free_space(scene, scene.robot.radius + settings.clearance)
    drive, empty = free_space(scene), free_space(scene, drive_radius(scene.robot), leave_out=scene.movable)
    if not roomy.regions:
        return None
    starts, goals = (_points(roomy, PAIRS, rng) for _ in range(2))
    far = np.hypot(*(goals - starts).T) >= settings.apart
    possible = empty.indices(starts) == empty.indices(goals)
    apart = drive.indices(starts) != drive.indices(goals)
    fitting = np.flatnonzero(far & possible & (apart | (not move_needed)))
    if len(fitting) == 0:
        return None
    headings = rng.uniform(-math.pi, math.pi, 2)
    chosen = fitting[0]
    return np.array([*starts[chosen], headings[0]]), np.array([*goals[chosen], headings[1]])


def _points(free: FreeSpace, count: int, rng: np.random.Generator) -> Array:
    """Draw points (count, 2), each region as often as it is large."""
    areas = np.array([region.area for region in free.regions])
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())
    points = np.zeros((count, 2))
    for number, region in enumerate(free.regions):
        rows = np.flatnonzero(chosen == number)
        low, high = np.reshape(region.bounds, (2, 2))
        while len(rows):
            drawn = rng.uniform(low, high, (len(rows), 2))
            inside = shapely.contains_xy(region, *drawn.T)
            points[rows[inside]] = drawn[inside]
            rows = rows[~inside]
    return points
