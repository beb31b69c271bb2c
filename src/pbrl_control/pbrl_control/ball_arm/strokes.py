"""Strokes: the ball is taken over a place, lowered, pushed straight along the table, lifted, and taken out of sight.

Every part is a minimum-jerk motion (Flash and Hogan 1985) between two places, straight where the ball is low and about
the column where it is high, sampled through the arm's inverse kinematics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from pbrl_control.ball_arm.arm import BallArm, Place
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, wrap
from pbrl_control.settings import Positive, Section

PEAK = 15.0 / 8.0
"""Greatest speed of a minimum-jerk motion over its mean."""


class StrokeSettings(Section):
    """How the ball goes.

    Attributes:
        period: [s] between two samples.
        height: [m] of the ball's centre over the table while it is taken from place to place.
        low: [m] of it while it pushes.
        push_speed: [m/s] greatest while it pushes.
        lower_speed: [m/s] greatest on its way down and up.
        share: of the joints' speed limits that is used while it is taken from place to place.
        settle: [s] that it stands after a push.
        stowed_radius: [m] from the column, beside which the ball waits, off the table.
    """

    period: Positive = 0.01
    height: Positive = 0.12
    low: Positive = 0.015
    push_speed: Positive = 0.08
    lower_speed: Positive = 0.3
    share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.6
    settle: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    stowed_radius: Positive = 0.25


@dataclass(frozen=True)
class Stroke:
    """Joint angles to be followed.

    Attributes:
        joints: (k, 4) [rad], one each period.
        period: [s].
    """

    joints: Array
    period: float

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return len(self.joints) * self.period

    def then(self, other: Stroke) -> Stroke:
        """Return one after the other."""
        return Stroke(np.concatenate((self.joints, other.joints)), self.period)


class Strokes:
    """Plans strokes for one arm.

    Args:
        arm: that moves.
        settings: how.
    """

    def __init__(self, arm: BallArm, settings: StrokeSettings | None = None) -> None:
        self.arm, self.settings = arm, settings or StrokeSettings()

    @property
    def stowed(self) -> Place:
        """Where the ball waits: to the right of the column, as seen along its frame's x."""
        return Place(wrap(float(self.arm.base[2]) - math.pi / 2.0), self.settings.stowed_radius, self.settings.height)

    def stow(self, joints: Array) -> Stroke:
        """Take the ball out of sight, from where the joints (4,) are now [rad]."""
        here = self.arm.ball(joints)
        high = Place(here.yaw, here.radius, self.settings.height)
        return self._joined([*self._upright(here, high), self._carried(high, self.stowed)])

    def push(self, joints: Array, path: Array) -> Stroke:
        """Push along a path, and stop there with the ball still low.

        Args:
            joints: (4,) where the arm is now [rad].
            path: (2, 2) where the ball's centre begins and ends, in `world` [m].

        Raises:
            ControlError: a part of it is out of reach.
        """
        if np.shape(path) != (2, 2) or not np.isfinite(path).all():
            raise ControlError(f"stroke: expected two finite points (2, 2), got {path}")
        here = self.arm.ball(joints)
        begin, end = (self.arm.place(np.append(point, self.settings.low)) for point in np.asarray(path, dtype=float))
        lifted = Place(here.yaw, here.radius, self.settings.height)
        above = Place(begin.yaw, begin.radius, self.settings.height)
        parts = [*self._upright(here, lifted), self._carried(lifted, above), *self._upright(above, begin)]
        parts.append(self._straight(begin, end, self.settings.push_speed))
        still = round(self.settings.settle / self.settings.period)
        return self._joined([*parts, np.repeat(parts[-1][-1:], still, axis=0)])

    def _joined(self, parts: Sequence[Array]) -> Stroke:
        return Stroke(np.concatenate(parts), self.settings.period)

    def _upright(self, a: Place, b: Place) -> list[Array]:
        """Return the way straight up or down; nothing where there is none to go."""
        return [self._straight(a, b, self.settings.lower_speed)] if abs(a.height - b.height) > 1e-6 else []

    def _straight(self, a: Place, b: Place, speed: float) -> Array:
        first, last = self.arm.point(a), self.arm.point(b)
        duration = PEAK * float(np.linalg.norm(last - first)) / speed
        return self._timed(lambda share: self.arm.place(first + share * (last - first)), duration)

    def _carried(self, a: Place, b: Place) -> Array:
        """Return the way about the column, as fast as the joints may."""
        turn = self._turn(a.yaw, b.yaw)

        def at(share: float) -> Place:
            return Place(
                a.yaw + share * turn,
                a.radius + share * (b.radius - a.radius),
                a.height + share * (b.height - a.height),
            )

        duration = 20.0 * self.settings.period
        limit = self.settings.share * self.arm.velocity
        for _ in range(8):
            joints = self._timed(at, duration)
            fastest = float((np.abs(np.diff(joints, axis=0)) / self.settings.period / limit).max())
            if fastest <= 1.001:
                break
            duration *= max(fastest, 1.01)
        return joints

    def _turn(self, a: float, b: float) -> float:
        """Return how far the column turns from one yaw to another: never past where its angle jumps."""
        base = float(self.arm.base[2])
        return wrap(b - base) - wrap(a - base)

    def _timed(self, at: Callable[[float], Place], duration: float) -> Array:
        count = max(math.ceil(duration / self.settings.period), 1)
        tau = np.arange(1, count + 1) / count
        return np.array([self.arm.joints(at(float(share))) for share in tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)])
