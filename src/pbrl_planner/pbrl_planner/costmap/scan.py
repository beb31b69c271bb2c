"""One scan of a planar laser, as its driver gives it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError

MOST_BEAMS = 100_000


@dataclass(frozen=True)
class RangeScan:
    """Ranges around a laser.

    A range that is not a number, or below the least, says nothing. One beyond the greatest, infinity among them, says
    that nothing is there.

    Attributes:
        time: when it was taken [s].
        angle_min: of the first beam in the laser's frame [rad].
        increment: between beams [rad].
        span: least and greatest range that means something [m].
        ranges: (n,) [m].

    Raises:
        PlannerError: a number or shape is not what it should be.
    """

    time: float
    angle_min: float
    increment: float
    span: tuple[float, float]
    ranges: Array

    def __post_init__(self) -> None:
        ranges = np.ascontiguousarray(self.ranges, dtype=float)
        if ranges.ndim != 1 or len(ranges) > MOST_BEAMS:
            raise PlannerError(f"scan: expected ranges (n,) of at most {MOST_BEAMS} beams, got shape {ranges.shape}")
        numbers = {"time": self.time, "angle_min": self.angle_min, "increment": self.increment}
        for name, value in numbers.items():
            if not math.isfinite(value):
                raise PlannerError(f"scan: expected a finite {name}, got {value}")
        if abs(self.increment) * len(ranges) > 2.0 * math.pi + 1.0:
            raise PlannerError(f"scan: expected beams within one turn, got {len(ranges)} each {self.increment} rad")
        low, high = self.span
        if not (math.isfinite(high) and 0.0 <= low < high):
            raise PlannerError(f"scan: expected a span 0 <= least < greatest, got {low} and {high} m")
        object.__setattr__(self, "ranges", ranges)
