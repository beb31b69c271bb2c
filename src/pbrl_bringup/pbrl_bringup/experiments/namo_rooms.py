"""The thesis's room (figures 43, 44): two tables on casters stand between the robot and its goal, drawn from a seed.

Some casters are locked, which only the simulator is told. Where everything stands and which casters they are is drawn;
in every room neither table leaves a gap that the robot fits through.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_bringup.errors import BringupError
from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_namo.regions.free_space import drive_radius, free_space
from pbrl_namo.scene import Movable, NamoScene

Array = NDArray[np.float64]

SQUARE, LONG = "square_table", "long_table"
SIZES = {SQUARE: (1.0, 1.0), LONG: (0.75, 1.6)}
MASSES = {SQUARE: 33.0, LONG: 38.0}
"""As in thesis 6.5 [kg]."""
HEIGHT = 0.7775
LENGTH = (-1.5, 6.0)
GOAL = (5.0, 0.0)
CASTERS = ("front_left", "front_right", "rear_left", "rear_right")
ANY_TWO = tuple(itertools.combinations(CASTERS, 2))
ONE_NEAR = (("rear_left",), ("rear_right",))
"""On the robot's side. About a far one Krang, whose base does not go sideways, cannot turn the table far enough in one
grasp: of those rooms none is solved."""
DRAWS = 200
"""Of a room, until one is closed by its tables."""


@dataclass(frozen=True)
class Layout:
    """Where things are, but for what is drawn.

    Attributes:
        half_width: of the room [m].
        places: (x, y) of each table [m].
        locked: by table, the sets of casters of which one is drawn and locked.
    """

    half_width: float
    places: Mapping[str, tuple[float, float]]
    locked: Mapping[str, Sequence[tuple[str, ...]]]

    @property
    def room(self) -> Array:
        """Return the floor's corners (4, 2) [m]."""
        (low, high), y = LENGTH, self.half_width
        return np.array([[low, -y], [high, -y], [high, y], [low, y]])


STUCK = Layout(2.325, {SQUARE: (2.6, 0.925), LONG: (2.6, -1.275)}, {SQUARE: ANY_TWO})
"""Of 6.5.1: to move the square table seems best, and it is stuck."""
TURNED = Layout(2.4, {SQUARE: (2.6, 1.5), LONG: (2.6, -0.7)}, {SQUARE: ANY_TWO, LONG: ONE_NEAR})
"""Of 6.5.2: the square table is stuck, the long one has room to turn about a locked caster."""


def draw_room(rng: np.random.Generator, layout: Layout) -> tuple[Scene, Array]:
    """Draw a room.

    Args:
        rng: of the draws.
        layout: of the room.

    Returns:
        The simulator's scene, and the goal (3,), of any heading [m, rad].

    Raises:
        BringupError: none of the draws is closed.
    """
    for _ in range(DRAWS):
        poses = {
            name: np.array([*(np.array(place) + rng.uniform(-0.05, 0.05, 2)), rng.uniform(-0.06, 0.06)])
            for name, place in layout.places.items()
        }
        start = np.array([rng.uniform(-0.5, 0.4), rng.uniform(-0.9, 0.9), rng.uniform(-math.pi, math.pi)])
        goal = np.array([GOAL[0] + rng.uniform(-0.3, 0.3), GOAL[1] + rng.uniform(-0.8, 0.8), math.nan])
        if _closed(layout, poses, start, goal):
            break
    else:
        raise BringupError(f"room: expected one of {DRAWS} draws to be closed by its tables, none was")
    concealed = {name: list(sets[int(rng.integers(len(sets)))]) for name, sets in layout.locked.items()}
    bodies: dict[str, Any] = {
        name: {
            "kind": "office_table",
            "size": list(size),
            "height": HEIGHT,
            "nominal_mass": MASSES[name],
            "pose": poses[name].tolist(),
        }
        for name, size in SIZES.items()
    }
    told = {
        "name": "namo",
        "room": {"outline": layout.room.tolist()},
        "robot": {"pose": start.tolist()},
        "bodies": bodies,
        "concealed": {"locked_casters": concealed},
    }
    return parse_settings(told, Scene, "the thesis's room"), goal


def outline_of(name: str) -> Array:
    """Return a table's outline (4, 2) in its own frame [m]."""
    x, y = SIZES[name]
    return 0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def _closed(layout: Layout, poses: dict[str, Array], start: Array, goal: Array) -> bool:
    """Tell whether start and goal are in different regions, and the robot stands free."""
    movable = {name: Movable(outline_of(name), HEIGHT, MASSES[name]) for name in SIZES}
    scene = NamoScene.of(layout.room, {}, movable, poses, start, goal)
    free = free_space(scene, drive_radius(KRANG_STOWED))
    here, there = free.index(start), free.index(goal)
    return here is not None and there is not None and here != there
