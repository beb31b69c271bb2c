"""The last gate before the drives: whatever was computed, no command leaves that breaks a limit."""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.kinematics import JointLimits
from pbrl_control.planar import Array
from pbrl_control.settings import ArmSettings, BaseSettings


class BaseGate:
    """Bounds speed, yaw rate and their changes; keeps the last command."""

    def __init__(self, settings: BaseSettings) -> None:
        self._settings = settings
        self.last = np.zeros(2)

    def stop(self) -> None:
        """Forget the last command: the base was told to stand."""
        self.last = np.zeros(2)

    def preview(self, wish: Array, dt: float) -> Array:
        """Return the (2,) forward speed and yaw rate nearest to the wish that limits allow now."""
        settings = self._settings
        change = np.array([settings.acceleration, settings.yaw_acceleration]) * dt
        ceiling = np.array([settings.speed, settings.yaw_rate])
        return np.clip(np.clip(wish, self.last - change, self.last + change), -ceiling, ceiling)

    def commit(self, velocity: Array) -> Array:
        """Remember what is sent, bounded once more, and return it."""
        ceiling = np.array([self._settings.speed, self._settings.yaw_rate])
        self.last = np.clip(np.where(np.isfinite(velocity), velocity, 0.0), -ceiling, ceiling)
        return self.last


class ArmGate:
    """Bounds one arm's joint velocities, their changes, and the positions they lead to."""

    def __init__(self, limits: JointLimits, settings: ArmSettings) -> None:
        self._limits = limits
        self._settings = settings
        self._last = np.zeros(7)

    def stop(self) -> None:
        """Forget the last command: the arm was told to stand."""
        self._last = np.zeros(7)

    def commit(self, velocity: Array, joints: Array, dt: float) -> Array:
        """Return the (7,) velocities to send [rad/s], given the joints' positions [rad] and the period [s].

        A change larger than the acceleration limit is shortened as a vector, so that the gripper keeps its
        direction; position and velocity limits then hold whatever the direction.
        """
        if not np.isfinite(velocity).all():
            self.stop()
            return self._last
        change = velocity - self._last
        largest = float(np.abs(change).max())
        allowed = self._settings.acceleration * dt
        slewed = self._last + change * (allowed / largest if largest > allowed else 1.0)
        ceiling = self._limits.velocity
        period = max(dt, 1e-3)
        low = np.clip((self._limits.lower - joints) / period, -ceiling, 0.0)
        high = np.clip((self._limits.upper - joints) / period, 0.0, ceiling)
        self._last = np.clip(slewed, low, high)
        return self._last


def usable_period(dt: float) -> bool:
    """Say whether a control period makes sense: finite, positive, not over a tenth of a second."""
    return math.isfinite(dt) and 0.0 < dt <= 0.1
