"""The last gate before the drives: whatever was computed, no command leaves that breaks a limit.

A body velocity is (base forward [m/s], base yaw [rad/s], left arm (7,), right arm (7,) [rad/s]).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pbrl_control.kinematics import SIDES, JointLimits
from pbrl_control.limits_kernel import velocity_range
from pbrl_control.planar import Array
from pbrl_control.settings import ArmSettings, BaseSettings

WIDTH = 16  # numbers in a body velocity
LONGEST = 0.1  # [s] period that a command may have to last


class BodyGate:
    """Bounds speeds, their changes and the positions they lead to; keeps the last command.

    Args:
        base: of the differential base.
        arm: of either arm.
        joints: of both arms, from the robot's description.
    """

    def __init__(self, base: BaseSettings, arm: ArmSettings, joints: Mapping[str, JointLimits]) -> None:
        self.last = np.zeros(WIDTH)
        both = [joints[side] for side in SIDES]
        margin = arm.joint_margin
        self._lower = np.concatenate([each.lower + margin for each in both])
        self._upper = np.concatenate([each.upper - margin for each in both])
        speeds = [np.array([base.speed, base.yaw_rate]), *(arm.velocity_fraction * each.velocity for each in both)]
        self._ceiling = np.concatenate(speeds)
        self._forward = min(base.speed, base.forward_speed)
        self._change = np.array([base.acceleration, base.yaw_acceleration, *[arm.acceleration] * 14])

    def stop(self) -> None:
        """Forget the last command: the body was told to stand."""
        self.last = np.zeros(WIDTH)

    def range(self, joints: Array, dt: float) -> tuple[Array, Array]:
        """Return lowest and highest body velocity (16,) that may be sent now.

        A joint's speed towards its stop is one from which its acceleration limit still brakes in time, a
        period of `LONGEST` later. Where a joint is past its margin it may not go on, however fast it was.

        Args:
            joints: (14,) positions, left then right [rad].
            dt: period since the last command [s].
        """
        low, high = np.empty(WIDTH), np.empty(WIDTH)
        velocity_range(self.last, joints, self._lower, self._upper, self._ceiling, self._change, LONGEST, dt, low, high)
        high[0] = min(high[0], self._forward)
        return low, high

    def commit(self, velocity: Array, low: Array, high: Array) -> Array:
        """Remember what is sent and return it: within the range, or rest where it is not finite."""
        if math.isfinite(velocity.sum()):
            self.last = np.minimum(np.maximum(velocity, low), high)
        else:
            self.stop()
        return self.last


def usable_period(dt: float) -> bool:
    """Say whether a control period makes sense: finite, positive, not over `LONGEST`."""
    return math.isfinite(dt) and 0.0 < dt <= LONGEST
