"""The six motion primitives of the thesis (figure 4): straight pushes by a ball, laid out on an item's box."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array, placed, rotation, wrap
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.desk import Item

END = 0.9
"""Where along half of the longer side the two turning pushes are (thesis 3.1.4)."""
_LAID_OUT = {
    # name: where on the box, as shares of half its sides, and which way it goes
    "+x": ((-1.0, 0.0), (1.0, 0.0)),
    "-x": ((1.0, 0.0), (-1.0, 0.0)),
    "+y": ((0.0, -1.0), (0.0, 1.0)),
    "-y": ((0.0, 1.0), (0.0, -1.0)),
    "+turn": ((END, -1.0), (0.0, 1.0)),
    "-turn": ((END, 1.0), (0.0, -1.0)),
}
APPROACH = 0.01
"""[m] between ball and item as a push begins; what comes before the touch changes nothing."""
PRIMITIVES = tuple(_LAID_OUT)
"""Named after what they are meant to do to the item, in its own frame."""


@dataclass(frozen=True)
class Push:
    """One primitive with the way that the ball goes once it touches.

    Attributes:
        primitive: one of `PRIMITIVES`.
        travel: [m].
    """

    primitive: str
    travel: float = 0.05

    def __post_init__(self) -> None:
        if self.primitive not in _LAID_OUT:
            raise PlannerError(f"push: expected one of {', '.join(PRIMITIVES)}, got {self.primitive!r}")
        if not (math.isfinite(self.travel) and self.travel > 0.0):
            raise PlannerError(f"push: expected a travel above zero, got {self.travel} m")

    @property
    def direction(self) -> Array:
        """Which way (2,) the ball goes, in the item's frame; of length one."""
        return np.array(_LAID_OUT[self.primitive][1])

    def contact(self, item: Item) -> Array:
        """Return where (2,) the ball touches the item's box, in its frame [m]."""
        return np.array(_LAID_OUT[self.primitive][0]) * item.half

    def path(self, item: Item, radius: float, approach: float) -> Array:
        """Return where the ball's centre begins and ends (2, 2), in the item's frame before the push [m].

        Args:
            item: that is pushed.
            radius: of the ball [m].
            approach: room between ball and box as it begins [m].
        """
        contact = self.contact(item)
        return np.array(
            [contact - (radius + approach) * self.direction, contact + (self.travel - radius) * self.direction]
        )

    def path_in_world(self, item: Item, pose: Array, radius: float, approach: float) -> Array:
        """Return the same (2, 2) with the item at a pose (3,) [m]."""
        return placed(self.path(item, radius, approach), pose)


def pushes_of(travels: tuple[float, ...]) -> tuple[Push, ...]:
    """Return all primitives with each of some travels [m], the travels one after the other.

    Raises:
        PlannerError: there is none, or one is not above zero.
    """
    if not travels:
        raise PlannerError("pushes: expected at least one travel, got none")
    return tuple(Push(primitive, travel) for travel in travels for primitive in PRIMITIVES)


def displacement(before: Array, after: Array) -> Array:
    """Return how an item moved (3,), in its frame before it did (thesis figure 1) [m, m, rad]."""
    shift = rotation(float(before[2])).T @ (np.asarray(after[:2]) - before[:2])
    return np.array([*shift, wrap(float(after[2] - before[2]))])


def displaced(pose: Array, by: Array) -> Array:
    """Return the pose (3,) of an item that moved by a displacement (3,) in its own frame."""
    shift = rotation(float(pose[2])) @ np.asarray(by[:2])
    return np.array([*(pose[:2] + shift), wrap(float(pose[2] + by[2]))])
