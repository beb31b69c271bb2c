"""What goes into and comes out of the body controller. SI units, radians, frames as named."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.kinematics import SIDES, Posture
from pbrl_control.planar import Array


@dataclass(frozen=True)
class PlanarTwist:
    """A planar twist, and a lift for a gripper that holds nothing.

    What it is a twist of decides its point and axes: the name of a held object (the object's origin, the
    object's axes), `left_ft` or `right_ft` (the middle of that gripper's plates, its planar axes), or
    `base` (the base, its own axes; vy is no motion that a differential base has and must be zero).
    """

    vx: float = 0.0
    vy: float = 0.0
    omega: float = 0.0
    vz: float = 0.0

    def array(self) -> Array:
        """Return (vx, vy, omega) [m/s, rad/s]."""
        return np.array([self.vx, self.vy, self.omega])

    def finite(self) -> bool:
        """Say whether no component is NaN or infinite."""
        return all(map(math.isfinite, (self.vx, self.vy, self.omega, self.vz)))

    def moves(self) -> bool:
        """Say whether any component is not zero."""
        return any((self.vx, self.vy, self.omega, self.vz))


@dataclass(frozen=True)
class Hold:
    """A gripper holds an object.

    Attributes:
        object: its name.
        contact: (2,) middle of the clamped patch, in the object's frame [m].
        yaw: of the object in the gripper's planar axes, as last seen [rad].
        expected: (3,) wrench that moving the object takes of this grip: fx, fy [N], tau [N m] on the object at the
            contact, object axes; None where nobody knows.
    """

    object: str
    contact: Array
    yaw: float = 0.0
    expected: Array | None = None

    def usable(self) -> bool:
        """Say whether no number of it is NaN or infinite."""
        parts = [*self.contact, self.yaw, *(() if self.expected is None else self.expected)]
        return all(map(math.isfinite, parts))


@dataclass(frozen=True)
class BodyState:
    """What the controller knows of the robot: joint positions."""

    posture: Posture

    def finite(self) -> bool:
        """Say whether no joint position is NaN or infinite."""
        return all(map(math.isfinite, self.posture.vector().tolist()))


@dataclass(frozen=True)
class BodyCommand:
    """Velocities for the whole body.

    Attributes:
        base_v: forward [m/s].
        base_w: yaw rate [rad/s].
        left, right: (7,) joint velocities [rad/s].
        report: why the robot stands still though something else was asked; empty when all is well.
    """

    base_v: float = 0.0
    base_w: float = 0.0
    left: Array = field(default_factory=lambda: np.zeros(7))
    right: Array = field(default_factory=lambda: np.zeros(7))
    report: str = ""

    def moves(self) -> bool:
        """Say whether anything is to move."""
        return bool(self.base_v or self.base_w or np.any(self.left) or np.any(self.right))

    def arm(self, side: str) -> Array:
        """Return the (7,) joint velocities of one arm."""
        return self.left if side == "left" else self.right


Twists = Mapping[str, PlanarTwist]
Holds = Mapping[str, Hold]
Wrenches = Mapping[str, Array]


def gripper_frame(side: str) -> str:
    """Return the name under which a gripper that holds nothing is commanded."""
    return f"{side}_ft"


def known_targets(holds: Holds) -> set[str]:
    """Return everything that a twist can be commanded for while `holds` are closed."""
    return {"base", *(gripper_frame(side) for side in SIDES), *(hold.object for hold in holds.values())}
