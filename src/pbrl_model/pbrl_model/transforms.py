"""Force-moment transforms: a wrench seen in one frame, wanted in another (thesis 5.4.2, equations 31-37).

A wrench is the 6-vector (fx, fy, fz, tx, ty, tz) [N, N m]. Rotations and translations are spelled
`rotation_a_b`, `translation_a_b`: they take coordinates in frame b to coordinates in frame a. Every function
broadcasts over leading axes, so that a whole stream is transformed at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]


def cross_matrix(vector: Array) -> Array:
    """Return the matrix of the cross product, `cross_matrix(p) @ v = p x v` (33).

    Args:
        vector: (..., 3).

    Returns:
        (..., 3, 3) skew-symmetric.
    """
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, -2)


def force_moment_transform(rotation_a_b: Array, translation_a_b: Array) -> Array:
    """Return the 6 x 6 matrix that takes a wrench at b in b's axes to one at a in a's axes (32).

    Args:
        rotation_a_b: (..., 3, 3).
        translation_a_b: (..., 3) origin of b in a [m].

    Returns:
        (..., 6, 6).
    """
    rotation = np.asarray(rotation_a_b, dtype=float)
    lever = cross_matrix(translation_a_b) @ rotation
    top = np.concatenate([np.broadcast_to(rotation, lever.shape), np.zeros_like(lever)], -1)
    bottom = np.concatenate([lever, np.broadcast_to(rotation, lever.shape)], -1)
    return np.concatenate([top, bottom], -2)


def transform_wrench(rotation_a_b: Array, translation_a_b: Array, wrench: Array) -> Array:
    """Apply `force_moment_transform` to wrenches (31).

    Args:
        rotation_a_b: (..., 3, 3).
        translation_a_b: (..., 3) [m].
        wrench: (..., 6) at b in b's axes [N, N m].

    Returns:
        (..., 6) at a in a's axes.
    """
    return (force_moment_transform(rotation_a_b, translation_a_b) @ np.asarray(wrench, dtype=float)[..., None])[..., 0]


def rotation_matrices(quaternions: Array) -> Array:
    """Return rotation matrices of quaternions (x, y, z, w), normalised here.

    Args:
        quaternions: (..., 4).

    Returns:
        (..., 3, 3).

    Raises:
        ModelError: a quaternion has no length or is not finite.
    """
    q = np.asarray(quaternions, dtype=float)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.isfinite(norm)) or np.any(norm < 1e-9):
        raise ModelError("expected unit quaternions (x, y, z, w), got one that is zero or not finite")
    x, y, z, w = np.moveaxis(q / norm, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def yaw_matrices(yaw: Array) -> Array:
    """Return rotations about the world's vertical.

    Args:
        yaw: (...) [rad].

    Returns:
        (..., 3, 3).
    """
    c, s = np.cos(yaw), np.sin(yaw)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([np.stack(row, -1) for row in ((c, -s, zero), (s, c, zero), (zero, zero, one))], -2)


def plane_rotations(angle: Array) -> Array:
    """Return rotations in the plane.

    Args:
        angle: (...) [rad].

    Returns:
        (..., 2, 2).
    """
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def wrench_at_centre(rotation_w_g: Array, position_g: Array, position_centre: Array, wrench: Array) -> Array:
    """Move gripper wrenches to a body's centre of mass, in world axes (35-37).

    The orientation of the body drops out: (36) first turns the lever arm into the body's axes and then
    everything back, so only where the gripper is, seen from the centre, matters.

    Args:
        rotation_w_g: (..., 3, 3) gripper (sensor) to world.
        position_g: (..., 3) of the sensor in world [m].
        position_centre: (..., 3) of the centre of mass in world [m].
        wrench: (..., 6) on the body, at the sensor in its axes [N, N m].

    Returns:
        (..., 6) at the centre of mass in world axes.
    """
    return transform_wrench(rotation_w_g, np.asarray(position_g) - np.asarray(position_centre), wrench)


def planar(wrench: Array) -> Array:
    """Keep what moves a body on the floor: (fx, fy, tz).

    Args:
        wrench: (..., 6) in world axes.

    Returns:
        (..., 3) [N, N, N m].
    """
    return np.asarray(wrench)[..., [0, 1, 5]]
