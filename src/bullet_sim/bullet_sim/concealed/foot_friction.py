"""Feet that slide: contact friction under each (`ground_friction`), and more of it at rest (`breakaway_friction`).

The coefficient of each foot follows its own slip speed, and its force the load that it carries then; see `feet.py`.
Armstrong-Helouvry et al. 1994, A survey of models for machines with friction (the Stribeck curve).
"""

from __future__ import annotations

import math
from typing import Self

from pydantic import model_validator

from bullet_sim.concealed.effect import Effect
from bullet_sim.feet import Feet
from bullet_sim.fittings import Strut
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Fraction, Positive, Settings

GLIDE_RADIUS = 0.02
"""Of a glide [m]."""

INSET = 0.8
"""Where glides are, as a share of the way from the middle to the casters beside them."""


class OnGlides(Settings):
    """What slides. A plain table slides on its feet; under a body on casters sprung glides are let down beside them.

    Attributes:
        load_share: of the weight that the glides of a body on casters carry.
    """

    load_share: Fraction = 0.3


class GroundFrictionSettings(OnGlides):
    """Feet with sliding friction.

    Attributes:
        friction: Coulomb coefficient of the feet.
    """

    friction: Positive = 0.1


class BreakawayFrictionSettings(OnGlides):
    """Feet that stick: friction falls from `static` at rest to `sliding` with the speed of the foot.

    Attributes:
        static: Coulomb coefficient at rest.
        sliding: Coulomb coefficient far beyond `speed`.
        speed: at which the excess has fallen to 37 % [m/s].
    """

    static: Positive = 0.12
    sliding: Positive = 0.06
    speed: Positive = 0.02

    @model_validator(mode="after")
    def _sticks(self) -> Self:
        if self.static <= self.sliding:
            raise ValueError(f"static: expected more than sliding, {self.sliding:g}, got {self.static:g}")
        return self


def glides(places: list[tuple[float, float]], weight: float, share: float) -> list[Strut]:
    """Give the glides that are let down beside casters.

    Args:
        places: of the casters [m], body's frame.
        weight: of the body [N].
        share: of it that the glides carry.
    """
    load = share * weight / len(places)
    return [Strut((INSET * x, INSET * y), load, friction=0.0, radius=GLIDE_RADIUS) for x, y in places]


class FootFriction(Effect):
    """Friction at the feet of one body.

    Attributes:
        feet: the feet that slide.
    """

    def __init__(self, body: Furniture, feet: Feet) -> None:
        """Watch feet whose friction is set."""
        super().__init__(body.name)
        self.feet = feet

    def strength(self) -> float:
        """Give the sum of the feet's friction in the last step [N]."""
        return sum(self.feet.friction)

    def acting(self) -> bool:
        """Tell whether it resists with half a newton or more."""
        return self.strength() > 0.5


class GroundFriction(FootFriction):
    """The same friction at any speed."""

    name = "ground_friction"

    def __init__(self, body: Furniture, feet: Feet, settings: GroundFrictionSettings) -> None:
        """Roughen the feet."""
        super().__init__(body, feet)
        feet.add_law(lambda coefficient, x, y, speed: coefficient + settings.friction)


class BreakawayFriction(FootFriction):
    """Friction that is largest at rest."""

    name, unit = "breakaway_friction", "1"

    def __init__(self, body: Furniture, feet: Feet, settings: BreakawayFrictionSettings) -> None:
        """Make the feet stick."""
        super().__init__(body, feet)
        self._settings = settings
        feet.add_law(lambda coefficient, x, y, speed: coefficient + stribeck(settings, speed))

    def strength(self) -> float:
        """Give the largest excess of a foot's coefficient over that of sliding, while friction acts."""
        if super().strength() <= 0.5:
            return 0.0
        return max(stribeck(self._settings, speed) for speed in self.feet.speeds) - self._settings.sliding

    def acting(self) -> bool:
        """Tell whether a foot feels a tenth of the excess or more."""
        return self.strength() > 0.1 * (self._settings.static - self._settings.sliding)


def stribeck(settings: BreakawayFrictionSettings, speed: float) -> float:
    """Give the coefficient of a foot that slips with `speed` [m/s]."""
    return settings.sliding + (settings.static - settings.sliding) * math.exp(-((speed / settings.speed) ** 2))
