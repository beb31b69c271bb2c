"""Trapezoidal timing: from rest to rest with bounded speed and acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pbrl_control.errors import ControlError


@dataclass(frozen=True)
class Trapezoid:
    """The quickest way over a distance from rest to rest: speed up, go, slow down.

    Attributes:
        distance: [m], [rad] or whatever the way is measured in; not below zero.
        speed: at most.
        acceleration: at most, up and down.
    """

    distance: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        numbers = (self.distance, self.speed, self.acceleration)
        if not all(map(math.isfinite, numbers)) or self.distance < 0.0 or min(numbers[1:]) <= 0.0:
            raise ControlError(
                "timing: expected a finite distance not below zero, speed and acceleration above zero, got "
                f"{self.distance}, {self.speed}, {self.acceleration}"
            )

    @property
    def peak(self) -> float:
        """The highest speed that is reached: on a short way less than the limit."""
        return min(self.speed, math.sqrt(self.distance * self.acceleration))

    @property
    def ramp(self) -> float:
        """Time to speed up, and to slow down [s]."""
        return self.peak / self.acceleration

    @property
    def duration(self) -> float:
        """Time for the whole way [s]."""
        return self.ramp + self.distance / self.peak if self.distance > 0.0 else 0.0

    def at(self, time: float) -> tuple[float, float, float]:
        """Return way, speed and acceleration at a time [s]; at rest before the start and after the end."""
        end, ramp = self.duration, self.ramp
        if time <= 0.0:
            return 0.0, 0.0, 0.0
        if time >= end:
            return self.distance, 0.0, 0.0
        if time < ramp:
            return 0.5 * self.acceleration * time**2, self.acceleration * time, self.acceleration
        left = end - time
        if left < ramp:
            return self.distance - 0.5 * self.acceleration * left**2, self.acceleration * left, -self.acceleration
        return self.peak * (time - 0.5 * ramp), self.peak, 0.0
