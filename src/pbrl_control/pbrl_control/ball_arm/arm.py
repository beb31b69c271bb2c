"""Kinematics of an arm with a ball at the end of a rod that points down: closed form both ways.

Turn, shoulder, elbow and wrist; the three bends lie in one vertical plane. With the rod upright, a place of the ball
is one of the wrist, and that a triangle of upper arm and forearm; of its two solutions the elbow is the upper corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, wrap

JOINTS = ("arm_yaw", "arm_shoulder", "arm_elbow", "arm_wrist")
BALL = "ball"


@dataclass(frozen=True)
class Place:
    """Where the ball is, about the arm's own column.

    Attributes:
        yaw: of the plane of the arm, in `world` [rad].
        radius: from the column [m].
        height: of the ball's centre over the table [m].
    """

    yaw: float
    radius: float
    height: float


class BallArm:
    """The arm where it stands.

    Attributes:
        base: (3,) pose of its column in `world` [m, rad].
        lower, upper: (4,) limits of the joints [rad].
        velocity: (4,) [rad/s].
    """

    def __init__(self, urdf: str, base: Array) -> None:
        """Take the lengths from a description.

        Args:
            urdf: its text.
            base: where `arm_base` stands, (3,) in `world` [m, rad].

        Raises:
            ControlError: the text is no URDF, or not that of such an arm.
        """
        try:
            model = pin.buildModelFromXML(urdf)
        except (ValueError, RuntimeError) as error:
            raise ControlError(f"robot description: expected URDF text, got {urdf[:40]!r}: {error}") from error
        if tuple(model.names[1:]) != JOINTS or not model.existFrame(BALL):
            raise ControlError(
                f"robot description: expected the joints {', '.join(JOINTS)} and a frame {BALL!r}, "
                f"got {', '.join(model.names[1:])}"
            )
        self.base = np.array(base, dtype=float)
        if self.base.shape != (3,) or not np.isfinite(self.base).all():
            raise ControlError(f"arm: expected a finite base (x, y, theta), got {self.base.tolist()}")
        offsets = [np.array(model.jointPlacements[k].translation) for k in (1, 2, 3, 4)]
        self._column = float(offsets[0][2] + offsets[1][2])
        self._upper, self._fore = float(offsets[2][0]), float(offsets[3][0])
        self._rod = -float(model.frames[model.getFrameId(BALL)].placement.translation[2])
        self.lower, self.upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
        self.velocity = np.array(model.velocityLimit)

    @classmethod
    def from_file(cls, path: Path, base: Array) -> BallArm:
        """Read the URDF at `path`; raise ControlError where there is none."""
        try:
            return cls(path.read_text(encoding="utf-8"), base)
        except OSError as error:
            raise ControlError(f"robot description: expected a readable URDF file, got {path}: {error}") from error

    def reach(self, height: float) -> tuple[float, float]:
        """Return least and most radius [m] at which the ball can be at a height [m] over the table."""
        rise = height + self._rod - self._column
        folded = min(self.upper[2], -self.lower[2]) if self.upper[2] > 0.0 else -self.lower[2]
        near = self._upper**2 + self._fore**2 + 2.0 * self._upper * self._fore * math.cos(folded)
        far = (self._upper + self._fore) ** 2
        if rise * rise >= far:
            raise ControlError(f"arm: expected a height that it reaches, got {height} m")
        return math.sqrt(max(near - rise * rise, 0.0)), math.sqrt(far - rise * rise)

    def place(self, point: Array) -> Place:
        """Return a point (3,) of `world` about the column; the heights are those over the table."""
        away = np.asarray(point[:2]) - self.base[:2]
        return Place(math.atan2(away[1], away[0]), float(np.hypot(*away)), float(point[2]))

    def point(self, place: Place) -> Array:
        """Return the point (3,) in `world` of a place."""
        return np.array(
            [
                self.base[0] + place.radius * math.cos(place.yaw),
                self.base[1] + place.radius * math.sin(place.yaw),
                place.height,
            ]
        )

    def joints(self, place: Place) -> Array:
        """Return the joint angles (4,) [rad] that bring the ball to a place, the rod upright.

        Raises:
            ControlError: it is out of reach; how far it reaches there is told.
        """
        rise = place.height + self._rod - self._column
        square = place.radius**2 + rise**2
        bend = (square - self._upper**2 - self._fore**2) / (2.0 * self._upper * self._fore)
        if not (place.radius > 0.0 and abs(bend) <= 1.0):
            raise ControlError(self._out_of_reach(place))
        elbow = -math.acos(bend)
        shoulder = math.atan2(rise, place.radius) - math.atan2(
            self._fore * math.sin(elbow), self._upper + self._fore * math.cos(elbow)
        )
        found = np.array([wrap(place.yaw - self.base[2]), shoulder, elbow, -shoulder - elbow])
        if ((found < self.lower) | (found > self.upper)).any():
            raise ControlError(self._out_of_reach(place))
        return found

    def ball(self, joints: Array) -> Place:
        """Return where the ball is with the joints (4,) at some angles [rad]."""
        yaw, shoulder, elbow, wrist = (float(angle) for angle in joints)
        fore, rod = shoulder + elbow, shoulder + elbow + wrist
        radius = self._upper * math.cos(shoulder) + self._fore * math.cos(fore) + self._rod * math.sin(rod)
        height = self._column + self._upper * math.sin(shoulder) + self._fore * math.sin(fore)
        return Place(wrap(yaw + self.base[2]), radius, height - self._rod * math.cos(rod))

    def _out_of_reach(self, place: Place) -> str:
        near, far = self.reach(place.height)
        return (
            f"arm: expected a place {near:.2f} to {far:.2f} m from its column at a height of {place.height:.2f} m, "
            f"got {place.radius:.2f} m"
        )
