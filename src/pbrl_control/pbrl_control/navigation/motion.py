"""Which motions of a differential base are free: turns in place and straight drives, taken exactly as swept areas."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.navigation.footprint import Footprint
from pbrl_control.planar import Array, wrap

SWING_STEP = 0.05  # [rad] between the headings at which a turn is looked at; 0.2 mm are lost between two


@dataclass(frozen=True)
class MotionChecker:
    """Answers for one robot on one map, with a margin kept around it.

    Attributes:
        floor: the map.
        footprint: of the robot.
        margin: [m]; below zero: something that reaches less far into the robot's way is not in it.
    """

    floor: FloorMap
    footprint: Footprint
    margin: float = 0.03
    _roomy: BaseGeometry = field(init=False, repr=False, compare=False)
    _turning: BaseGeometry = field(init=False, repr=False, compare=False)
    _passable: tuple[BaseGeometry, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        roomy = self.floor.free.buffer(-self.margin) if self.margin != 0.0 else self.floor.free
        turning = self.floor.free.buffer(-self.footprint.radius - self.margin)
        for name, area in (("_roomy", roomy), ("_turning", turning)):
            shapely.prepare(area)
            object.__setattr__(self, name, area)
        passable = self.floor.free.buffer(-self.footprint.inner_radius - self.margin)
        object.__setattr__(self, "_passable", tuple(shapely.get_parts(passable)))

    def bare(self, slack: float = 0.0) -> MotionChecker:
        """Return the same without the margin, or with what reaches into the robot's way by less than a slack [m]."""
        return MotionChecker(self.floor, self.footprint, -slack)

    def pose_fault(self, pose: Array) -> str:
        """Return what the robot with `base` at the pose (3,) would be in; empty where it is free."""
        covered = Polygon(self.footprint.at(pose))
        return "" if self._roomy.covers(covered) else self.floor.fault(covered.buffer(self.margin)) or "an obstacle"

    def can_turn(self, x: float, y: float) -> bool:
        """Say whether the robot can turn all the way round with `base` at x, y [m]."""
        return bool(shapely.intersects_xy(self._turning, x, y))

    def connected(self, a: Array, b: Array) -> bool:
        """Say whether the circle inside the robot can get from a (2,) to b (2,): where not, the robot cannot."""
        return any(area.intersects(shapely.Point(a)) and area.intersects(shapely.Point(b)) for area in self._passable)

    def can_swing(self, point: Array, start: float, end: float) -> bool:
        """Say whether the robot at point (2,) [m] can turn the shorter way from heading start to end [rad]."""
        headings = start + np.linspace(0.0, 1.0, math.ceil(abs(wrap(end - start)) / SWING_STEP) + 2) * wrap(end - start)
        placed = np.array([self.footprint.at(np.array([*point, heading])) for heading in headings])
        pairs = np.concatenate((placed[:-1], placed[1:]), axis=1)
        return bool(shapely.covers(self._roomy, shapely.convex_hull(shapely.multipoints(pairs))).all())

    def can_drive(self, start: Array, end: Array, *, reverse: bool = False) -> bool:
        """Say whether driving straight from start (2,) to end (2,) is free, facing there or away from there."""
        return self._roomy.covers(self.footprint.swept(start, end, drive_heading(start, end, reverse=reverse)))

    def drive_fault(self, start: Array, end: Array, heading: float) -> str:
        """Return what is in the way from start (2,) to end (2,) at a heading [rad]; empty where nothing is."""
        covered = self.footprint.swept(start, end, heading)
        return "" if self._roomy.covers(covered) else self.floor.fault(covered.buffer(self.margin)) or "an obstacle"


def drive_heading(start: Array, end: Array, *, reverse: bool = False) -> float:
    """Return the heading [rad] of the base while it drives from start (2,) to end (2,)."""
    x, y = np.asarray(end) - np.asarray(start)
    return math.atan2(-y, -x) if reverse else math.atan2(y, x)
