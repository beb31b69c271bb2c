"""Whether an obstacle that is being moved has left an opening yet (thesis 6.4: any state that creates one will do)."""

from __future__ import annotations

import numpy as np
import shapely

from pbrl_control.planar import Array
from pbrl_control.trajectories.trajectory import move as moved
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import Move
from pbrl_namo.regions.free_space import drive_radius, free_space
from pbrl_namo.regions.whereabouts import region_of
from pbrl_namo.scene import NamoScene

SPARE = 0.03
"""Added to the radius that plans are made with [m]: an opening just wide enough might be none to the next plan."""

MOST = 0.5
"""Share of the points of a region that have to be reached: what was moved may stand among them and cut some off."""


SHORTENED = 0.02
"""Of the planned way, by which it is tried to go less far beyond it."""


class OpenByFreeSpace:
    """Asks the exact free space, as regions were found with.

    Args:
        radius: of the disc that stands for the robot [m]; None: the robot's own, see `drive_radius`.
        spare: added to it [m]; less, where what is moved comes as near to the goal as that.
    """

    def __init__(self, radius: float | None = None, spare: float = SPARE) -> None:
        self._radius, self._spare = radius, spare

    def __call__(self, scene: NamoScene, targets: Array) -> bool:
        """Say whether the robot can get from the scene's start to most of the points (k, 2) in `world` [m].

        Points where there is no room for it any more do not count. Nor does an opening while what is moved stands
        where the robot is to be in the end.
        """
        radius = drive_radius(scene.robot) if self._radius is None else self._radius
        free = free_space(scene, radius + min(self._spare, max(_room_at(scene, scene.goal) - radius, 0.0)))
        try:
            here = region_of(scene, free, scene.start)
        except NamoError:  # it is before the object that it holds, where there is no room to drive
            return False
        places = free.indices(np.asarray(targets, dtype=float).reshape(-1, 2))
        known = places[places >= 0]
        return len(known) > 0 and float(np.mean(known == here)) >= MOST and _may_end(scene, radius)


def stretch_of(move: Move, scene: NamoScene, most: float) -> float:
    """Return how much further than planned a thing may be moved, so that it does not end up where the robot is to.

    Args:
        move: as planned.
        scene: with the thing where it is.
        most: wanted.

    Returns:
        1 to `most`; `most` where it ends there as planned too.
    """
    thing, room = move.object, drive_radius(scene.robot)
    pose = scene.poses[thing]
    for twist, duration in move.segments[:-1]:
        pose = moved(pose, np.asarray(twist) * duration)
    last, duration = move.segments[-1]

    def clear(stretch: float) -> bool:
        there = moved(pose, np.asarray(last) * duration * stretch)
        return scene.movable[thing].at(there).distance(shapely.Point(scene.goal[:2])) >= room

    if not clear(1.0):
        return most
    return next((s for s in np.arange(most, 1.0, -SHORTENED).tolist() if clear(s)), 1.0)


def _room_at(scene: NamoScene, pose: Array) -> float:
    """Return how far what may be moved is from a place [m]."""
    place = shapely.Point(pose[:2])
    return min((outline.distance(place) for outline in scene.outlines.values()), default=np.inf)


def _may_end(scene: NamoScene, radius: float) -> bool:
    """Say whether there is room at the goal."""
    try:
        region_of(scene, free_space(scene, radius), scene.goal, "goal")
    except NamoError:
        return False
    return True
