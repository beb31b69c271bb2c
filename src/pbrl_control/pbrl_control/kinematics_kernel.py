"""Compiled: where turning joints put both grippers, and the Jacobians of the middle of their plates."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def place_grippers(
    origins: Array,
    mounts: Array,
    axes: Array,
    order: NDArray[np.int64],
    approach: Array,
    grip: float,
    angles: Array,
    positions: Array,
    rotations: Array,
    places: Array,
    jacobians: Array,
) -> None:
    """Write both grippers' poses in `base`, and the Jacobians (6, 7) of the last seven joints of each chain.

    Args:
        origins: (2, n + 1, 3) of each joint of a chain in the frame of the one before, then of `<side>_ft` [m].
        mounts: (2, n + 1, 3, 3) rotations of the same at angle zero.
        axes: (2, n, 3) unit vectors that the joints turn about, in their own frames.
        order: (2, n) which of the angles is each joint's.
        approach: (2, 3) direction from the sensor to the plates in `<side>_ft`.
        grip: way from the sensor to the middle of the plates [m].
        angles: (m,) of all joints [rad].
        positions: (2, 3) out: of `<side>_ft` [m].
        rotations: (2, 3, 3) out: columns are its axes.
        places: (2, 4) out: x, y of the middle of the plates, yaw of the approach, height [m, rad].
        jacobians: (2, 6, 7) out: of the middle of the plates, linear rows, then angular rows.
    """
    count = axes.shape[1]
    at, about = np.empty((count, 3)), np.empty((count, 3))
    turned, joint = np.empty((3, 3)), np.empty((3, 3))
    for side in range(2):
        rotation, position = rotations[side], positions[side]
        rotation[:] = np.eye(3)
        position[:] = 0.0
        for k in range(count + 1):
            _add_turned(rotation, origins[side, k], position)
            _multiply(rotation, mounts[side, k], turned)
            if k == count:
                rotation[:] = turned
                break
            at[k], about[k] = position, 0.0
            _add_turned(turned, axes[side, k], about[k])
            _turn_about(axes[side, k], angles[order[side, k]], joint)
            _multiply(turned, joint, rotation)
        middle, way = position.copy(), np.zeros(3)
        _add_turned(rotation, approach[side], way)
        for i in range(3):
            middle[i] += grip * way[i]
        places[side, 0], places[side, 1], places[side, 3] = middle
        places[side, 2] = math.atan2(way[1], way[0])
        for k in range(7):
            a, p = about[count - 7 + k], at[count - 7 + k]
            x, y, z = middle[0] - p[0], middle[1] - p[1], middle[2] - p[2]
            jacobians[side, 0, k] = a[1] * z - a[2] * y
            jacobians[side, 1, k] = a[2] * x - a[0] * z
            jacobians[side, 2, k] = a[0] * y - a[1] * x
            jacobians[side, 3:, k] = a


@njit(cache=True, error_model="numpy", inline="always")
def _add_turned(rotation: Array, vector: Array, out: Array) -> None:
    """Add the turned vector."""
    for i in range(3):
        out[i] += rotation[i, 0] * vector[0] + rotation[i, 1] * vector[1] + rotation[i, 2] * vector[2]


@njit(cache=True, error_model="numpy", inline="always")
def _multiply(a: Array, b: Array, out: Array) -> None:
    """Write a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, error_model="numpy", inline="always")
def _turn_about(axis: Array, angle: float, out: Array) -> None:
    """Write the rotation about a unit vector (Rodrigues)."""
    s, c = math.sin(angle), math.cos(angle)
    for i in range(3):
        for j in range(3):
            out[i, j] = (1.0 - c) * axis[i] * axis[j]
        out[i, i] += c
    out[2, 1] += s * axis[0]
    out[1, 2] -= s * axis[0]
    out[0, 2] += s * axis[1]
    out[2, 0] -= s * axis[1]
    out[1, 0] += s * axis[2]
    out[0, 1] -= s * axis[2]
