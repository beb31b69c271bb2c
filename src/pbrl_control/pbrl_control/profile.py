"""The twist of an object over the segments of a plan, with bounded accelerations."""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array, shift, turn
from pbrl_control.push_plan import PushPlan, Segment
from pbrl_control.types import Hold


def to_object(twist: Array, hold: Hold) -> Array:
    """Return the twist (3,) of the object's origin in its axes, from that of the contact in gripper axes."""
    return shift(turn(twist, -hold.yaw), -np.asarray(hold.contact))


def to_gripper(twist: Array, hold: Hold) -> Array:
    """Return the twist (3,) of the contact in gripper axes, from that of the object's origin in its axes."""
    return turn(shift(twist, np.asarray(hold.contact)), hold.yaw)


class TwistProfile:
    """Steps through the segments; each begins where the one before left off and the last ends at rest."""

    def __init__(self, plan: PushPlan) -> None:
        self._plan = plan
        self._rates = np.array([plan.acceleration, plan.acceleration, plan.yaw_acceleration])
        self._twist = np.zeros(3)  # in the frame of the current segment
        self._elapsed = 0.0  # in the current segment
        self.segment = 0

    @property
    def finished(self) -> bool:
        """Whether the last segment is over."""
        return self.segment >= len(self._plan.segments)

    def step(self, dt: float, hold: Hold) -> Array:
        """Go on by `dt` [s]; return the twist (3,) of the object's origin in its axes [m/s, rad/s]."""
        if self.finished:
            return np.zeros(3)
        segment = self._plan.segments[self.segment]
        change = self._rates * dt
        self._twist = np.clip(self._target(segment), self._twist - change, self._twist + change)
        twist = to_object(self._twist, hold) if segment.frame == "gripper" else self._twist.copy()
        self._elapsed += dt
        if self._elapsed >= segment.duration:
            self._next(segment, twist, hold)
        return twist

    def _target(self, segment: Segment) -> Array:
        last = self.segment == len(self._plan.segments) - 1
        ramp = float(np.max(np.abs(self._twist) / self._rates))
        return np.zeros(3) if last and segment.duration - self._elapsed <= ramp else np.array(segment.twist)

    def _next(self, segment: Segment, twist: Array, hold: Hold) -> None:
        self._elapsed -= segment.duration
        self.segment += 1
        if not self.finished and self._plan.segments[self.segment].frame != segment.frame:
            self._twist = to_gripper(twist, hold) if segment.frame == "object" else twist.copy()
