"""Makes an office: floor plan, map, furniture that is not in the map, people's ways, goals; and writes it as files.

ros2 run pr2_cart_sim make_office office.yaml --seed 3 --rooms 5 --people 8
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator
from numpy.typing import NDArray
from shapely.geometry import LineString, Point, Polygon, box
from shapely.ops import unary_union

from bullet_sim.errors import SimError
from bullet_sim.settings import parse_settings
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.floor_plan import FloorPlan, OfficePlan, RoomPlan, draw_map, draw_plan
from pr2_cart_sim.maps import GridMap, save_map
from pr2_cart_sim.postures import DEFAULT_POSTURE

Array = NDArray[np.float64]

CART = {"kind": "utility_cart", "size": [1.0, 0.55], "height": 0.90, "nominal_mass": 25.0, "upper_shelf": False}
AHEAD = 0.65 + 0.484
"""From `base` to the middle of a cart whose bar is between the fingers [m]."""
TORSO = 0.244
"""Height of the torso's lift [m] at which the fingers are level with the cart's bar."""
PIECES = {"desk": (1.4, 0.7, 0.74), "cabinet": (0.8, 0.45, 1.2), "table": (1.0, 0.8, 0.74), "shelf": (1.2, 0.35, 1.8)}
"""Length, depth, height [m]; the length lies along a wall."""
SLAB = 0.04
"""Thickness of a top that is fixed to the wall [m]."""
HUNG = ("desk", "table")
"""Pieces that may be."""
CHAIR = {"kind": "block", "height": 0.48, "nominal_mass": 9.0, "friction": 0.25}
TRIES = 40
WAY = 0.75
"""Half the width of the way from a door to a room's goal that is kept free [m]."""
TURN = 1.25
"""Radius around a goal that is kept free, to turn in [m]."""


def make_office(plan: OfficePlan, seed: int) -> tuple[GridMap, dict[str, Any]]:
    """Make an office.

    Args:
        plan: what it is like.
        seed: of every draw.

    Returns:
        The map, and the scene as plain data for `config/offices/*.yaml`, without the name of the map's file.
    """
    rng = np.random.default_rng(seed)
    floor = draw_plan(plan, rng)
    grid = draw_map(floor, plan)
    start = [1.0, (floor.corridor[1] + floor.corridor[3]) / 2, 0.0]
    goals = {room.name: _goal(room) for room in floor.rooms}
    goals["corridor_end"] = [floor.corridor[2] - 2.4, start[1], 0.0]
    scene = {
        "room": {"outline": _rounded(grid.outline)},
        "robot": {"pose": _rounded(start), "torso": TORSO, "posture": DEFAULT_POSTURE, "holds": "cart"},
        "bodies": {"cart": CART | {"pose": _rounded([start[0] + AHEAD, *start[1:]])}},
        "goals": {name: _rounded(pose) for name, pose in goals.items()},
        "clutter": _hang(plan.hung, _furnish(plan, floor, rng), seed),
        "people": _people(plan, floor, rng),
    }
    return grid, scene


def write_office(path: Path, plan: OfficePlan, seed: int) -> None:
    """Write an office as a scene file, and its map in `maps/` beside it.

    Raises:
        SimError: the seed is below zero, or a file cannot be written.
    """
    if seed < 0:
        raise Pr2Error(f"seed: expected a number from zero on, got {seed}")
    grid, scene = make_office(plan, seed)
    maps = path.parent / "maps"
    try:
        maps.mkdir(parents=True, exist_ok=True)
        save_map(grid, maps / f"{path.stem}.yaml")
        head = f"# Made by make_office with seed {seed}: {len(scene['goals'])} goals, {len(scene['people'])} people.\n"
        whole = {"map": f"maps/{path.stem}.yaml", **scene}
        text = yaml.safe_dump(whole, sort_keys=False, default_flow_style=None, width=120)
        path.write_text(head + text, encoding="utf-8")
    except OSError as error:
        raise Pr2Error(f"{path}: expected to write an office there, got {type(error).__name__}") from error


def _goal(room: RoomPlan) -> list[float]:
    """Give the pose in the middle of a room that one comes to straight ahead from the door."""
    inside, outside = room.doorway
    along = inside - outside
    heading = float(np.arctan2(along[1], along[0]))
    return [*(room.centre - 0.5 * along / np.hypot(*along)), heading]


def _kept_free(floor: FloorPlan) -> Polygon:
    """Give what furniture may not stand on."""
    ways = []
    for room in floor.rooms:
        inside, outside = room.doorway
        ways.append(LineString([outside, inside, room.centre]).buffer(WAY))
        ways.append(Point(room.centre).buffer(TURN))
    return unary_union(ways)


def _furnish(plan: OfficePlan, floor: FloorPlan, rng: Generator) -> dict[str, Any]:
    """Put furniture along the rooms' walls, chairs into rooms, things into the corridor."""
    taken, clutter = _kept_free(floor), {}
    names = list(PIECES)

    def place(name: str, shape: Polygon, body: dict[str, Any], floor_area: Polygon) -> bool:
        nonlocal taken
        if not floor_area.contains(shape) or shape.intersects(taken):
            return False
        taken = unary_union([taken, shape.buffer(0.05)])
        clutter[name] = body
        return True

    for room in floor.rooms:
        wanted = int(rng.integers(plan.furniture[0], plan.furniture[1] + 1))
        for number in range(wanted):
            kind = names[int(rng.integers(len(names)))]
            for _ in range(TRIES):
                shape, body = _at_wall(room.floor, PIECES[kind], rng)
                if place(f"{room.name}_{kind}_{number + 1}", shape, body, box(*room.floor)):
                    break
    for number in range(plan.movable):
        room = floor.rooms[int(rng.integers(len(floor.rooms)))]
        for _ in range(TRIES):
            left, bottom, right, top = room.floor
            pose = [rng.uniform(left, right), rng.uniform(bottom, top), 0.0]
            shape = box(pose[0] - 0.22, pose[1] - 0.22, pose[0] + 0.22, pose[1] + 0.22)
            square = [[-0.22, -0.22], [0.22, -0.22], [0.22, 0.22], [-0.22, 0.22]]
            body = CHAIR | {"polygon": square, "pose": _rounded(pose)}
            if place(f"chair_{number + 1}", shape, body, box(*room.floor)):
                break
    for number in range(plan.corridor_things):
        for _ in range(TRIES):
            shape, body = _in_corridor(floor, rng)
            if place(f"corridor_thing_{number + 1}", shape, body, box(*floor.corridor)):
                break
    return clutter


def _hang(share: float, clutter: dict[str, Any], seed: int) -> dict[str, Any]:
    """Fix a share of desks and tables to the wall instead; all else stays as it was drawn."""
    rng = np.random.default_rng([seed, 1])
    for name, body in clutter.items():
        if any(f"_{kind}_" in name for kind in HUNG) and rng.random() < share:
            body["underside"] = round(body["height"] - SLAB, 3)
    return clutter


def _at_wall(floor: tuple[float, float, float, float], size: tuple[float, float, float], rng: Generator) -> Any:
    """Draw a place for a piece with its back to one of a room's walls."""
    left, bottom, right, top = floor
    length, depth, height = size
    turned = bool(rng.integers(2))
    wide, high = (depth, length) if turned else (length, depth)
    x, y = rng.uniform(left, max(left, right - wide)), rng.uniform(bottom, max(bottom, top - high))
    if turned:
        x = [left + 0.02, right - wide - 0.02][int(rng.integers(2))]
    else:
        y = [bottom + 0.02, top - high - 0.02][int(rng.integers(2))]
    return _prism(x, y, wide, high, height)


def _in_corridor(floor: FloorPlan, rng: Generator) -> Any:
    """Draw a place for a thing at a wall of the corridor, not where the robot starts."""
    left, bottom, right, top = floor.corridor
    size = rng.uniform(0.3, 0.45)
    x = rng.uniform(left + 4.0, right - size)
    y = [bottom + 0.02, top - size - 0.02][int(rng.integers(2))]
    return _prism(x, y, size, size, rng.uniform(0.5, 1.1))


def _prism(x: float, y: float, wide: float, high: float, height: float) -> tuple[Polygon, dict[str, Any]]:
    corners = [[0.0, 0.0], [wide, 0.0], [wide, high], [0.0, high]]
    body = {"kind": "fixture", "polygon": _rounded(corners), "height": round(height, 3), "pose": _rounded([x, y, 0.0])}
    return box(x, y, x + wide, y + high), body


def _people(plan: OfficePlan, floor: FloorPlan, rng: Generator) -> dict[str, Any]:
    """Draw ways from one room to another, or along the corridor."""
    middle = (floor.corridor[1] + floor.corridor[3]) / 2
    people = {}
    off_corridor = [room for room in floor.rooms if not room.name.startswith("far")]
    for number in range(plan.people):
        one, other = (off_corridor[int(k)] for k in rng.choice(len(off_corridor), 2, replace=False))
        lane = middle + rng.uniform(-0.35, 0.35)
        route = []
        for room, way in ((one, 1), (other, -1)):
            inside, outside = room.doorway
            part = [room.centre, inside, np.array([outside[0], lane])]
            route += part[::way]
        people[f"person_{number + 1}"] = {"route": _rounded(route), "speed": round(rng.uniform(*plan.people_speed), 2)}
    return people


def _rounded(values: Any) -> Any:
    return np.round(np.array(values, dtype=float), 3).tolist()


def main() -> None:
    """Run the command; errors are one line and exit code 2."""
    parser = argparse.ArgumentParser(prog="make_office", description="Make an office for the PR2's simulator.")
    parser.add_argument("path", type=Path, help="scene file to write; its map goes into maps/ beside it")
    parser.add_argument("--seed", type=int, default=0, help="of every draw")
    for name, text in {"rooms": "north of the corridor", "people": "that walk about", "movable": "chairs"}.items():
        parser.add_argument(f"--{name}", type=int, help=f"how many {text}")
    parser.add_argument("--hung", type=float, help="share of desks and tables that are fixed to the wall, 0 to 1")
    given = {name: value for name, value in vars(parser.parse_args()).items() if value is not None}
    path, seed = given.pop("path"), given.pop("seed")
    try:
        write_office(path, parse_settings(given, OfficePlan, "make_office"), seed)
    except SimError as error:
        print(f"make_office: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
