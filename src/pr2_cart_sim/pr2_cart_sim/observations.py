"""What the PR2's simulator publishes beyond what every robot's does: plain values, no ROS needed to look at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bullet_sim import observations as shared
from pr2_cart_sim.maps import GridMap

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BaseOdometry:
    """Dead reckoning: pose (3,) x, y, theta of `base` in `odom`; twist (3,) vx, vy [m/s], w [rad/s] in `base`."""

    time: float
    pose: Array
    twist: Array


@dataclass(frozen=True)
class Scan:
    """One scan of a laser, all beams of one moment.

    Attributes:
        time: [s].
        laser: "base" or "tilt".
        frame: of the laser; beams lie in its x-y plane, angle 0 is x.
        angle_min: of the first beam [rad].
        increment: between beams [rad].
        period: between scans [s].
        span: nearest and farthest that is seen [m].
        ranges: (n,) [m]; infinite where nothing is.
        tilt: angle of the nodding joint [rad], 0 for the base's laser; frames have it too.
    """

    time: float
    laser: Literal["base", "tilt"]
    frame: str
    angle_min: float
    increment: float
    period: float
    span: tuple[float, float]
    ranges: Array
    tilt: float

    def points(self) -> Array:
        """Give what was hit, (k, 2) [m] in the laser's frame; beams that hit nothing are left out."""
        angles = self.angle_min + self.increment * np.arange(len(self.ranges))
        seen = np.isfinite(self.ranges)
        return self.ranges[seen, None] * np.column_stack([np.cos(angles[seen]), np.sin(angles[seen])])


@dataclass(frozen=True)
class Localisation:
    """Pose (3,) x, y, theta of `base` in `map`, as a localiser has it, and its standard deviations (3,)."""

    time: float
    pose: Array
    sigma: Array


@dataclass(frozen=True)
class CartReading:
    """Pose (3,) x, y, theta of the cart in `base`.

    Attributes:
        time: [s].
        source: `hands`: where the hands are that hold it; `checkerboard`: where the camera sees its board.
        cart: name of the body.
        pose: (3,) [m], [rad].
        misfit: of `hands`: by how much the hands' distance differs from that of what they hold [m]; NaN where it cannot
            be told.
    """

    time: float
    source: Literal["hands", "checkerboard"]
    cart: str
    pose: Array
    misfit: float


@dataclass(frozen=True)
class KnownMap:
    """The map that everybody has; what is not in it has to be seen."""

    time: float
    grid: GridMap


Observation: TypeAlias = shared.Observation | BaseOdometry | Scan | Localisation | CartReading | KnownMap
"""Anything the simulator publishes."""
