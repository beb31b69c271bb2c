"""Gripper twist to joint velocities: damped least squares, level plates, limits by scaling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_control.kinematics import GripperState, JointLimits
from pbrl_control.planar import Array, cross
from pbrl_control.settings import ArmSettings

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ArmSolution:
    """What the arm is to do.

    Attributes:
        velocity: (7,) [rad/s], before `scale`.
        scale: in [0, 1], the factor that brings every joint within its limits.
        singular: the smallest singular value of the gripper's Jacobian; 0 at a singularity.
    """

    velocity: Array
    scale: float
    singular: float

    @property
    def limited(self) -> Array:
        """The (7,) velocities to send [rad/s]: the same direction, within the limits."""
        return self.scale * self.velocity


def level_twist(gripper: GripperState, planar: Array, lift: float, settings: ArmSettings) -> Array:
    """Return the (6,) gripper twist in `base`: the planar one, a lift, and feedback that keeps the plates level.

    Args:
        gripper: where it is.
        planar: (3,) vx, vy, omega at the middle of the plates, in base axes [m/s, rad/s].
        lift: vertical velocity [m/s].
        settings: the gain of the feedback.
    """
    tilt = cross(gripper.pose.rotation[:, 2], UP)  # turns the plates' normal to the vertical; no yaw in it
    roll, pitch = settings.level_gain * tilt[:2]
    return np.array([planar[0], planar[1], lift, roll, pitch, planar[2]])


def damped_inverse(jacobian: Array, threshold: float, damping: float) -> tuple[Array, float]:
    """Return the damped pseudo-inverse (n, m) and the smallest singular value.

    Damping is zero above `threshold` and grows to `damping` as the smallest singular value goes to zero, so
    that far from singularities the twist is met exactly.
    """
    u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    smallest = float(s[-1])
    squared = 0.0 if smallest >= threshold else damping**2 * (1.0 - (smallest / threshold) ** 2)
    return (vt.T * (s / (s**2 + squared + 1e-12))) @ u.T, smallest


def solve_arm(
    gripper: GripperState, joints: Array, twist: Array, nominal: Array, limits: JointLimits, settings: ArmSettings
) -> ArmSolution:
    """Return joint velocities that give the gripper its twist, elbow drawn to the nominal posture.

    Args:
        gripper: where it is, with its Jacobian.
        joints: (7,) positions [rad].
        twist: (6,) of the middle of the plates in `base` [m/s, rad/s].
        nominal: (7,) posture that the null space of the Jacobian is used for [rad].
        limits: of this arm.
        settings: damping, gains, margins.
    """
    inverse, singular = damped_inverse(gripper.jacobian, settings.singular_threshold, settings.damping)
    velocity = inverse @ twist
    draw = np.clip(settings.posture_gain * (nominal - joints), -settings.posture_speed, settings.posture_speed)
    velocity += draw - inverse @ (gripper.jacobian @ draw)
    low, high = velocity_bounds(joints, limits, settings)
    return ArmSolution(velocity, fitting_scale(velocity, low, high), singular)


def velocity_bounds(joints: Array, limits: JointLimits, settings: ArmSettings) -> tuple[Array, Array]:
    """Return lowest and highest (7,) joint velocities [rad/s] that brake in time before a joint's stop."""
    ceiling = settings.velocity_fraction * limits.velocity
    high = settings.brake_rate * (limits.upper - settings.joint_margin - joints)
    low = settings.brake_rate * (limits.lower + settings.joint_margin - joints)
    return np.clip(low, -ceiling, 0.0), np.clip(high, 0.0, ceiling)


def fitting_scale(velocity: Array, low: Array, high: Array) -> float:
    """Return the largest factor in [0, 1] that brings every velocity between its bounds."""
    bound = np.where(velocity > 0.0, high, low)
    beyond = (velocity > high) | (velocity < low)
    return float(np.min(bound[beyond] / velocity[beyond])) if beyond.any() else 1.0
