"""What one gripper is to do, and how it is laid level."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.kinematics import GripperState
from pbrl_control.planar import Array, cross

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Task:
    """What one gripper is to do over the floor, at the middle of its plates, in base axes.

    Attributes:
        wanted: (3,) planar twist that was asked for [m/s, rad/s].
        lift: that was asked for [m/s].
        added: (6,) twist on top of it, whatever limits leave of what was asked: compliance, level plates, height.
        against: (2,) unit vector against the horizontal force that the gripper feels; zero where there is none.
        room: speed that it may have along that [m/s].
    """

    wanted: Array
    lift: float
    added: Array
    against: Array = field(default_factory=lambda: np.zeros(2))
    room: float = math.inf

    @property
    def planar(self) -> Array:
        """The planar twist (3,) to be had."""
        return self.wanted + self.added[[0, 1, 5]]

    @property
    def twist(self) -> Array:
        """The whole twist (6,) to be had."""
        return self.added + np.array([*self.wanted[:2], self.lift, 0.0, 0.0, self.wanted[2]])


def levelling(gripper: GripperState, gain: float) -> tuple[float, float]:
    """Return the roll and pitch rates [rad/s] that bring plates level; no yaw is in them.

    Args:
        gripper: where it is.
        gain: [1/s].
    """
    tilt = cross(gripper.pose.rotation[:, 2], UP)
    return gain * float(tilt[0]), gain * float(tilt[1])
