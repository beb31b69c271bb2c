"""Where a sensor is on the robot, from /tf_static and /tf; the little of tf2 that is needed here."""

from __future__ import annotations

import math

import numpy as np
from tf2_msgs.msg import TFMessage

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import transform_from_msg

LEVEL = 0.03
"""Sine of the angle by which a laser may lean and still count as level."""
LONGEST = 100
"""Frames from one to another at most."""


class Frames:
    """The newest transform of every frame to its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def hear(self, message: TFMessage) -> None:
        """Take in transforms; what is not finite is left alone."""
        for each in message.transforms:
            matrix = transform_from_msg(each.transform)
            if np.isfinite(matrix).all():
                self._parents[each.child_frame_id] = (each.header.frame_id, matrix)

    def pose(self, frame: str, base: str) -> Array:
        """Return the pose of a frame in another above it, as a matrix (4, 4).

        Raises:
            PlannerError: nobody has said how they hang together.
        """
        found, at = np.eye(4), frame
        for _ in range(LONGEST):
            if at == base:
                return found
            if at not in self._parents:
                break
            at, matrix = self._parents[at]
            found = matrix @ found
        raise PlannerError(f"frame {frame!r}: expected its place in {base!r} on /tf_static or /tf, nobody has said it")

    def planar(self, frame: str, base: str) -> Array:
        """Return x, y and heading (3,) of a level frame in another above it [m, rad].

        Raises:
            PlannerError: as `pose`, or it leans.
        """
        matrix = self.pose(frame, base)
        if math.hypot(matrix[0, 2], matrix[1, 2]) > LEVEL or matrix[2, 2] < 0.0:
            raise PlannerError(f"frame {frame!r}: expected it level, got one that leans")
        return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])
