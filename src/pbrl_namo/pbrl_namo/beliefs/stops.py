"""Where a thing is not to go again: what it met there does not have to be known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array, rotation
from pbrl_namo.errors import NamoError

SAMPLES = 60
"""Places along a motion at which a stop is asked about."""


@dataclass(frozen=True)
class Stop:
    """A line that a point of a thing does not cross.

    It is the tangent of whatever was met there: of a wall, of the circle in which a cord holds it, of a carpet's edge.

    Attributes:
        point: (2,) of the thing's frame [m].
        direction: (2,) unit vector in `world`: so it does not go any further.
        level: of the line, along the direction [m].

    Raises:
        NamoError: a number is not finite, or the direction is no unit vector.
    """

    point: Array
    direction: Array
    level: float

    def __post_init__(self) -> None:
        numbers = np.concatenate((np.ravel(self.point), np.ravel(self.direction), [self.level]))
        shaped = np.shape(self.point) == (2,) and np.shape(self.direction) == (2,)
        if not shaped or not np.isfinite(numbers).all() or abs(float(np.hypot(*self.direction)) - 1.0) > 1e-6:
            raise NamoError(
                f"stop: expected a point (2,), a unit vector (2,) and a level, all finite, got {self.point}, "
                f"{self.direction} and {self.level}"
            )

    def beyond(self, poses: Array) -> Array:
        """Return how far past the line the point is with the thing at poses (..., 3) [m]; below zero: before it."""
        c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        x = poses[..., 0] + c * self.point[0] - s * self.point[1]
        y = poses[..., 1] + s * self.point[0] + c * self.point[1]
        return np.asarray(x * self.direction[0] + y * self.direction[1] - self.level)


def reach(stops: Sequence[Stop], pose: Array, twists: Array, ends: Array) -> Array:
    """Return how far (c,) commands can be followed until a stop is met, in units of them.

    A thing that is past a line already must not go further past it.

    Args:
        stops: of the thing.
        pose: (3,) from where it starts, in `world` [m, rad].
        twists: (c, 3) of its origin in its axes.
        ends: (c,) how far they would be followed.
    """
    if not stops or not len(twists):
        return np.asarray(ends, dtype=float)
    shares = np.linspace(0.0, 1.0, SAMPLES + 1)
    went = shares[None, :] * np.asarray(ends)[:, None]
    poses = _moved(pose, twists, went)
    free = np.ones(went.shape, dtype=bool)
    for stop in stops:
        past = stop.beyond(poses)
        free &= past <= np.maximum(past[:, :1], 0.0) + 1e-9
    first = np.where(free.all(axis=1), SAMPLES, np.argmin(free, axis=1) - 1)
    return np.asarray(went[np.arange(len(twists)), np.maximum(first, 0)])


def _moved(pose: Array, twists: Array, went: Array) -> Array:
    """Return the poses (c, n, 3) after each command (c, 3) was followed for ways (c, n)."""
    turn = twists[:, 2:3] * went
    half = 0.5 * turn
    chord = went * np.sinc(half / np.pi)  # of the arc, over that of a straight way
    c, s = np.cos(half), np.sin(half)
    x = chord * (c * twists[:, 0:1] - s * twists[:, 1:2])
    y = chord * (s * twists[:, 0:1] + c * twists[:, 1:2])
    across = np.stack((x, y), axis=-1) @ rotation(float(pose[2])).T
    return np.concatenate((across + pose[:2], (pose[2] + turn)[..., None]), axis=-1)
