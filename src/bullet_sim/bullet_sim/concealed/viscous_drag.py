"""Viscous drag: each foot stands in a film of grease or on a felt pad that resists in proportion to its own speed."""

from __future__ import annotations

import math

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Positive, Settings


class ViscousDragSettings(Settings):
    """Films under the feet, casters or corners of a body.

    Attributes:
        damping: of all films together [N s/m].
    """

    damping: Positive = 40.0


class ViscousDrag(Effect):
    """The films: forces at the floor, under each foot, against the way that foot goes."""

    name = "viscous_drag"

    def __init__(
        self,
        client: BulletClient,
        body: Furniture,
        places: list[tuple[float, float]],
        settings: ViscousDragSettings,
    ) -> None:
        """Grease the floor under `places` (n, 2) [m] of the body."""
        super().__init__(body.name)
        self._motion, self._places, self._drag = body.motion(), places, 0.0
        self._share = settings.damping / len(places)

    def update(self, time: float) -> None:
        """Resist."""
        motion = self._motion
        motion.look()
        self._drag = 0.0
        for place in self._places:
            x, y = motion.point(place)
            vx, vy = motion.speed_at((x, y))
            motion.push((-self._share * vx, -self._share * vy, 0.0), (x, y, 0.0))
            self._drag += self._share * math.hypot(vx, vy)

    def strength(self) -> float:
        """Give the sum of the films' forces [N]."""
        return self._drag

    def acting(self) -> bool:
        """Tell whether they resist with a tenth of a newton or more."""
        return self._drag > 0.1
