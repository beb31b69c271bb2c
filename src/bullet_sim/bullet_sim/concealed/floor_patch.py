"""Floor patch: a region of floor, a carpet or a wet place, with contact friction of its own.

The tile lies flush in the floor. Bullet meets the edge of one body beside another with a bump for whatever slides
across it, so floor and tile are one plane, and a foot has the friction of what is under it: each foot by itself, with
the load that it carries there. Where tiles overlap, the one that was laid last lies on top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from bullet_sim.catalogue import Block
from bullet_sim.client import BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.fittings import Strut
from bullet_sim.furniture import Furniture
from bullet_sim.settings import NonNegative, Outline, Settings


class FloorPatchSettings(Settings):
    """A tile of floor.

    Attributes:
        polygon: its outline [m], `world`.
        friction: Coulomb coefficient of whatever slides on it (feet, blocks); the rest of the floor has its own.
        rolling_resistance: lever f [m] of wheels on it.
    """

    polygon: Outline
    friction: NonNegative = 0.15
    rolling_resistance: NonNegative = 0.0045


class FloorPatch(Effect):
    """One tile, for all that stands in the room.

    Args:
        client: the world.
        bodies: what stands in it.
        settings: what the tile is like.
        target: its number.
        tiles: those that are laid in this room, in their order; it puts itself there.
    """

    name, unit = "floor_patch", "share of feet"

    def __init__(
        self,
        client: BulletClient,
        bodies: list[Furniture],
        settings: FloorPatchSettings,
        target: str,
        tiles: list[FloorPatch],
    ) -> None:
        """Lay the tile."""
        super().__init__(target)
        self._client, self._settings, self._tiles = client, settings, tiles
        tiles.append(self)
        self._floor = client.floor_friction
        self._corners = [(float(x), float(y)) for x, y in settings.polygon]
        self._bodies = [body for body in bodies if body.feet or body.casters or isinstance(body.settings, Block)]
        self._inside: dict[str, float] = {}
        self._blocks = {
            body.name: (body.motion(), Polygon(body.settings.footprint), body.settings.friction)
            for body in self._bodies
            if isinstance(body.settings, Block)
        }
        self._braked: set[Strut] = set()
        self._rolled: dict[str, NDArray[np.bool_]] = {}
        self._levers = {body.name: body.casters.levers.copy() for body in self._bodies if body.casters}
        self._motions = {body.name: body.motion() for body in self._bodies}
        for body in self._bodies:
            if body.feet is not None:
                body.feet.add_tile(self._on_tile)

    def _on_tile(self, coefficient: float, x: float, y: float, speed: float) -> float:
        """Give the friction of a foot: the tile's on the tile."""
        return self._settings.friction if contains(self._corners, x, y) else coefficient

    def update(self, time: float) -> None:
        """Find what stands on the tile, and let wheels and blocks feel it."""
        for body in self._bodies:
            counted: list[float] = []
            if body.feet is not None:
                counted += [float(contains(self._corners, *place)) for place in body.feet.places]
            if body.casters is not None:
                counted += self._roll(body)
            if body.name in self._blocks:
                counted.append(self._slide(body))
            counted += self._brake_struts(body)
            self._inside[body.name] = sum(counted) / max(1, len(counted))

    def _roll(self, body: Furniture) -> list[float]:
        """Set the rolling resistance of casters."""
        assert body.casters is not None
        places = [(x, y) for x, y, _ in body.casters.contacts()]
        on = np.array([contains(self._corners, *place) for place in places])
        was, own = self._rolled.get(body.name, np.zeros_like(on)), self._levers[body.name]
        for wheel in np.flatnonzero(was | on):
            body.casters.levers[wheel] = self._lever(*places[wheel], own[wheel])
        self._rolled[body.name] = on
        return [float(wheel) for wheel in on]

    def _lever(self, x: float, y: float, own: float) -> float:
        """Give the rolling resistance [m] of a wheel at a place (x, y) [m], which has its own on the plain floor."""
        tiles = (tile for tile in reversed(self._tiles) if contains(tile._corners, x, y))
        return next((tile._settings.rolling_resistance for tile in tiles), own)

    def _slide(self, body: Furniture) -> float:
        """Set the friction of a block, which has one coefficient, to the mean over what it stands on."""
        motion, outline, own = self._blocks[body.name]
        motion.look()
        placed = Polygon([motion.point(corner) for corner in outline.exterior.coords[:-1]])
        share = placed.intersection(Polygon(self._corners)).area / placed.area
        if share == self._inside.get(body.name, 0.0):
            return float(share)
        bare, felt, covered = placed, 0.0, 0.0
        for tile in reversed(self._tiles):
            part = bare.intersection(Polygon(tile._corners)).area / placed.area
            felt, covered = felt + part * tile._settings.friction, covered + part
            bare = bare.difference(Polygon(tile._corners))
        number = self._client.body(body.name)
        for link in range(-1, self._client.api.getNumJoints(number)):
            # Bullet multiplies it by the floor's factor, which is no tile's.
            friction = felt / self._floor + (1 - covered) * own
            self._client.api.changeDynamics(number, link, lateralFriction=friction)
        return float(share)

    def _brake_struts(self, body: Furniture) -> list[float]:
        """Set the rolling resistance of wheels on struts, and tell which are on the tile."""
        wheels = [fitting for fitting in body.fittings if isinstance(fitting, Strut) and fitting.rolls]
        if not wheels:
            return []
        motion = self._motions[body.name]
        motion.look()
        for wheel in wheels:
            x, y = motion.point(wheel.place)
            if contains(self._corners, x, y) != (wheel in self._braked):
                self._braked ^= {wheel}
                wheel.set_lever(self._lever(x, y, wheel.lever))
        return [float(wheel in self._braked) for wheel in wheels]

    def strength(self) -> float:
        """Give the largest share of a body's feet or wheels that is on the tile."""
        return max(self._inside.values(), default=0.0)


def contains(corners: list[tuple[float, float]], x: float, y: float) -> bool:
    """Tell whether a place is inside a simple polygon, by the crossings of a ray; shapely takes fifty times as long."""
    inside = False
    last_x, last_y = corners[-1]
    for corner_x, corner_y in corners:
        if (corner_y > y) != (last_y > y) and x < (last_x - corner_x) * (y - corner_y) / (last_y - corner_y) + corner_x:
            inside = not inside
        last_x, last_y = corner_x, corner_y
    return inside
