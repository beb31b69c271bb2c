"""Planar poses (x, y, theta) and twists (vx, vy, omega): the few operations that control needs.

SI units, radians. A twist is that of a body, given at a point of it, in stated axes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def wrap(angle: float) -> float:
    """Return the angle in (-pi, pi] [rad]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def rotation(theta: float) -> Array:
    """Return the (2, 2) matrix that turns axes-of-the-body coordinates into axes-of-the-parent ones."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def placed(points: Array, pose: Array) -> Array:
    """Return where points (k, 2) of a body are in `world` with its frame at a pose (3,) [m, rad]."""
    return np.asarray(points @ rotation(float(pose[2])).T + pose[:2])


def on_floor(pose: Array) -> Array:
    """Return a pose (3,) as a matrix (4, 4): upright, at height 0."""
    found = np.eye(4)
    found[:2, :2], found[:2, 3] = rotation(float(pose[2])), pose[:2]
    return found


def compose(a: Array, b: Array) -> Array:
    """Return the pose (3,) of c in the frame of a's parent, given a, and b = c in the frame of a."""
    x, y = a[:2] + rotation(a[2]) @ b[:2]
    return np.array([x, y, wrap(a[2] + b[2])])


def inverse(a: Array) -> Array:
    """Return the pose (3,) of the parent in the frame of a."""
    x, y = -rotation(a[2]).T @ a[:2]
    return np.array([x, y, wrap(-a[2])])


def turn(twist: Array, theta: float) -> Array:
    """Return the same twist at the same point, in axes of the parent: theta is the old axes' yaw there."""
    c, s = math.cos(theta), math.sin(theta)
    vx, vy, omega = twist
    return np.array([c * vx - s * vy, s * vx + c * vy, omega])


def shift(twist: Array, lever: Array) -> Array:
    """Return the twist at the point `lever` (2,) [m] away from the point it was given at, same body, same axes."""
    vx, vy, omega = twist
    x, y = lever
    return np.array([vx - omega * y, vy + omega * x, omega])


def yaw_of(quaternion: Array) -> float:
    """Return the yaw [rad] of the x axis of a frame, from its quaternion (4,) x y z w."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def cross(a: Array, b: Array) -> Array:
    """Return a x b of two (3,) vectors; numpy's own costs ten times as much for so little."""
    ax, ay, az = a
    bx, by, bz = b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotate_vector(quaternion: Array, vector: Array) -> Array:
    """Return the (3,) vector turned by the quaternion (4,) x y z w."""
    axis, w = quaternion[:3], quaternion[3]
    t = 2.0 * cross(axis, vector)
    return vector + w * t + cross(axis, t)
