"""Gripper twist to joint velocities of one arm: damped least squares, limits by scaling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array


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
    jacobian: Array, twist: Array, draw: Array, low: Array, high: Array, *, threshold: float, damping: float
) -> ArmSolution:
    """Return joint velocities that give the gripper its twist, what is free drawn to a posture.

    Args:
        jacobian: (6, 7) of the middle of the plates.
        twist: (6,) of it in `base` [m/s, rad/s].
        draw: (7,) joint rates that the null space of the Jacobian is used for [rad/s].
        low: (7,) least rates [rad/s].
        high: (7,) greatest.
        threshold: see `damped_inverse`.
        damping: see `damped_inverse`.
    """
    inverse, singular = damped_inverse(jacobian, threshold, damping)
    velocity = inverse @ twist
    velocity += draw - inverse @ (jacobian @ draw)
    return ArmSolution(velocity, fitting_scale(velocity, low, high), singular)


def fitting_scale(velocity: Array, low: Array, high: Array) -> float:
    """Return the largest factor in [0, 1] that brings every velocity between its bounds."""
    bound = np.where(velocity > 0.0, high, low)
    beyond = (velocity > high) | (velocity < low)
    return max(float(np.min(bound[beyond] / velocity[beyond])), 0.0) if beyond.any() else 1.0
