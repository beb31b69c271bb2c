"""Where the cart is in the robot's frame: by the hands that hold it, or by its checkerboard (thesis 4.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrl_control.planar import Array, wrap


@dataclass(frozen=True)
class CartSight:
    """One reading of the cart's pose.

    Attributes:
        time: [s].
        source: "hands" or "checkerboard".
        pose: (3,) of the cart's frame, origin at the grip, in `base` [m, rad].
        misfit: of the hands [m]; not a number: cannot be told.
    """

    time: float
    source: str
    pose: Array
    misfit: float = math.nan

    @property
    def articulation(self) -> float:
        """Of the cart about the grip [rad]."""
        return wrap(float(self.pose[2]))

    def grip_offset(self, grip: Sequence[float]) -> tuple[float, float]:
        """Return where the cart's grip is from where it should be (2,), in `base` [m]."""
        return float(self.pose[0]) - grip[0], float(self.pose[1]) - grip[1]

    def usable(self, now: float, age: float, misfit: float) -> bool:
        """Say whether it can be relied upon: finite, not too old, not from the future, hands as far apart as held."""
        numbers = np.asarray(self.pose, dtype=float)
        fresh = 0.0 <= now - self.time <= age
        return numbers.shape == (3,) and bool(np.isfinite(numbers).all()) and fresh and not abs(self.misfit) > misfit


def choose_sight(now: float, readings: Sequence[CartSight | None], age: float, misfit: float) -> CartSight | None:
    """Return the first reading that can be relied upon; put the hands' first, which jitter least (thesis 4.4).

    Args:
        now: [s].
        readings: in order of preference.
        age: [s] at most.
        misfit: of the hands at most [m].
    """
    return next((each for each in readings if each is not None and each.usable(now, age, misfit)), None)
