"""Floor slope: the floor, and all that is measured from it, tilts against gravity."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.settings import Settings


class FloorSlopeSettings(Settings):
    """A tilted floor; `world` is tilted with it.

    Attributes:
        angle: of the floor against the level [rad].
        heading: direction that goes downhill, in `world` [rad].
    """

    angle: Annotated[float, Field(gt=0, le=0.2)]
    heading: Annotated[float, Field(ge=-7, le=7)] = 0.0

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of fall (3,) [m/s^2] in `world`."""
        along = GRAVITY * math.sin(self.angle)
        return along * math.cos(self.heading), along * math.sin(self.heading), -GRAVITY * math.cos(self.angle)


class FloorSlope(Effect):
    """Gravity that does not pull straight down."""

    name, unit = "floor_slope", "m/s^2"

    def __init__(self, client: BulletClient, settings: FloorSlopeSettings) -> None:
        """Tilt the room."""
        super().__init__("room")
        self._pull = math.hypot(*settings.gravity[:2])
        client.api.setGravity(*settings.gravity)

    def strength(self) -> float:
        """Give the pull along the floor [m/s^2]."""
        return self._pull
