"""Hidden hinge: a pin joins a body to something that does not move, in a rubber bushing, with play where it is worn."""

from __future__ import annotations

import math

from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Fraction, NonNegative, Settings, Stiffness, Vector2

SHOWN = 0.45
"""Share of its mass that a body shows at its edge, about; the bushing's damping ratio is meant for it."""

STIFFEST = 0.025
"""Of the mass over the squared physics step: a stiffer bushing shakes in steps of that length."""


class HiddenHingeSettings(Settings):
    """A pin where the body stands at the start; it gives way sideways only, and carries no weight.

    Attributes:
        point: (x, y) [m] of the body through which it goes, body's frame.
        stiffness: of the bushing [N/m].
        damping_ratio: of it, with 0.45 of the body's mass.
        play: between pin and hole, either side [m].
        height: of the pin over the floor [m].
        friction: torque against turning about it [N m], as long as it turns faster than 0.02 rad/s; less below.
    """

    point: Vector2
    stiffness: Stiffness = 4.0e4
    damping_ratio: Fraction = 0.3
    play: NonNegative = 0.0
    height: NonNegative = 0.5
    friction: NonNegative = 0.0


class HiddenHinge(Effect):
    """The pin: a point of the body held at a point of the room."""

    name = "hidden_hinge"

    def __init__(self, client: BulletClient, body: Furniture, settings: HiddenHingeSettings, mass: float) -> None:
        """Set the pin where the body, of `mass` [kg], stands.

        Raises:
            SimError: a bushing too stiff for the body and the physics step.
        """
        super().__init__(body.name)
        most = STIFFEST * mass / client.step_time**2
        if settings.stiffness > most:
            raise SimError(
                f"concealed.hidden_hinge.{body.name}.stiffness: expected at most {most:.0f} N/m for {mass:g} kg and "
                f"steps of {client.step_time:g} s, got {settings.stiffness:g}; take a softer bushing"
            )
        self._motion, self._settings, self._force = body.motion(), settings, 0.0
        self.pivot = self._motion.point(settings.point)
        self._damping = 2 * settings.damping_ratio * math.sqrt(settings.stiffness * SHOWN * mass)

    def update(self, time: float) -> None:
        """Hold."""
        motion, settings = self._motion, self._settings
        motion.look()
        x, y = motion.point(settings.point)
        dx, dy = self.pivot[0] - x, self.pivot[1] - y
        away = math.hypot(dx, dy)
        self._force = 0.0
        if away > settings.play:
            vx, vy = motion.speed_at((x, y))
            pull = settings.stiffness * (away - settings.play) / away
            force_x, force_y = pull * dx - self._damping * vx, pull * dy - self._damping * vy
            self._force = math.hypot(force_x, force_y)
            motion.push((force_x, force_y, 0.0), (x, y, settings.height))
        if settings.friction > 0:
            motion.turn(-settings.friction * math.tanh(motion.spin / 0.01))

    def strength(self) -> float:
        """Give the force on the pin [N]."""
        return self._force

    def acting(self) -> bool:
        """Tell whether it holds with half a newton or more."""
        return self._force > 0.5
