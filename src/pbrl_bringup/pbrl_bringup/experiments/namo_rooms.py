"""The thesis's room (figures 43, 44): two tables on casters stand between the robot and its goal, drawn from a seed.

Some casters are locked, which only the simulator is told. Where everything stands and which casters they are is drawn;
in every room neither table leaves a gap that the robot fits through. In the thesis's rooms the robot is surprised as
often as the story goes. Where a layout says so, a room is one in which that happens to a planner in a kinematic world
(`namo_kinematic`), which then, told the truth, finds a way: no more is asked of the rooms that are drawn.
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
from pbrl_bringup.benches.namo_kinematic import REACHED, find_way, true_models
from pbrl_bringup.errors import BringupError
from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.regions.free_space import drive_radius, free_space
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import LastResortSettings, NamoSettings
from pbrl_namo.thinking import unlearned

Array = NDArray[np.float64]

SQUARE, LONG = "square_table", "long_table"
SIZES = {SQUARE: (1.0, 1.0), LONG: (0.75, 1.6)}
MASSES = {SQUARE: 33.0, LONG: 38.0}
"""As in thesis 6.5 [kg]."""
HEIGHT = 0.7775
LENGTH = (-1.5, 6.0)
GOAL = (5.0, 0.0)
CASTERS = ("front_left", "front_right", "rear_left", "rear_right")
HELD = (*itertools.combinations(CASTERS, 3), CASTERS)
"""What makes a table static. Two are not enough: about the two on its side the robot turns the table with 40 N."""
ONE_NEAR = (("rear_left",), ("rear_right",))
"""On the robot's side. About a far one Krang, whose base does not go sideways, cannot turn the table far enough in one
grasp: of those rooms none is solved."""
DRAWS = 200
"""Of a room, until one is closed by its tables."""
JOBS = 3
"""Of a mission for each manipulation that surprises: a plan, a grasp, what is learned."""


@dataclass(frozen=True)
class Layout:
    """Where things are, but for what is drawn.

    Attributes:
        half_width: of the room [m].
        places: (x, y) of each table [m].
        locked: by table, the sets of casters of which one is drawn and locked.
        surprises: whether who plans without knowing of them meets the constraints of all those tables.
    """

    half_width: float
    places: Mapping[str, tuple[float, float]]
    locked: Mapping[str, Sequence[tuple[str, ...]]]
    surprises: bool = False

    @property
    def room(self) -> Array:
        """Return the floor's corners (4, 2) [m]."""
        (low, high), y = LENGTH, self.half_width
        return np.array([[low, -y], [high, -y], [high, y], [low, y]])


STUCK = Layout(2.325, {SQUARE: (2.6, 0.925), LONG: (2.6, -1.275)}, {SQUARE: HELD})
"""Of 6.5.1: to move the square table seems best, and it is stuck."""
TURNED = Layout(2.45, {SQUARE: (2.6, 1.05), LONG: (2.6, -1.15)}, {SQUARE: HELD, LONG: ONE_NEAR}, surprises=True)
"""Of 6.5.2: the square table is stuck, the long one has room to turn about a locked caster."""


def draw_room(rng: np.random.Generator, layout: Layout) -> tuple[Scene, Array, int]:
    """Draw a room.

    Args:
        rng: of the draws.
        layout: of the room.

    Returns:
        The simulator's scene, the goal (3,), of any heading [m, rad], and the seed of the mission it was drawn for.

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
        scene = seen(layout, poses, start, goal)
        if not closed(scene):
            continue
        concealed = {name: list(sets[int(rng.integers(len(sets)))]) for name, sets in layout.locked.items()}
        seed = int(rng.integers(2**31))
        if not layout.surprises or _surprising(scene, concealed, seed):
            break
    else:
        raise BringupError(f"room: expected one of {DRAWS} draws to be closed by its tables, none was")
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
    return parse_settings(told, Scene, "the thesis's room"), goal, seed


def outline_of(name: str) -> Array:
    """Return a table's outline (4, 2) in its own frame [m]."""
    x, y = SIZES[name]
    return 0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def seen(layout: Layout, poses: dict[str, Array], start: Array, goal: Array) -> NamoScene:
    """Return what can be seen of a room.

    Args:
        layout: of it.
        poses: (3,) of each table in `world` [m, rad].
        start: (3,) of the base.
        goal: (3,) of it; a heading of NaN: any.
    """
    movable = {name: Movable(outline_of(name), HEIGHT, MASSES[name]) for name in SIZES}
    return NamoScene.of(layout.room, {}, movable, poses, start, goal)


def closed(scene: NamoScene) -> bool:
    """Tell whether start and goal are in different regions, and the robot stands free."""
    free = free_space(scene, drive_radius(KRANG_STOWED))
    here, there = free.index(scene.start), free.index(scene.goal)
    return here is not None and there is not None and here != there


def _surprising(scene: NamoScene, locked: Mapping[str, Sequence[str]], seed: int) -> bool:
    """Tell whether each table with locked casters refuses once in a kinematic world, and then a way is found.

    Planned is as the mission of that seed plans, from what it believes at first: who plans for worlds among which there
    are locked casters may choose, by chance, a motion that the truly locked one allows, and is not surprised.
    """
    hidden = {name: {"mass": MASSES[name], "locked_casters": locked.get(name, ())} for name in scene.movable}
    settings = NamoSettings(last_resort=LastResortSettings(margins=()))  # most draws fail, and are to fail soon
    believed = {name: unlearned(thing, settings) for name, thing in scene.movable.items()}

    def seeds(moves: int) -> int:
        return job_seed(seed, 1 + JOBS * moves)

    run = find_way(scene, true_models(scene, hidden), seed, settings, believed, seeds)
    return run.end == REACHED and sorted(run.refused) == sorted(locked)
