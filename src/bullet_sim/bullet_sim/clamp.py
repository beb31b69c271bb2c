"""What lies between a gripper's plates: the test whether a table's edge can be clamped, and how far it is if not.

The plates of a parallel gripper stand one above the other, `opening` apart; closing them on the edge of a table's
top works where the edge reaches in between them deep enough, level enough and at the right height.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon

from bullet_sim.client import Pose
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture, Slab

Array = NDArray[np.float64]

LEAST_HOLD = 0.020
"""Depth [m] of edge between the plates below which a grasp is refused."""

STEEPEST = math.radians(12.0)
"""Angle [rad] between plates and slab up to which rubber evens it out."""

MAY_BE_ZERO = ("approach", "damping", "play")
"""Fields of a gripper that need not be above zero."""

LEAST = {"approach": -1.0}
"""Bounds of fields that may be below zero."""


@dataclass(frozen=True)
class GripperSpec:
    """A gripper with two rubber-faced plates; defaults are the Schunk PG70 class on Krang.

    Attributes:
        approach: +1 where the plates reach along the +y axis of the gripper's frame, -1 along -y; they open along z.
        plate_start: from the frame's origin to the plates' near end [m].
        plate_end: from the frame's origin to the plates' far end [m].
        plate_width: [m].
        opening: between the open plates' faces [m].
        force: of each plate when closed [N].
        friction: Coulomb coefficient of rubber on laminate.
        stiffness: of the rubber in shear and across [N/m].
        damping: ratio to the critical damping of a 5 kg mass on that spring.
        torque_limit: greatest moment about the plates' normal [N m].
        play: way [m] in the plane of the plates, either side, over which they hold nothing.
    """

    approach: float = 1.0
    plate_start: float = 0.127
    plate_end: float = 0.217
    plate_width: float = 0.074
    opening: float = 0.059
    force: float = 200.0
    friction: float = 0.8
    stiffness: float = 2.0e4
    damping: float = 0.3
    torque_limit: float = 5.0
    play: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not math.isfinite(value) or (value <= 0 and name not in MAY_BE_ZERO) or value < LEAST.get(name, 0.0):
                raise SimError(f"gripper: {name}: expected a positive number, got {value}")
        if self.plate_end <= self.plate_start or abs(self.approach) != 1:
            raise SimError("gripper: expected plate_end beyond plate_start and approach +1 or -1")

    @property
    def force_limit(self) -> float:
        """Greatest force [N] in the plane of the plates: friction on both faces."""
        return 2 * self.friction * self.force

    def along(self, reach: float) -> Array:
        """Give the point (3,) [m] in the gripper's frame between the plates at a distance from its origin."""
        return np.array([0.0, self.approach * reach, 0.0])

    @property
    def middle(self) -> Array:
        """Point (3,) [m] in the gripper's frame between the plates' middles."""
        return self.along((self.plate_start + self.plate_end) / 2)


@dataclass(frozen=True)
class Clamp:
    """An edge between the plates.

    Attributes:
        body: name of the body.
        contact: middle of the clamped patch, (3,) [m] in the body's tag frame.
        reach: from the gripper frame's origin to that middle [m].
        depth: of edge between the plates [m].
    """

    body: str
    contact: Array
    reach: float
    depth: float


@dataclass(frozen=True)
class ClampTest:
    """Outcome of closing the plates.

    Attributes:
        clamp: what they hold, None where they close on air.
        distance: from the plates' middle to the nearest edge that can be clamped [m]; infinite where there is none.
        message: one sentence.
    """

    clamp: Clamp | None
    distance: float
    message: str


def find_clamp(furniture: Iterable[Furniture], gripper: Pose, spec: GripperSpec) -> ClampTest:
    """Find what a gripper would hold if it closed now.

    Args:
        furniture: bodies in question.
        gripper: pose of the gripper's frame.
        spec: its plates.
    """
    best: ClampTest | None = None
    thin = ((body, slab) for body in furniture for slab in body.slabs if slab.top - slab.bottom <= spec.opening)
    for body, slab in thin:
        found = _test_slab(body.name, slab, body.pose(), gripper, spec)
        rank = (found.clamp is None, found.distance)
        if best is None or rank < (best.clamp is None, best.distance):
            best = found
    if best is None:
        thick = 1000 * spec.opening
        return ClampTest(None, math.inf, f"no edge here is thin enough to be clamped, expected at most {thick:.0f} mm")
    return best


def _test_slab(name: str, slab: Slab, pose: Pose, gripper: Pose, spec: GripperSpec) -> ClampTest:
    """Test one slab of a body."""
    start, middle, end = (
        pose.inverse_point(gripper.point(point))
        for point in (spec.along(spec.plate_start), spec.middle, spec.along(spec.plate_end))
    )
    height = (slab.top + slab.bottom) / 2
    outline = Polygon(slab.outline)
    distance = math.hypot(outline.exterior.distance(Point(middle[:2])), middle[2] - height)
    held = held_interval(slab.outline, start, end)
    depth = (held[1] - held[0]) * (spec.plate_end - spec.plate_start)
    normal = float((pose.matrix.T @ gripper.matrix)[2, 2])
    tilt = math.acos(min(1.0, abs(normal)))
    off = max(abs((1 - t) * start[2] + t * end[2] - height) for t in held)
    room = (spec.opening - (slab.top - slab.bottom)) / 2

    def refuse(why: str) -> ClampTest:
        return ClampTest(None, distance, f"{why}; nearest edge is that of {name}, {distance:.3f} m from the plates")

    if depth <= 0:
        return refuse("nothing lies between the plates")
    if tilt > STEEPEST:
        return refuse(f"expected plates level with the edge, got {math.degrees(tilt):.0f} deg")
    if off > room:
        return refuse(f"expected the edge between the plates, got it {1000 * (off - room):.0f} mm too high or low")
    if depth < LEAST_HOLD:
        return refuse(f"expected {1000 * LEAST_HOLD:.0f} mm of edge between the plates, got {1000 * depth:.0f} mm")
    share = (held[0] + held[1]) / 2
    contact = (1 - share) * start + share * end
    reach = spec.plate_start + share * (spec.plate_end - spec.plate_start)
    return ClampTest(Clamp(name, contact, reach, depth), distance, f"{name} held with {1000 * depth:.0f} mm of edge")


def held_interval(outline: Array, start: Array, end: Array) -> tuple[float, float]:
    """Give the part of the line from the plates' start to their end that is inside an outline.

    Args:
        outline: (k, 2) [m].
        start: (2 or 3,) [m] near end of the plates' middle line, in the outline's frame.
        end: its far end.

    Returns:
        (from, to), fractions of the line, the stretch nearest to the far end; (1, 1) where none is inside.
    """
    line = LineString([start[:2], end[:2]])
    inside = line.intersection(Polygon(outline))
    if line.length == 0 or inside.length == 0:
        return 1.0, 1.0
    pieces = [piece for piece in getattr(inside, "geoms", [inside]) if piece.length > 0]
    spans = [sorted(line.project(Point(corner)) / line.length for corner in piece.coords) for piece in pieces]
    low, high = max((span[0], span[-1]) for span in spans)
    return float(low), float(high)
