"""Seeded floor plans: a corridor between two rows of rooms, a side corridor off it, and far rooms at its end.

    +------+-----+--------+------+
    | n1   | n2  | n3     | n4   |
    +--  --+-  --+---  ---+-  ---+
      corridor
    +---  --+-  --+    +---  ----+
    | s1    | s2  |side| s3      |
    +-------+-----+    +---------+
    | far_west    -    -  far_east|
    +---------------  ------------+

To get from the corridor into a room, or into the side corridor, robot and cart have to take a turn by 90 degrees
between walls (thesis figure 16).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from pydantic import Field

from bullet_sim.settings import Settings
from pr2_cart_sim.maps import FREE, OCCUPIED, UNKNOWN, GridMap

Array = NDArray[np.float64]
Rectangle = tuple[float, float, float, float]
"""Left, bottom, right, top [m]."""
Metres = Annotated[float, Field(gt=0.5, le=30)]
Range = tuple[Metres, Metres]

FAR_WIDTH = 6.0
"""Of the rooms at the end of the side corridor at most [m]."""
DOOR_MARGIN = 0.5
"""From a room's corner to its door at least [m]."""


class OfficePlan(Settings):
    """What an office is like; where a pair is given, values are drawn between the two.

    Attributes:
        rooms: north of the corridor; south of it there is one less, and the side corridor.
        room_width: along the corridor [m].
        room_depth: [m].
        corridor: width of the corridors [m].
        door: width of the doors [m].
        wall: thickness of the walls [m].
        resolution: of the map [m].
        furniture: pieces in a room, at least and at most; none of them is in the map.
        hung: share of desks and tables that are fixed to the wall, with room underneath: a laser low over the floor
            does not see them.
        movable: how many chairs there are that can be pushed.
        corridor_things: how many things stand at the corridor's walls.
        people: how many people walk about.
        people_speed: [m/s].
    """

    rooms: Annotated[int, Field(ge=2, le=12)] = 4
    room_width: Range = (3.6, 5.2)
    room_depth: Range = (4.0, 5.2)
    corridor: Range = (2.1, 2.5)
    door: Range = (1.05, 1.25)
    wall: Annotated[float, Field(ge=0.05, le=0.5)] = 0.15
    resolution: Annotated[float, Field(ge=0.01, le=0.2)] = 0.05
    furniture: tuple[Annotated[int, Field(ge=0, le=8)], Annotated[int, Field(ge=0, le=8)]] = (1, 3)
    hung: Annotated[float, Field(ge=0, le=1)] = 0.0
    movable: Annotated[int, Field(ge=0, le=20)] = 2
    corridor_things: Annotated[int, Field(ge=0, le=20)] = 2
    people: Annotated[int, Field(ge=0, le=50)] = 5
    people_speed: tuple[Annotated[float, Field(gt=0, le=3)], Annotated[float, Field(gt=0, le=3)]] = (0.8, 1.3)


@dataclass(frozen=True)
class RoomPlan:
    """One room: its free floor, and its door as a rectangle through the wall."""

    name: str
    floor: Rectangle
    door: Rectangle

    @property
    def centre(self) -> Array:
        """Middle of the floor (2,) [m]."""
        left, bottom, right, top = self.floor
        return np.array([(left + right) / 2, (bottom + top) / 2])

    @property
    def doorway(self) -> tuple[Array, Array]:
        """Places (2,) [m] in the middle of the door, half a metre inside and half a metre outside."""
        left, bottom, right, top = self.door
        middle = np.array([(left + right) / 2, (bottom + top) / 2])
        across = right - left > top - bottom  # the wall runs along x
        off = np.array([0.0, (top - bottom) / 2 + 0.5]) if across else np.array([(right - left) / 2 + 0.5, 0.0])
        inside = off if (self.centre - middle) @ off > 0 else -off
        return middle + inside, middle - inside


@dataclass(frozen=True)
class FloorPlan:
    """All rooms, and the corridor and the side corridor as rectangles."""

    rooms: tuple[RoomPlan, ...]
    corridor: Rectangle
    side: Rectangle

    @property
    def free(self) -> tuple[Rectangle, ...]:
        """Everything that is floor."""
        return (self.corridor, self.side, *(part for room in self.rooms for part in (room.floor, room.door)))


def draw_plan(plan: OfficePlan, rng: Generator) -> FloorPlan:
    """Draw an office.

    Args:
        plan: what it is like.
        rng: draws sizes and doors.
    """
    wall, width = plan.wall, _snap(rng.uniform(*plan.corridor), plan.resolution)
    north = _row(plan, rng, plan.rooms)
    length = sum(north) + wall * (len(north) - 1)
    north_depth, south_depth, far_depth = (_snap(rng.uniform(*plan.room_depth), plan.resolution) for _ in range(3))
    rooms = []
    at = 0.0
    for number, wide in enumerate(north):
        floor = (at, width + wall, at + wide, width + wall + north_depth)
        rooms.append(RoomPlan(f"n{number + 1}", floor, _door_in_wall(plan, rng, floor, width, width + wall)))
        at += wide + wall
    south = _scaled(_row(plan, rng, plan.rooms - 1), length - width - (plan.rooms - 1) * wall, plan.resolution)
    before = int(rng.integers(1, plan.rooms)) if plan.rooms > 2 else 1
    low = -wall - south_depth
    at, side_left = 0.0, 0.0
    for number, wide in enumerate(south):
        if number == before:
            side_left, at = at, at + width + wall
        floor = (at, low, min(at + wide, length), -wall)
        rooms.append(RoomPlan(f"s{number + 1}", floor, _door_in_wall(plan, rng, floor, -wall, 0.0)))
        at += wide + wall
    if before >= len(south):
        side_left = at
    side = (side_left, low - wall - far_depth, min(side_left + width, length), 0.0)
    return FloorPlan((*rooms, *_far_rooms(plan, rng, side, low, length)), (0.0, 0.0, length, width), side)


def _far_rooms(plan: OfficePlan, rng: Generator, side: Rectangle, low: float, length: float) -> list[RoomPlan]:
    """Put rooms on both sides of the side corridor's far end, where there is space for them."""
    wall, rooms = plan.wall, []
    bottom, top = side[1], low - wall
    spans = {
        "far_west": (max(0.0, side[0] - wall - FAR_WIDTH), side[0] - wall),
        "far_east": (side[2] + wall, min(length, side[2] + wall + FAR_WIDTH)),
    }
    for name, (left, right) in spans.items():
        if right - left < plan.room_width[0] - 1.0:
            continue
        wide = rng.uniform(*plan.door)
        start = _snap(rng.uniform(bottom + DOOR_MARGIN, top - DOOR_MARGIN - wide), plan.resolution)
        edge = (right, right + wall) if name == "far_west" else (left - wall, left)
        rooms.append(RoomPlan(name, (left, bottom, right, top), (edge[0], start, edge[1], start + wide)))
    return rooms


def _row(plan: OfficePlan, rng: Generator, count: int) -> list[float]:
    return [_snap(rng.uniform(*plan.room_width), plan.resolution) for _ in range(count)]


def _scaled(widths: list[float], total: float, resolution: float) -> list[float]:
    """Stretch widths so that they sum up to `total`."""
    stretched = [_snap(wide * total / sum(widths), resolution) for wide in widths]
    stretched[-1] += total - sum(stretched)
    return stretched


def _door_in_wall(plan: OfficePlan, rng: Generator, floor: Rectangle, low: float, high: float) -> Rectangle:
    """Place a door in the wall between `low` and `high`, along x."""
    wide = rng.uniform(*plan.door)
    start = _snap(rng.uniform(floor[0] + DOOR_MARGIN, floor[2] - DOOR_MARGIN - wide), plan.resolution)
    return (start, low, start + wide, high)


def _snap(value: float, resolution: float) -> float:
    return float(round(value / resolution) * resolution)


def draw_map(floor: FloorPlan, plan: OfficePlan) -> GridMap:
    """Draw the map of an office: floor, and walls around it; what is behind them is unknown."""
    free = np.array(floor.free)
    margin = plan.wall + 2 * plan.resolution
    origin = free[:, :2].min(axis=0) - margin
    size = free[:, 2:].max(axis=0) + margin - origin
    columns, rows = np.ceil(size / plan.resolution - 1e-9).astype(int)
    mask = np.zeros((rows, columns), np.uint8)
    for left, bottom, right, top in np.round((free - np.tile(origin, 2)) / plan.resolution).astype(int).tolist():
        mask[bottom:top, left:right] = 1
    thick = 2 * max(1, round(plan.wall / plan.resolution)) + 1
    walls = cv2.dilate(mask, np.ones((thick, thick), np.uint8))
    cells = np.full(mask.shape, UNKNOWN, np.int8)
    cells[walls == 1] = OCCUPIED
    cells[mask == 1] = FREE
    return GridMap(plan.resolution, (float(origin[0]), float(origin[1])), cells)
