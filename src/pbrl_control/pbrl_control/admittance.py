"""Force compliance of a grip from its wrist sensor (thesis 6.1; the form is that of Krang's own push program).

Krang moved its gripper at `x_dot = 1.0 (x_ref - x) - F / 750`. Here each axis of the gripper has its own
numbers: stiff along the push, nearly free across it and about the vertical, because a table with a locked
caster goes where the caster lets it and the wrist carries 56 N sideways at most.
"""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.kinematics import APPROACH, GRIP, GripperState
from pbrl_control.planar import Array, cross
from pbrl_control.settings import ComplianceAxis, ComplianceSettings, ProgramSettings


class WrenchBias:
    """The wrench a sensor shows while nothing is held: gripper weight and bias, averaged until a grip closes.

    The plates are kept level, so the weight does not change in sensor axes while they turn about the vertical.
    """

    def __init__(self, time: float) -> None:
        self._time = time
        self._mean: Array | None = None

    def update(self, raw: Array, dt: float) -> None:
        """Take in a sample (6,) while nothing is held; samples that are not finite are left out."""
        if not np.isfinite(raw).all():
            return
        if self._mean is None:
            self._mean = np.array(raw, dtype=float)
        else:
            self._mean += (1.0 - math.exp(-dt / self._time)) * (raw - self._mean)

    def remove(self, raw: Array) -> Array:
        """Return the wrench (6,) that the held object exerts on the gripper; zeros where the sample is not finite."""
        if not np.isfinite(raw).all():
            return np.zeros(6)
        return np.array(raw) if self._mean is None else raw - self._mean


def grip_wrench(side: str, gripper: GripperState, wrench: Array) -> Array:
    """Return (f_along, f_left, tau_up, f_up) at the middle of the plates, in the gripper's planar axes [N, N m].

    Args:
        side: "left" or "right".
        gripper: where it is.
        wrench: (6,) force then torque at `<side>_ft`, in its axes, bias removed.
    """
    rotation = gripper.pose.rotation
    lever = rotation @ APPROACH[side] * GRIP
    force = rotation @ wrench[:3]
    torque = rotation @ wrench[3:] - cross(lever, force)
    c, s = math.cos(gripper.planar[2]), math.sin(gripper.planar[2])
    return np.array([c * force[0] + s * force[1], c * force[1] - s * force[0], torque[2], force[2]])


class AxisCompliance:
    """One axis: gives way to a force, and comes back by and by from where it gave way to.

    What is come back from is what this axis gave way itself, not how far the gripper is from some place: base and
    arms may carry it wherever the task is, and the compliance neither knows nor resists.

    Args:
        settings: of the axis.
        most: speed that it adds [m/s or rad/s].
    """

    def __init__(self, settings: ComplianceAxis, most: float) -> None:
        self._settings = settings
        self._most = most
        self._slow = 0.0
        self._given = 0.0

    def step(self, force: float, dt: float) -> float:
        """Return the velocity [m/s or rad/s] that yields to the force the object exerts on the gripper.

        Args:
            force: [N or N m].
            dt: time since the last step [s].
        """
        settings = self._settings
        felt = math.copysign(max(abs(force) - settings.dead_band, 0.0), force)
        fast = felt / settings.damping
        if settings.yielding is not None:
            self._slow += dt * (fast / settings.yielding - self._slow / settings.leak)
        velocity = fast + self._slow - settings.centring * self._given
        velocity = min(max(velocity, -self._most), self._most)
        self._given += dt * (velocity - (self._given / settings.forget if settings.forget is not None else 0.0))
        return velocity


class Admittance:
    """Compliance of one grip in its planar axes, from the moment it closed.

    Attributes:
        home: (3,) where the gripper was in `base` when it closed [m, rad].
        height: of the plates then [m].
    """

    def __init__(self, settings: ComplianceSettings, home: Array, height: float) -> None:
        self.home = home
        self.height = height
        most = (settings.speed, settings.speed, settings.yaw_rate, settings.speed)
        soft = (settings.longitudinal, settings.lateral, settings.yaw, settings.vertical)
        firm = (settings.longitudinal, settings.firm_lateral, settings.firm_yaw, settings.vertical)
        self._soft = tuple(AxisCompliance(axis, top) for axis, top in zip(soft, most, strict=True))
        self._firm = tuple(AxisCompliance(axis, top) for axis, top in zip(firm, most, strict=True))

    def step(self, wrench: Array, dt: float, *, firm: bool = False) -> tuple[Array, float]:
        """Return the planar twist (3,) in gripper axes and the vertical velocity that compliance adds.

        Args:
            wrench: (4,) as of `grip_wrench`; where it is known what to expect, less that.
            dt: time since the last step [s].
            firm: whether the wrench is what was not expected: then no axis is nearly free.
        """
        axes = self._firm if firm else self._soft
        vx, vy, omega, lift = (axis.step(force, dt) for axis, force in zip(axes, wrench.tolist(), strict=True))
        return np.array([vx, vy, omega]), lift


class ForceGovernor:
    """How fast a gripper may go against the force that it feels: as fast as ever, until the force is past its limit.

    Args:
        settings: limit and rates.
        speed: that is as fast as ever [m/s].
    """

    def __init__(self, settings: ProgramSettings, speed: float) -> None:
        self._settings = settings
        self._speed = speed
        self._share = 1.0

    def step(self, force: Array, dt: float) -> tuple[Array, float]:
        """Return the unit vector (2,) against a horizontal force (2,) [N], and the speed along it [m/s]."""
        strong = math.hypot(force[0], force[1])
        beyond = strong / self._settings.grip_force - 1.0
        rate = -self._settings.grip_slow * beyond if beyond > 0.0 else self._settings.grip_resume
        self._share = min(max(self._share + rate * dt, 0.0), 1.0)
        return (-force / strong if strong > 0.0 else np.zeros(2)), self._speed * self._share
