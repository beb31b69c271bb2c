"""Detent: a catch that holds a body at one configuration: a magnet under the top passes over one in the floor stand.

Two dipoles, both upright, a gap g apart in height and d apart in the plane, with r^2 = d^2 + g^2, have
the energy U = K (1 / r^3 - 3 g^2 / r^5). The force along the plane,

    F = 3 K d / r^5 (5 g^2 / r^2 - 1),

draws the body into the catch from within two gaps, peaks at 0.39 g, and pushes it softly away from further out.
"""

from __future__ import annotations

import math

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Positive, Settings, Vector2


class DetentSettings(Settings):
    """A pair of magnets.

    Attributes:
        place: (x, y) [m] of the magnet in the room, `world`.
        point: (x, y) [m] of the magnet in the body, body's frame.
        force: greatest force along the plane [N].
        gap: between the magnets' middles when one is above the other [m].
    """

    place: Vector2
    point: Vector2 = (0.0, 0.0)
    force: Positive = 20.0
    gap: Positive = 0.05


def catch_force(distance: float, gap: float) -> float:
    """Give the force towards the catch at a distance [m] in the plane, for K = 1 N m^4."""
    r2 = distance * distance + gap * gap
    return 3 * distance / r2**2.5 * (5 * gap * gap / r2 - 1)


def peak_distance(gap: float) -> float:
    """Give the distance [m] at which the force peaks: where 4 u^4 - 27 u^2 + 4 = 0 with u = d / g."""
    return gap * math.sqrt((27 - math.sqrt(27**2 - 64)) / 8)


class Detent(Effect):
    """The magnets."""

    name = "detent"

    def __init__(self, client: BulletClient, body: Furniture, settings: DetentSettings) -> None:
        """Mount them."""
        super().__init__(body.name)
        self._motion, self._settings, self._force = body.motion(), settings, 0.0
        self._scale = settings.force / catch_force(peak_distance(settings.gap), settings.gap)

    def update(self, time: float) -> None:
        """Pull the body's magnet towards the room's."""
        motion, settings = self._motion, self._settings
        motion.look()
        x, y = motion.point(settings.point)
        dx, dy = settings.place[0] - x, settings.place[1] - y
        distance = math.hypot(dx, dy)
        self._force = 0.0
        if distance > 0:
            self._force = self._scale * catch_force(distance, settings.gap)
            pull = self._force / distance
            motion.push((pull * dx, pull * dy, 0.0), (x, y, motion.height))

    def strength(self) -> float:
        """Give the force along the plane [N]."""
        return abs(self._force)

    def acting(self) -> bool:
        """Tell whether it pulls with a tenth of its greatest force."""
        return self.strength() > 0.1 * self._settings.force
