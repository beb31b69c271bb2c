"""Where a sensor is on the robot, from /tf_static and /tf; the little of tf2 that is needed here."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation
from tf2_msgs.msg import TFMessage

from pbrl_control.planar import Array
from pbrl_control.ros.conversions import seconds
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import transform_from_msg

LEVEL = 0.03
"""Sine of the angle by which a laser may lean and still count as level."""
LONGEST = 100
"""Frames from one to another at most."""
KEPT = 100
"""Transforms of a moving frame that are remembered."""
APART = 1.0
"""[s] between two of them at most, for one in between to be known."""


class NotYetError(PlannerError):
    """What is asked for lies ahead of what has been heard."""


class Frames:
    """The transform of every frame to its parent: of fixed ones the newest, of moving ones the last few seconds."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}
        self._moving: dict[str, deque[tuple[float, Array]]] = {}

    def hear(self, message: TFMessage) -> None:
        """Take in fixed transforms, as of /tf_static; what is not finite is left alone."""
        for each in message.transforms:
            matrix = transform_from_msg(each.transform)
            if np.isfinite(matrix).all():
                self._parents[each.child_frame_id] = (each.header.frame_id, matrix)
                self._moving.pop(each.child_frame_id, None)

    def hear_moving(self, message: TFMessage) -> None:
        """Take in transforms that change, as of /tf; what is not finite is left alone."""
        for each in message.transforms:
            matrix, time = transform_from_msg(each.transform), seconds(each.header.stamp)
            if not np.isfinite(matrix).all():
                continue
            kept = self._moving.setdefault(each.child_frame_id, deque(maxlen=KEPT))
            if kept and time < kept[-1][0]:  # the clock has begun again, or it is late
                kept.clear()
            kept.append((time, matrix))
            self._parents[each.child_frame_id] = (each.header.frame_id, matrix)

    def pose(self, frame: str, base: str, time: float | None = None) -> Array:
        """Return the pose of a frame in another above it, as a matrix (4, 4).

        Args:
            frame: which.
            base: the one above it.
            time: [s], between two transforms that were heard; None: as of the newest.

        Raises:
            NotYetError: a transform on the way is older than that time; the next one may do.
            PlannerError: nobody has said how they hang together, or not at that time.
        """
        found, at = np.eye(4), frame
        for _ in range(LONGEST):
            if at == base:
                return found
            if at not in self._parents:
                break
            parent, matrix = self._parents[at]
            found = (matrix if time is None or at not in self._moving else self._at(at, time)) @ found
            at = parent
        raise PlannerError(f"frame {frame!r}: expected its place in {base!r} on /tf_static or /tf, nobody has said it")

    def _at(self, frame: str, time: float) -> Array:
        kept = self._moving[frame]
        if time > kept[-1][0]:
            raise NotYetError(
                f"frame {frame!r}: expected it on /tf until {time:.3f} s, heard it until {kept[-1][0]:.3f} s"
            )
        if time == kept[-1][0]:
            return kept[-1][1]
        for (before, one), (after, other) in pairwise(kept):
            if before <= time < after and after - before <= APART:
                return between(one, other, (time - before) / (after - before))
        raise PlannerError(f"frame {frame!r}: expected it on /tf at {time:.3f} s, nobody has said it")

    def planar(self, frame: str, base: str) -> Array:
        """Return x, y and heading (3,) of a level frame in another above it [m, rad].

        Raises:
            PlannerError: as `pose`, or it leans.
        """
        matrix = self.pose(frame, base)
        if math.hypot(matrix[0, 2], matrix[1, 2]) > LEVEL or matrix[2, 2] < 0.0:
            raise PlannerError(f"frame {frame!r}: expected it level, got one that leans")
        return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])


def between(one: Array, other: Array, share: float) -> Array:
    """Return the pose (4, 4) a share of the way from one to another: straight, and turning about one axis."""
    found = np.eye(4)
    found[:3, 3] = (1.0 - share) * one[:3, 3] + share * other[:3, 3]
    turn = Rotation.from_matrix(one[:3, :3].T @ other[:3, :3]).as_rotvec()
    found[:3, :3] = one[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return found
