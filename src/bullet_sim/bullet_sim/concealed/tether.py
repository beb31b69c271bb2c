"""Tether: an elastic cord from a point of a body to a hook in the room, slack below its length."""

from __future__ import annotations

import math

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import NonNegative, Settings, Stiffness, Vector3


class TetherSettings(Settings):
    """A cord: a cable that has caught on something, a rubber strap, a spring.

    Attributes:
        anchor: where it is hooked in the room (3,) [m], `world`.
        point: where it is tied to the body (3,) [m], body's frame; z counts from the top, downwards is negative.
        slack_length: below it the cord hangs loose [m].
        stiffness: beyond that [N/m].
        damping: of the cord while it lengthens or shortens taut [N s/m]; a cord never pushes.
    """

    anchor: Vector3
    point: Vector3 = (0.0, 0.0, -0.05)
    slack_length: NonNegative = 0.5
    stiffness: Stiffness = 60.0
    damping: NonNegative = 0.0


class Tether(Effect):
    """The cord, straight between its ends, heights included."""

    name = "tether"

    def __init__(self, client: BulletClient, body: Furniture, settings: TetherSettings) -> None:
        """Tie it."""
        super().__init__(body.name)
        self._motion, self._settings, self._tension = body.motion(), settings, 0.0

    def update(self, time: float) -> None:
        """Pull, where it is taut."""
        motion, settings = self._motion, self._settings
        motion.look()
        x, y = motion.point(settings.point)
        z = motion.height + settings.point[2]
        dx, dy, dz = settings.anchor[0] - x, settings.anchor[1] - y, settings.anchor[2] - z
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        excess = length - settings.slack_length
        self._tension = 0.0
        if excess <= 0 or length == 0:
            return
        vx, vy = motion.speed_at((x, y))
        lengthening = -(vx * dx + vy * dy) / length
        self._tension = max(0.0, settings.stiffness * excess + settings.damping * lengthening)
        pull = self._tension / length
        motion.push((pull * dx, pull * dy, pull * dz), (x, y, z))

    def strength(self) -> float:
        """Give the tension [N]."""
        return self._tension
