"""How far off a wrench is that no sensor measured, as the force that a model would have to leave out for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_model.engines.windowed import lever
from pbrl_model.geometry import MassProperties
from pbrl_model.sensing.motion import Motion
from pbrl_model.transforms import rotation_matrices

Array = NDArray[np.float64]


def wrench_error(recording: Recording, motions: Sequence[Motion], body: MassProperties) -> float:
    """Return how far off the wrenches on an object are [N]: in the worst direction, on its worst episode.

    A wrench sensor's own error is small and counts as zero. One out of joint efforts has a covariance: turned into the
    plane and to the centre of mass, where a moment counts as the force that makes it at the body's radius of gyration;
    grippers that hold together add up.

    Args:
        recording: with the streams.
        motions: of the object, out of this recording.
        body: its centre of mass and inertia over mass.
    """
    return max((_error(recording, motion, lever(body)) for motion in motions), default=0.0)


def _error(recording: Recording, motion: Motion, radius: float) -> float:
    total = np.zeros((3, 3))
    middle = len(motion.time) // 2
    for gripper in motion.grippers:
        stream = recording.wrenches[gripper]
        if stream.covariance is None:
            continue
        covariance = np.nan_to_num(np.asarray(stream.covariance))
        at, turn = motion.state[middle, :2], np.eye(3)
        if gripper in recording.gripper_poses:
            pose = recording.gripper_poses[gripper]
            nearest = int(np.argmin(np.abs(pose.time - motion.time[middle])))
            at = pose.position[nearest, :2]
            turn = rotation_matrices(pose.quaternion[nearest]) if stream.frame == "sensor" else turn
        x, y = at - motion.state[middle, :2]
        whole = np.kron(np.eye(2), turn)
        plane = (whole @ covariance @ whole.T)[np.ix_((0, 1, 5), (0, 1, 5))]
        shift = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-y, x, 1.0]])
        total += shift @ plane @ shift.T
    scale = np.array([1.0, 1.0, radius])
    return math.sqrt(max(float(np.linalg.eigvalsh(total / (scale[:, None] * scale))[-1]), 0.0))
