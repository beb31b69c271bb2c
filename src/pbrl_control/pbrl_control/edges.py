"""Edges of a footprint: where a gripper takes hold, and which way it faces there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, compose


@dataclass(frozen=True)
class EdgePoint:
    """A point on a footprint's outline: pose (3,) in the object's frame, yaw pointing inwards [m, rad]."""

    pose: Array

    def plates_goal(self, object_pose: Array, depth: float) -> Array:
        """Return the pose (3,) in `world` of plates whose middle is `depth` [m] past the edge, facing in."""
        return compose(compose(object_pose, self.pose), np.array([depth, 0.0, 0.0]))


def nearest_edge(footprint: Array, point: Array) -> EdgePoint:
    """Return the outline's point nearest to `point` (2,), of a counter-clockwise footprint (k, 2) [m].

    Raises:
        ControlError: the footprint is no polygon.
    """
    outline = np.asarray(footprint, dtype=float)
    if outline.ndim != 2 or outline.shape[0] < 3 or outline.shape[1] != 2 or not np.isfinite(outline).all():
        raise ControlError(f"footprint: expected (k, 2) corners with k >= 3, got shape {outline.shape}")
    along = np.roll(outline, -1, axis=0) - outline
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - outline) * along).sum(axis=1) / squared, 0.0, 1.0)
    feet = outline + share[:, None] * along
    best = int(np.argmin(((feet - point) ** 2).sum(axis=1)))
    inward = math.atan2(along[best, 0], -along[best, 1])
    return EdgePoint(np.array([feet[best, 0], feet[best, 1], inward]))
