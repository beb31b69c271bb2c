"""Force compliance of a grip from its wrist sensor (thesis 6.1; the form is that of Krang's own push program).

Krang moved its gripper at `x_dot = 1.0 (x_ref - x) - F / 750`. Here each axis of the gripper has its own
numbers: stiff along the push, nearly free across it and about the vertical, because a table with a locked
caster goes where the caster lets it and the wrist carries 56 N sideways at most.
"""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.admittance_kernel import held_task, wrench_at_plates
from pbrl_control.kinematics import APPROACH, GRIP, GripperState
from pbrl_control.planar import Array
from pbrl_control.settings import ComplianceAxis, ComplianceSettings, ControllerSettings
from pbrl_control.types import Hold, PlanarTwist
from pbrl_control.whole_body.task import Task

FASTEST = 1.0
"""[m/s] No gripper goes faster than this."""


class WrenchBias:
    """The wrench a sensor shows while nothing is held: gripper weight and bias, averaged until a grip closes.

    The plates are kept level, so the weight does not change in sensor axes while they turn about the vertical.

    Attributes:
        mean: (6,) force, torque [N, N m]; zeros before the first sample.
    """

    def __init__(self, time: float) -> None:
        self.mean = np.zeros(6)
        self._time = time
        self._known = False

    def update(self, raw: Array, dt: float) -> None:
        """Take in a sample (6,) while nothing is held; samples that are not finite are left out."""
        if np.isfinite(raw).all():
            self.mean += (1.0 - math.exp(-dt / self._time) if self._known else 1.0) * (raw - self.mean)
            self._known = True

    def remove(self, raw: Array) -> Array:
        """Return the wrench (6,) that the held object exerts on the gripper; zeros where the sample is not finite."""
        return raw - self.mean if np.isfinite(raw).all() else np.zeros(6)


def grip_wrench(side: str, gripper: GripperState, wrench: Array) -> Array:
    """Return (f_along, f_left, tau_up, f_up) at the middle of the plates, in the gripper's planar axes [N, N m].

    Args:
        side: "left" or "right".
        gripper: where it is.
        wrench: (6,) force then torque at `<side>_ft`, in its axes, bias removed.
    """
    found = np.empty(4)
    wrench_at_plates(gripper.pose.rotation, float(gripper.planar[2]), APPROACH[side], GRIP, wrench, found)
    return found


class HeldGrip:
    """A grip from the moment it closed: moves with what it holds, gives way, and does not go on against too much force.

    Args:
        side: "left" or "right".
        target: name of what is held.
        settings: of the controller.
        gripper: where it closed.

    Attributes:
        target: name of what is held.
        home: (3,) where the gripper was in `base` when it closed [m, rad].
    """

    def __init__(self, side: str, target: str, settings: ControllerSettings, gripper: GripperState) -> None:
        self.target = target
        self.home = gripper.planar
        self._height = gripper.height
        self._approach = APPROACH[side]
        arm, program = settings.arm, settings.program
        self._gains = np.array(
            [arm.level_gain, arm.height_gain, program.grip_force, program.grip_slow, program.grip_resume]
        )
        self._laws = compliance_laws(settings.compliance)
        self._memory = np.zeros((2, 4, 2))
        self._share = 1.0
        self._raw, self._twist, self._contact, self._expected = (np.zeros(size) for size in (6, 3, 2, 3))

    def task(self, gripper: GripperState, twist: PlanarTwist, hold: Hold, raw: Array, bias: Array, dt: float) -> Task:
        """Return what the gripper is to do; see `held_task`.

        Args:
            gripper: where it is.
            twist: of the object's origin, in its axes.
            hold: where the gripper has hold of it, and what wrench that takes.
            raw: (6,) of the wrist sensor, `<side>_ft`; not finite: nothing is felt.
            bias: (6,) of it.
            dt: time since the last tick [s].
        """
        self._raw[:], self._contact[:] = raw, hold.contact
        self._twist[:] = twist.vx, twist.vy, twist.omega
        self._expected[:] = 0.0 if hold.expected is None else hold.expected
        wanted, added, against = np.empty(3), np.empty(6), np.empty(2)
        self._share = held_task(
            gripper.pose.rotation,
            float(gripper.planar[2]),
            self._approach,
            GRIP,
            self._raw,
            bias,
            self._twist,
            self._contact,
            float(hold.yaw),
            self._expected,
            hold.expected is not None,
            self._laws,
            self._memory,
            self._gains,
            self._height - gripper.height,
            self._share,
            dt,
            wanted,
            added,
            against,
        )
        return Task(wanted, 0.0, added, against, FASTEST * self._share)


def compliance_laws(settings: ComplianceSettings) -> Array:
    """Return (2, 4, 7) laws of the soft and the firm axes: along, left, about the vertical, up; see `axis_velocity`."""
    speed, yaw_rate = settings.speed, settings.yaw_rate
    along, up = axis_law(settings.longitudinal, speed), axis_law(settings.vertical, speed)
    soft = [along, axis_law(settings.lateral, speed), axis_law(settings.yaw, yaw_rate), up]
    firm = [along, axis_law(settings.firm_lateral, speed), axis_law(settings.firm_yaw, yaw_rate), up]
    return np.array([soft, firm])


def axis_law(axis: ComplianceAxis, most: float) -> Array:
    """Return (7,) numbers of one axis, which adds `most` [m/s or rad/s] at most."""
    forget, yielding = (math.inf if value is None else value for value in (axis.forget, axis.yielding))
    return np.array([axis.damping, axis.centring, forget, yielding, axis.leak, axis.dead_band, most])
