"""A path of a differential base: turn, drive straight, turn, drive straight, and turn to the goal's heading."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbrl_control.navigation.motion import drive_heading
from pbrl_control.planar import Array, wrap


@dataclass(frozen=True)
class Leg:
    """A straight drive, after turning in place to its heading.

    Attributes:
        start, end: (2,) in `world` [m].
        reverse: driven backwards.
    """

    start: Array
    end: Array
    reverse: bool = False

    @property
    def heading(self) -> float:
        """Heading of the base along the leg [rad]."""
        return drive_heading(self.start, self.end, reverse=self.reverse)

    @property
    def length(self) -> float:
        """Distance [m]."""
        return float(np.hypot(*(self.end - self.start)))


@dataclass(frozen=True)
class BasePath:
    """The way from a pose to a pose.

    Attributes:
        start, goal: (3,) x, y, theta in `world` [m, rad]; the last leg ends at the goal exactly.
        legs: none where start and goal differ in heading alone.
    """

    start: Array
    goal: Array
    legs: tuple[Leg, ...]

    @property
    def length(self) -> float:
        """Distance driven [m]."""
        return sum(leg.length for leg in self.legs)

    @property
    def turning(self) -> float:
        """Sum of all turns in place [rad]."""
        headings = [float(self.start[2]), *(leg.heading for leg in self.legs), float(self.goal[2])]
        return sum(abs(wrap(after - before)) for before, after in pairwise(headings))

    def poses(self, step: float = 0.1, turn: float = 0.2) -> Array:
        """Return poses (n, 3) along the path, at most `step` [m] and `turn` [rad] apart."""
        found = [np.asarray(self.start, dtype=float)]
        for leg in self.legs:
            _turn(found, leg.heading, turn)
            for share in np.linspace(0.0, 1.0, max(int(np.ceil(leg.length / step)), 1) + 1)[1:]:
                found.append(np.array([*(leg.start + share * (leg.end - leg.start)), leg.heading]))
        _turn(found, float(self.goal[2]), turn)
        return np.array(found)


def _turn(poses: list[Array], heading: float, most: float) -> None:
    x, y, theta = poses[-1]
    way = wrap(heading - theta)
    for share in np.linspace(0.0, 1.0, int(np.ceil(abs(way) / most)) + 1)[1:]:
        poses.append(np.array([x, y, theta + share * way]))
