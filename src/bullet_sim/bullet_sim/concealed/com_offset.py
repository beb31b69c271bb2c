"""Centre of mass off the centroid: ballast bolted to a body, a drawer full of books, a motor under the top."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bullet_sim.casters import LinkTable
from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Positive, Settings, Vector2

Array = NDArray[np.float64]

BALLAST_DENSITY = 2700.0
"""[kg/m^3] aluminium: it is a cube of its mass."""


class ComOffsetSettings(Settings):
    """Ballast that is part of what the body weighs: the rest is that much lighter.

    Attributes:
        mass: of the ballast [kg].
        place: (x, y) [m] in the body's frame.
        height: over the floor [m].
    """

    mass: Positive = 8.0
    place: Vector2
    height: Positive = 0.5


class Ballast:
    """The ballast as a link that does not move; see `fittings.Fitting`."""

    light = False

    def __init__(self, settings: ComOffsetSettings) -> None:
        """Describe it."""
        self.mass, self.place, self._height, self._link = settings.mass, settings.place, settings.height, -1

    def fit(self, client: BulletClient, links: LinkTable, centre: Array) -> None:
        """Append the link."""
        where = [self.place[0] - centre[0], self.place[1] - centre[1], self._height - centre[2]]
        self._link = links.add(self.mass, (-1, -1), where, -1, (0, 0, 1), rigid=True)

    def ready(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Give it the inertia of a cube."""
        side = (self.mass / BALLAST_DENSITY) ** (1 / 3)
        client.api.changeDynamics(client.body(body), self._link, localInertiaDiagonal=[self.mass * side * side / 6] * 3)

    def update(self) -> None:
        """Do nothing: it is bolted on."""


class ComOffset(Effect):
    """How far the ballast moves the centre of mass."""

    name, unit = "com_offset", "m"

    def __init__(self, body: Furniture, settings: ComOffsetSettings, mass: float) -> None:
        """Take note of ballast that is built in; `mass` [kg] is that of the whole body."""
        super().__init__(body.name)
        self._offset = settings.mass / mass * math.hypot(*settings.place)

    def strength(self) -> float:
        """Give the offset [m]."""
        return self._offset
