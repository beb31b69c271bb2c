"""Whether an obstacle that is being moved has left an opening yet (thesis 6.4: any state that creates one will do)."""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.free_space import drive_radius, free_space
from pbrl_namo.regions.whereabouts import region_of
from pbrl_namo.scene import NamoScene

SPARE = 0.03
"""Added to the radius that plans are made with [m]: an opening just wide enough might be none to the next plan."""

MOST = 0.5
"""Share of the points of a region that have to be reached: what was moved may stand among them and cut some off."""


class OpenByFreeSpace:
    """Asks the exact free space, as regions were found with.

    Args:
        radius: of the disc that stands for the robot [m]; None: the robot's own, see `drive_radius`.
        spare: added to it [m].
    """

    def __init__(self, radius: float | None = None, spare: float = SPARE) -> None:
        self._radius, self._spare = radius, spare

    def __call__(self, scene: NamoScene, targets: Array) -> bool:
        """Say whether the robot can get from the scene's start to most of the points (k, 2) in `world` [m].

        Points where there is no room for it any more do not count. Nor does an opening while what is moved stands
        where the robot is to be in the end.
        """
        radius = drive_radius(scene.robot) if self._radius is None else self._radius
        free = free_space(scene, radius + self._spare)
        try:
            here = region_of(scene, free, scene.start)
        except NamoError:  # it is before the object that it holds, where there is no room to drive
            return False
        places = free.indices(np.asarray(targets, dtype=float).reshape(-1, 2))
        known = places[places >= 0]
        return len(known) > 0 and float(np.mean(known == here)) >= MOST and _may_end(scene, radius)


def _may_end(scene: NamoScene, radius: float) -> bool:
    """Say whether there is room at the goal."""
    try:
        region_of(scene, free_space(scene, radius), scene.goal, "goal")
    except NamoError:
        return False
    return True
