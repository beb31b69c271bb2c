"""Motion primitives: short motions between poses of the lattice, out of which plans are put together (thesis 4.5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_control.settings import Positive, Section
from pbrl_planner.errors import PlannerError

CLOSING = 0.5  # of a cell, or of the way to the next heading, that an end may be off: files that are about round so
CLOSING_ARTICULATION = 0.01  # [rad]
REACH = 200  # cells that one primitive goes at most
TURN = 2.0 * math.pi


class Pace(Section):
    """How fast the robot goes along a primitive: the cost of an edge is time (thesis 4.5.3).

    Attributes:
        speed: [m/s] of the robot's centre.
        yaw_rate: [rad/s].
        articulation_rate: [rad/s] of the cart about the grip.
    """

    speed: Positive = 0.5
    yaw_rate: Positive = 0.6
    articulation_rate: Positive = 0.4


@dataclass(frozen=True)
class Primitive:
    """One motion from a heading and articulation.

    Attributes:
        start: bins of heading and articulation.
        end: cells along x and y, and bins of heading and articulation, where it ends.
        poses: (n, 4) x, y relative to the first cell's centre, axes of the map, heading, articulation [m, m, rad, rad].
        multiplier: of its cost, for what is hard to do or not wanted.
        name: what kind it is, in a word.
    """

    start: tuple[int, int]
    end: tuple[int, int, int, int]
    poses: Array
    multiplier: int = 1
    name: str = ""


@dataclass(frozen=True)
class PrimitiveSet:
    """All primitives of a lattice.

    Attributes:
        resolution: of the lattice [m].
        headings: bins of heading; bin k is k full turns over `headings`.
        articulations: (a,) of the cart about the grip [rad], ascending; (0.0,) where there is no cart.
        primitives: all of them.

    Raises:
        PlannerError: a primitive does not begin or end on the lattice, or does nothing.
    """

    resolution: float
    headings: int
    articulations: tuple[float, ...]
    primitives: tuple[Primitive, ...]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.resolution) and self.resolution > 0.0):
            raise PlannerError(f"primitives: expected a resolution above zero, got {self.resolution}")
        if not 1 <= self.headings <= 256:
            raise PlannerError(f"primitives: expected 1 to 256 headings, got {self.headings}")
        ascending = all(a < b for a, b in pairwise(self.articulations))
        if not (1 <= len(self.articulations) <= 64 and ascending and np.isfinite(self.articulations).all()):
            raise PlannerError(f"primitives: expected 1 to 64 ascending articulations, got {self.articulations}")
        if not self.primitives:
            raise PlannerError("primitives: expected one at least, got none")
        for number, primitive in enumerate(self.primitives):
            fault = closing_fault(primitive, self.resolution, self.headings, self.articulations)
            if fault:
                raise PlannerError(f"primitive {number} {primitive.name}: {fault}")

    @property
    def bins(self) -> int:
        """Of heading and articulation together; heading * articulations + articulation is a bin's number."""
        return self.headings * len(self.articulations)

    def bin_of(self, heading: int, articulation: int) -> int:
        """Return the number of a bin."""
        return heading * len(self.articulations) + articulation

    def base_costs(self, pace: Pace) -> NDArray[np.int64]:
        """Return each primitive's cost (p,) on floor of cost 0: time in milliseconds, rounded up, times its multiplier.

        The time is the longest of way over speed, turn over yaw rate and articulation over its rate.
        """
        return np.array([self._milliseconds(p, pace) * p.multiplier for p in self.primitives], dtype=np.int64)

    def _milliseconds(self, primitive: Primitive, pace: Pace) -> int:
        way = float(np.hypot(*np.diff(primitive.poses[:, :2], axis=0).T).sum())
        turned = turned_angle(primitive, self.headings)
        articulated = abs(self.articulations[primitive.end[3]] - self.articulations[primitive.start[1]])
        seconds = max(way / pace.speed, turned / pace.yaw_rate, articulated / pace.articulation_rate)
        return math.ceil(1000.0 * seconds)


def turned_angle(primitive: Primitive, headings: int) -> float:
    """Return the angle that a primitive turns by, the short way round [rad].

    Taken from the bins' angles and in this order, it is SBPL's to the last bit. That matters where times are rounded
    up: a turn over the last heading to the first takes 10 s there, or a millisecond more.
    """
    bin_size = TURN / headings
    turned = abs(primitive.start[0] * bin_size - primitive.end[2] * bin_size)
    return min(turned, abs(turned - TURN))


def centre_cells(primitive: Primitive, resolution: float) -> list[tuple[int, int]]:
    """Return the cells (x, y), relative to the first, that the poses are in, in order, first and last cell left out."""
    places = np.floor(primitive.poses[:, :2] / resolution + 0.5).astype(int)
    ends = {(0, 0), primitive.end[:2]}
    return [cell for cell in dict.fromkeys((int(x), int(y)) for x, y in places) if cell not in ends]


def closing_fault(primitive: Primitive, resolution: float, headings: int, articulations: tuple[float, ...]) -> str:
    """Return what is wrong with a primitive on a lattice, in words; empty where nothing is."""
    (heading, phi), (dx, dy, end_heading, end_phi) = primitive.start, primitive.end
    if not (0 <= heading < headings and 0 <= end_heading < headings):
        return f"expected headings from 0 to {headings - 1}, got {heading} and {end_heading}"
    if not (0 <= phi < len(articulations) and 0 <= end_phi < len(articulations)):
        return f"expected articulations from 0 to {len(articulations) - 1}, got {phi} and {end_phi}"
    if max(abs(dx), abs(dy)) > REACH:
        return f"expected an end at most {REACH} cells away, got ({dx}, {dy})"
    if (dx, dy) == (0, 0) and (heading, phi) == (end_heading, end_phi):
        return "expected a motion, got one that ends where it begins"
    if not 1 <= primitive.multiplier <= 10_000:
        return f"expected a cost multiplier from 1 to 10000, got {primitive.multiplier}"
    poses = np.asarray(primitive.poses)
    if poses.ndim != 2 or poses.shape[1] != 4 or len(poses) < 2 or not np.isfinite(poses).all():
        return f"expected finite poses (n, 4) with n >= 2, got shape {poses.shape}"
    if float(np.abs(poses[:, :2]).max()) > 2 * REACH * resolution:
        return f"expected poses within {2 * REACH} cells, got one {np.abs(poses[:, :2]).max():g} m away"
    places = np.array([[0.0, 0.0], [dx * resolution, dy * resolution]])
    off = np.hypot(*(poses[[0, -1], :2] - places).T)
    angles = [heading * TURN / headings, end_heading * TURN / headings]
    turned = [
        abs(math.remainder(float(pose[2]) - angle, TURN)) for pose, angle in zip(poses[[0, -1]], angles, strict=True)
    ]
    bent = np.abs(poses[[0, -1], 3] - [articulations[phi], articulations[end_phi]])
    for k, which in enumerate(("first", "last")):
        if off[k] > CLOSING * resolution:
            x, y = places[k]
            return f"expected the {which} pose at ({x:g}, {y:g}) m, got ({poses[-k, 0]:g}, {poses[-k, 1]:g})"
        if turned[k] > CLOSING * TURN / headings:
            return f"expected the {which} pose to head {angles[k]:.4f} rad, got {poses[-k, 2]:g}"
        if bent[k] > CLOSING_ARTICULATION:
            return f"expected the {which} pose to be articulated as its bin, got {poses[-k, 3]:g} rad"
    return ""
