"""In which region a robot is, or is to be; where it is in none, why, in words."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import Point, Polygon

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.free_space import FreeSpace
from pbrl_namo.scene import NamoScene

STEP, MOST = 0.05, 1.5
"""Steps and length of the straight ways that lead out of where the disc has no room [m]."""


def region_of(scene: NamoScene, free: FreeSpace, pose: Array, what: str = "start") -> int:
    """Return the region that a pose belongs to.

    A robot may stand where the disc that is taken for it on its way does not fit: beside a wall, or in a niche that it
    has backed into. Such a pose belongs to the region that is reached straight ahead or straight back from it.

    Args:
        scene: things where they stand.
        free: its free space.
        pose: (3,) of the base in `world`; a heading of NaN is any [m, rad].
        what: "start" or "goal", for the message.

    Raises:
        NamoError: the pose is out of the room, in something, or in no region and none is reached straight from it.
    """
    region = free.index(pose)
    if region is not None:
        return region
    fault = _fault(scene, free.radius, pose)
    if fault:
        raise NamoError(f"{what}: {fault}")
    exits = _straight_exit(scene, free, pose)
    if exits is None:
        raise NamoError(
            f"{what}: expected room for the robot to drive away from {_place(pose)}, got none within {MOST} m straight "
            f"ahead or back; move the {what}"
        )
    return exits


def _fault(scene: NamoScene, radius: float, pose: Array) -> str:
    """Return what the robot would be in at a pose (3,), in words; empty where it can stand there."""
    place, middle = _place(pose), Point(pose[:2])
    if not scene.room.covers(middle):
        return f"expected a place in the room, got {place} outside of it"
    things = {**scene.fixed, **scene.outlines}
    for name, outline in things.items():
        if outline.intersects(middle):
            return f"expected free floor, got {place} in {name!r}; choose a place beside it"
    if not math.isnan(pose[2]):
        covered = Polygon(scene.robot.at(pose))
        if not scene.room.covers(covered):
            return f"in collision: expected the whole robot in the room, it would be in the walls at {place}"
        hit = [name for name, outline in things.items() if outline.intersection(covered).area > 0.0]
        return (
            f"in collision: expected the robot clear of everything, it would be in {hit[0]!r} at {place}" if hit else ""
        )
    walls = scene.room.exterior.distance(middle)
    nearest = min(things, key=lambda name: things[name].distance(middle), default="")
    near = things[nearest].distance(middle) if nearest else math.inf
    by = (f"{nearest!r}", near) if near < walls else ("a wall", walls)
    return f"expected {radius:.2f} m of room around {place}, got {by[1]:.2f} m to {by[0]}; choose a place further off"


def _straight_exit(scene: NamoScene, free: FreeSpace, pose: Array) -> int | None:
    """Return the region reached first by driving straight ahead or back from a pose (3,); None if none is."""
    floor = scene.floor().free
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    for distance in STEP * np.arange(1, round(MOST / STEP) + 1):
        for sign in (1.0, -1.0):
            end = pose[:2] + sign * distance * ahead
            region = free.index(end)
            if region is not None and shapely.covers(floor, scene.robot.swept(pose[:2], end, float(pose[2]))):
                return region
    return None


def _place(pose: Array) -> str:
    return f"({pose[0]:.2f}, {pose[1]:.2f})"
