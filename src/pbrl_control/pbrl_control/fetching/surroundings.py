"""What stands around the robot, and where: room, built-in things as told, all else as its tag shows it or was felt."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import shapely

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.navigation.struck import Struck
from pbrl_control.percept import BodyShape, Percept, object_planar
from pbrl_control.planar import Array, wrap

JUMP, JUMP_YAW = 0.05, 0.1  # [m, rad] from where it was: it has moved, nothing to be averaged
LONGEST_PERIOD = 0.2  # [s] that one sighting stands for at most
SET_BACK = 1.0  # [s] that a tag is older than the one before where the clock was set back
REDRAW, REDRAW_YAW = 0.003, 0.003  # [m, rad] that something moves before the map is drawn anew: gaps are narrow


class Surroundings:
    """Poses of known bodies, averaged while they stand, and the map they make.

    Args:
        smoothing: [s] time constant of the average.
        struck: what nobody sees, but the base has been stopped by; None: nothing yet.

    Attributes:
        struck: as given; what is added to it is on the map.
    """

    def __init__(self, smoothing: float, struck: Struck | None = None) -> None:
        self._smoothing = smoothing
        self.struck = Struck() if struck is None else struck
        self._room: Array | None = None
        self._fixed: dict[str, Array] = {}
        self._seen: dict[str, tuple[float, Array]] = {}  # time of the last tag [s] and averaged pose (3,)
        self._shapes: Mapping[str, BodyShape] = {}
        self._drawn: tuple[dict[str, Array], Mapping[str, shapely.Polygon], FloorMap] | None = None

    def told(self, room: Array | None, fixed: Mapping[str, Array]) -> None:
        """Take in what wears no tag.

        Args:
            room: corners (k, 2) of the free floor in `world` [m]; None: unbounded.
            fixed: pose (3,) in `world` of each body that is built in [m, rad].
        """
        self._room, self._fixed, self._drawn = room, dict(fixed), None

    def take(self, percept: Percept) -> None:
        """Take in shapes and tags; tags that are not new or not finite are left out.

        One that is older by much is of a clock that was set back, and nothing is averaged with what was before.
        """
        self._shapes = percept.bodies
        for name in percept.bodies:
            tag = percept.tags.get(name)
            if tag is None or not tag.finite():
                continue
            time, before = self._seen.get(name, (-math.inf, None))
            if tag.time < time - SET_BACK:
                time, before = -math.inf, None
            if tag.time <= time:
                continue
            pose = object_planar(tag)
            if before is not None and not _apart(pose, before, JUMP, JUMP_YAW):
                share = 1.0 - math.exp(-min(tag.time - time, LONGEST_PERIOD) / self._smoothing)
                pose = before + share * _difference(pose, before)
            self._seen[name] = (tag.time, pose)

    def pose(self, name: str) -> Array | None:
        """Return the pose (3,) of a body in `world` [m, rad]; None where it has never been seen and nobody told."""
        seen = self._seen.get(name)
        return self._fixed.get(name) if seen is None else seen[1]

    def age(self, name: str, now: float) -> float:
        """Return how long ago [s] a body's tag was seen; infinite where it never was.

        Of a stamp ahead of `now` it is how far it is ahead: such a tag was seen before the clock was set back.
        """
        return abs(now - self._seen[name][0]) if name in self._seen else math.inf

    def height(self, name: str) -> float:
        """Return the height of a known body [m]."""
        return self._shapes[name].height

    def beside(self, point: Array, within: float) -> list[str]:
        """Return which known bodies a point (2,) in `world` is in, or nearer to than `within` [m]."""
        place, outlines = shapely.Point(point), self.floor().obstacles
        return [name for name in self._shapes if name in outlines and outlines[name].dwithin(place, within)]

    def unplaced(self) -> list[str]:
        """Return which known bodies have no pose."""
        return [name for name in self._shapes if self.pose(name) is None]

    def floor(self) -> FloorMap:
        """Return the map as it is known now; the same one as before while nothing has moved.

        Raises:
            ControlError: a body has no pose, or an outline is no polygon.
        """
        poses = {name: pose for name in self._shapes if (pose := self.pose(name)) is not None}
        struck = self.struck.outlines
        if self._drawn is not None:
            drawn, felt, floor = self._drawn
            same = drawn.keys() == poses.keys() and felt is struck
            if same and not any(_apart(pose, drawn[name], REDRAW, REDRAW_YAW) for name, pose in poses.items()):
                return floor
        floor = FloorMap.of_scene(self._room, self._shapes, poses)
        floor = FloorMap(floor.room, {**floor.obstacles, **struck}) if struck else floor
        self._drawn = (poses, struck, floor)
        return floor


def _difference(a: Array, b: Array) -> Array:
    return np.array([a[0] - b[0], a[1] - b[1], wrap(float(a[2] - b[2]))])


def _apart(a: Array, b: Array, distance: float, yaw: float) -> bool:
    away = _difference(a, b)
    return bool(np.hypot(away[0], away[1]) > distance or abs(away[2]) > yaw)
