"""Wheels on a strut: the one that a plain body may have, and a second one that nobody expects."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bullet_sim.concealed.effect import Effect
from bullet_sim.fittings import Strut
from bullet_sim.furniture import Furniture
from bullet_sim.settings import NonNegative, Positive, Settings, Vector2


class FixedWheelSettings(Settings):
    """A wheel that does not swivel, let down by a spring of constant force.

    As the world model has it: `mu_y = sliding_friction * load / (m g)` across, and along
    `mu_x = rolling_resistance * load / (radius m g)`, or as across where the wheel is locked.

    Attributes:
        position: (x, y) [m] in the body's frame.
        heading: direction in which it rolls [rad], body's frame.
        load: with which it bears on the floor [N].
        sliding_friction: Coulomb coefficient of its tread.
        rolling_resistance: lever f [m].
        radius: [m].
        locked: whether it is braked: it then slides in every direction alike.
    """

    position: Vector2
    heading: Annotated[float, Field(ge=-7, le=7)] = 0.0
    load: Annotated[float, Field(ge=5, le=5000)] = 80.0
    sliding_friction: Positive = 0.7
    rolling_resistance: NonNegative = 0.0
    radius: Annotated[float, Field(ge=0.01, le=0.3)] = 0.05
    locked: bool = False


def wheel_strut(settings: FixedWheelSettings) -> Strut:
    """Make the strut of a fixed wheel."""
    return Strut(
        settings.position,
        settings.load,
        friction=settings.sliding_friction,
        radius=settings.radius,
        heading=None if settings.locked else settings.heading,
        lever=settings.rolling_resistance,
    )


class FixedWheel(Effect):
    """A wheel at work: the baseline's own (`wheel`), or one more (`second_wheel`)."""

    name = "second_wheel"

    def __init__(self, body: Furniture, strut: Strut) -> None:
        """Watch a wheel that is built in already."""
        super().__init__(body.name)
        self._strut = strut

    def strength(self) -> float:
        """Give the friction between wheel and floor [N]."""
        return self._strut.friction_force()

    def acting(self) -> bool:
        """Tell whether the floor holds it with more than a hundredth of its load."""
        return self.strength() > 0.01 * self._strut.load
