"""External force: something outside pushes: a fan, a leaning person, a cable that is reeled in, a swaying ship."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Positive, Settings, Vector3

Moment = Annotated[float, Field(ge=0, le=3600)]


class ExternalForceSettings(Settings):
    """A push from outside, along the floor's axes.

    Attributes:
        force: (fx, fy) [N] in `world`: the steady push, or the amplitude of a periodic one.
        point: (x, y, z) [m] of the body on which it acts, body's frame.
        period: [s]; None: it is steady.
        phase: of a periodic push at time zero [rad].
        start: when it begins [s].
        end: when it ends [s].
    """

    force: tuple[Annotated[float, Field(ge=-500, le=500)], Annotated[float, Field(ge=-500, le=500)]]
    point: Vector3 = (0.0, 0.0, -0.2)
    period: Positive | None = None
    phase: float = 0.0
    start: Moment = 0.0
    end: Moment = 3600.0


class ExternalForce(Effect):
    """The push."""

    name = "external_force"

    def __init__(self, client: BulletClient, body: Furniture, settings: ExternalForceSettings) -> None:
        """Get ready to push."""
        super().__init__(body.name)
        self._motion, self._settings, self._share = body.motion(), settings, 0.0

    def update(self, time: float) -> None:
        """Push."""
        motion, settings = self._motion, self._settings
        self._share = 0.0
        if not settings.start <= time < settings.end:
            return
        self._share = 1.0
        if settings.period is not None:
            self._share = math.sin(2 * math.pi * time / settings.period + settings.phase)
        motion.look()
        x, y = motion.point(settings.point)
        force = (self._share * settings.force[0], self._share * settings.force[1], 0.0)
        motion.push(force, (x, y, motion.height + settings.point[2]))

    def strength(self) -> float:
        """Give its magnitude now [N]."""
        return abs(self._share) * math.hypot(*self._settings.force)

    def acting(self) -> bool:
        """Tell whether it is on."""
        return self._share != 0
