"""One clock for streams of different rates: headings unwrapped, sensor frames smoothed, forces averaged over steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream
from pbrl_model.sensing.smoothing import smooth
from pbrl_model.transforms import rotation_matrices, yaw_matrices

Array = NDArray[np.float64]


def planar_yaw(quaternions: Array) -> Array:
    """Return the unwrapped heading of quaternions (x, y, z, w); NaN rows stay NaN.

    Args:
        quaternions: (n, 4).

    Returns:
        (n,) [rad].
    """
    x, y, z, w = np.asarray(quaternions, dtype=float).T
    yaw = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    seen = np.isfinite(yaw)
    yaw[seen] = np.unwrap(yaw[seen])
    return yaw


def smooth_gripper(stream: PoseStream, at: Array) -> tuple[Array, Array]:
    """Smooth the pose of a sensor frame.

    The orientation is split into a turn about the vertical, unwrapped however far it goes, and a small rest.

    Args:
        stream: poses; every orientation must be observed.
        at: (m,) times [s].

    Returns:
        rotation (m, 3, 3) sensor to world, position (m, 3) [m].

    Raises:
        ModelError: an orientation is missing or poses are too few.
    """
    position = np.stack([smooth(stream.time, column, at).position for column in stream.position.T], -1)
    rotation = rotation_matrices(stream.quaternion)
    relative = rotation @ rotation[0].T
    # Twist about the vertical that is closest to the relative rotation.
    yaw = np.unwrap(np.arctan2(relative[:, 1, 0] - relative[:, 0, 1], relative[:, 0, 0] + relative[:, 1, 1]))
    tilt = np.swapaxes(yaw_matrices(yaw), -1, -2) @ relative
    small = 0.5 * np.stack([tilt[:, 2, 1] - tilt[:, 1, 2], tilt[:, 0, 2] - tilt[:, 2, 0]], -1)
    turn = smooth(stream.time, yaw, at).position
    lean = np.stack([smooth(stream.time, column, at).position for column in small.T], -1)
    lean = np.concatenate([lean, np.zeros((len(at), 1))], -1)
    return yaw_matrices(turn) @ _small_rotation(lean) @ rotation[0], position


def _small_rotation(vector: Array) -> Array:
    """Return the rotation whose antisymmetric part is that of `vector` (sine times axis)."""
    sine = np.linalg.norm(vector, axis=-1)
    half = 0.5 * np.arcsin(np.clip(sine, 0.0, 1.0))
    axis = vector / np.maximum(sine, 1e-12)[:, None]
    return rotation_matrices(np.concatenate([axis * np.sin(half)[:, None], np.cos(half)[:, None]], -1))


def step_means(time: Array, value: Array, grid: Array) -> Array:
    """Average a sampled signal, linear between its samples, over each step of a grid.

    Args:
        time: (n,) increasing [s].
        value: (n, d).
        grid: (T + 1,) increasing [s].

    Returns:
        (T, d).
    """
    area = np.concatenate(
        [np.zeros((1, value.shape[1])), np.cumsum(0.5 * np.diff(time)[:, None] * (value[1:] + value[:-1]), 0)]
    )
    inside = np.clip(grid, time[0], time[-1])
    index = np.clip(np.searchsorted(time, inside, side="right") - 1, 0, len(time) - 2)
    span = (inside - time[index])[:, None]
    slope = (value[index + 1] - value[index]) / np.diff(time)[index][:, None]
    integral = area[index] + span * (value[index] + 0.5 * span * slope)
    integral += (
        np.minimum(grid - time[0], 0.0)[:, None] * value[0] + np.maximum(grid - time[-1], 0.0)[:, None] * value[-1]
    )
    return np.diff(integral, axis=0) / np.diff(grid)[:, None]
