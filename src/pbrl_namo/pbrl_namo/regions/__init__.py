"""Free-space regions, a roadmap over them, and the obstacles that separate them (thesis 6.2.1).

`free_space` is exact, `build_roadmap` adds grasp samples and is held to it, `openings` tells which obstacle could be
moved to open a path between which regions, `cut_off` which regions no sequence of that reaches, and `standing_room`
what to move before these are given up.
"""

from pbrl_namo.regions.free_space import FreeSpace, drive_radius, free_space
from pbrl_namo.regions.openings import Opening, cut_off, openings
from pbrl_namo.regions.roadmap import GraspSample, Roadmap, build_roadmap
from pbrl_namo.regions.settings import RegionSettings
from pbrl_namo.regions.standing_room import StandingRoom, standing_room
from pbrl_namo.regions.whereabouts import region_of

__all__ = [
    "FreeSpace",
    "GraspSample",
    "Opening",
    "RegionSettings",
    "Roadmap",
    "StandingRoom",
    "build_roadmap",
    "cut_off",
    "drive_radius",
    "free_space",
    "openings",
    "region_of",
    "standing_room",
]
