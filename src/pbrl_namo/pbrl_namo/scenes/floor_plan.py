"""Floor plans of random offices: rooms in rows and columns, partition walls with doors, built-in desks along walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from shapely import Polygon, box

from pbrl_namo.scenes.settings import OfficeSettings

CORNER = 0.35
"""Between a door and the end of its wall [m]."""

IN_FRONT = 1.3
"""Depth of the floor before a door that nothing is built into [m]."""

UNEVEN = 0.15
"""Share by which widths of rooms differ from their mean."""

Room = tuple[int, int]


@dataclass(frozen=True)
class Door:
    """A doorway in a partition wall.

    Attributes:
        x, y: of its middle [m].
        width: clear [m].
        upright: its wall runs along y.
    """

    x: float
    y: float
    width: float
    upright: bool

    def zone(self, depth: float) -> Polygon:
        """Return the floor on both sides of it, to a depth [m]."""
        half_x, half_y = (depth, self.width / 2.0) if self.upright else (self.width / 2.0, depth)
        return box(self.x - half_x, self.y - half_y, self.x + half_x, self.y + half_y)


@dataclass
class FloorPlan:
    """Walls, doors and what is built in, in `world`, with a corner of the floor at the origin.

    Attributes:
        xs, ys: middles of the walls, outer edges of the floor at both ends [m].
        doors: between the rooms.
        fixed: walls and built-in furniture by name.
    """

    xs: np.ndarray
    ys: np.ndarray
    doors: list[Door] = field(default_factory=list)
    fixed: dict[str, Polygon] = field(default_factory=dict)

    @property
    def outline(self) -> Polygon:
        """Return the free floor's outline."""
        return box(0.0, 0.0, float(self.xs[-1]), float(self.ys[-1]))

    def room(self, room: Room, wall: float) -> Polygon:
        """Return one room's floor between its walls of a thickness [m]."""
        i, j = room
        low_x = self.xs[i] + (wall / 2.0 if i else 0.0)
        low_y = self.ys[j] + (wall / 2.0 if j else 0.0)
        high_x = self.xs[i + 1] - (wall / 2.0 if i + 2 < len(self.xs) else 0.0)
        high_y = self.ys[j + 1] - (wall / 2.0 if j + 2 < len(self.ys) else 0.0)
        return box(float(low_x), float(low_y), float(high_x), float(high_y))

    @property
    def rooms(self) -> list[Room]:
        """Return the rooms by column and row."""
        return [(i, j) for i in range(len(self.xs) - 1) for j in range(len(self.ys) - 1)]


def draw_plan(count: int, rng: np.random.Generator, settings: OfficeSettings) -> FloorPlan:
    """Draw a floor plan for a number of movable things; without any, every room can be reached."""
    wanted = max(2, round(count / settings.things_per_room))
    columns = max(2, round(math.sqrt(wanted)))
    rows = math.ceil(wanted / columns)
    side = math.sqrt(settings.area_per_thing * max(count, 2 * settings.things_per_room) / (columns * rows))
    plan = FloorPlan(_lines(columns, side, rng), _lines(rows, side, rng))
    _draw_doors(plan, rng, settings)
    _build_walls(plan, settings.wall)
    for number, room in enumerate(plan.rooms):
        if rng.random() < settings.counters:
            _build_counter(plan, room, f"counter_{number + 1}", rng, settings)
    return plan


def _lines(count: int, side: float, rng: np.random.Generator) -> np.ndarray:
    """Return where `count` uneven widths that are `side` [m] on average begin and end: (count + 1,)."""
    widths = 1.0 + UNEVEN * rng.uniform(-1.0, 1.0, count)
    return np.concatenate(([0.0], np.cumsum(widths * side * count / widths.sum())))


def _draw_doors(plan: FloorPlan, rng: np.random.Generator, settings: OfficeSettings) -> None:
    """Draw doors: as many as connect all rooms, by Kruskal's algorithm with random costs, and some more."""
    rooms = set(plan.rooms)
    pairs = [(room, other) for room in plan.rooms for other in _beyond(room) if other in rooms]
    group = {room: room for room in plan.rooms}
    for index in rng.permutation(len(pairs)):
        room, other = pairs[index]
        needed = group[room] != group[other]
        if not needed and rng.random() >= settings.extra_doors:
            continue
        plan.doors.append(_door(plan, room, other, rng, settings))
        old, new = group[other], group[room]
        group = {name: new if value == old else value for name, value in group.items()}


def _beyond(room: Room) -> tuple[Room, Room]:
    return (room[0] + 1, room[1]), (room[0], room[1] + 1)


def _door(plan: FloorPlan, room: Room, other: Room, rng: np.random.Generator, settings: OfficeSettings) -> Door:
    """Draw the door in the wall between two rooms."""
    upright = room[1] == other[1]
    low, high = (plan.ys[room[1]], plan.ys[room[1] + 1]) if upright else (plan.xs[room[0]], plan.xs[room[0] + 1])
    most = float(high - low) - 2.0 * CORNER - settings.wall
    width = min(float(rng.choice(settings.doors)), most)
    margin = CORNER + (settings.wall + width) / 2.0
    along = float(rng.uniform(low + margin, high - margin)) if width < most else float(low + high) / 2.0
    across = float(plan.xs[room[0] + 1] if upright else plan.ys[room[1] + 1])
    return Door(across, along, width, upright) if upright else Door(along, across, width, upright)


def _build_walls(plan: FloorPlan, wall: float) -> None:
    """Build the partition walls as rectangles that do not overlap: those along y from end to end, others between."""
    half, pieces = wall / 2.0, []
    for x in plan.xs[1:-1]:
        doors = sorted((door.y, door.width) for door in plan.doors if door.upright and door.x == x)
        for low, high in _between(doors, 0.0, float(plan.ys[-1])):
            pieces.append(box(float(x) - half, low, float(x) + half, high))
    for y in plan.ys[1:-1]:
        for i in range(len(plan.xs) - 1):
            start = float(plan.xs[i]) + (half if i else 0.0)
            end = float(plan.xs[i + 1]) - (half if i + 2 < len(plan.xs) else 0.0)
            doors = sorted(
                (door.x, door.width) for door in plan.doors if not door.upright and door.y == y and start < door.x < end
            )
            for low, high in _between(doors, start, end):
                pieces.append(box(low, float(y) - half, high, float(y) + half))
    plan.fixed.update({f"wall_{number + 1}": piece for number, piece in enumerate(pieces)})


def _between(doors: list[tuple[float, float]], start: float, end: float) -> list[tuple[float, float]]:
    """Return what is left of a wall from start to end [m] beside its doors (middle, width), in order."""
    edges = [start, *(edge for middle, width in doors for edge in (middle - width / 2.0, middle + width / 2.0)), end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _build_counter(plan: FloorPlan, room: Room, name: str, rng: np.random.Generator, settings: OfficeSettings) -> None:
    """Build a desk or a cupboard along a wall of a room, where it is in no door's way; else leave it out."""
    low_x, low_y, high_x, high_y = plan.room(room, settings.wall).bounds
    depth, length = rng.uniform(*settings.counter_depth), rng.uniform(*settings.counter_length)
    side, share = int(rng.integers(4)), rng.random()
    along = (high_x - low_x if side % 2 == 0 else high_y - low_y) - length
    if along <= 0.0:
        return
    start = (low_x if side % 2 == 0 else low_y) + share * along
    counter = {
        0: (start, low_y, start + length, low_y + depth),
        1: (high_x - depth, start, high_x, start + length),
        2: (start, high_y - depth, start + length, high_y),
        3: (low_x, start, low_x + depth, start + length),
    }[side]
    shape = box(*counter)
    if not any(shape.intersects(door.zone(IN_FRONT)) for door in plan.doors):
        plan.fixed[name] = shape
