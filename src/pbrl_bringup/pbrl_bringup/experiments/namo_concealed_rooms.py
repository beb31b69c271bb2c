"""Rooms in which a carpet's edge, a tether or a thing that nobody sees is in the way of what looks best.

A table on free casters and a cupboard close the room, so that the table has to be moved. What a planner who knows
nothing of it would do first is worked out beforehand, and the effect is put where that motion meets it on its way; what
else could be done with the table is left as it is. Only the simulator is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.namo_rooms import DRAWS, GOAL, HEIGHT, MASSES, SIZES, SQUARE, closed, outline_of
from pbrl_control.planar import Array, compose, inverse, rotation
from pbrl_model.parameters import BodyParameters
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.planner import plan
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import NamoSettings
from pbrl_namo.thinking import unlearned

Points = NDArray[np.float64]

CARPET, TETHER, UNSEEN = "carpet edge", "tether", "unseen body"
KINDS = (CARPET, TETHER, UNSEEN)
CUPBOARD = "cupboard"
LENGTH, HALF_WIDTH = (-1.5, 6.0), 2.325
TABLE, CLOSET = (2.6, 0.925), ((2.2, -2.075), (2.95, -2.075), (2.95, -0.475), (2.2, -0.475))
MET = (0.35, 0.55)
"""Share of the first motion after which the effect is met, drawn between the two."""
STEPS = 40
"""In which a motion is followed."""
PILE = 0.02
"""Lever of the rolling resistance of the table's casters on the carpet: a thick pile [m]."""
CARPETS, LONG_CARPET, BESIDE = (1.2, 0.9, 0.6, 0.4), 1.5, 0.02
"""Widths of carpets, the first that fits is taken, their length, and how far from the casters they lie at first [m]."""
INSET = 0.06
CASTERS = outline_of(SQUARE) * (1.0 - 2.0 * INSET / SIZES[SQUARE][0])
"""Where the casters' axes are (4, 2) in the table's frame [m]."""
STRETCH, SLACK = 300.0, 0.6
"""Of the tether [N/m], and about how long it is [m]."""
ROLLING = 0.02
"""Friction coefficient of a table that rolls freely."""
CRATE, LOAD, GRIP = 0.3, 30.0, 0.5
"""Side of the body that nobody sees [m], its mass [kg] and friction."""
CLEAR = 0.15
"""Between that and the cupboard, the robot and the walls before they move [m]."""
PASSAGE = shapely.box(1.2, CLOSET[2][1], 4.5, 0.45)
"""Between table and cupboard: what is concealed is not to close it."""


@dataclass(frozen=True)
class Meeting:
    """What is concealed, and what is then met.

    Attributes:
        concealed: part of the scene.
        pose: (3,) of the table when it meets it, in `world` [m, rad].
        stop: line that it cannot cross.
    """

    concealed: dict[str, Any]
    pose: Array
    stop: Stop


@dataclass(frozen=True)
class Concealing:
    """A room.

    Attributes:
        kind: of `KINDS`.
        scene: for the simulator.
        goal: (3,), of any heading [m, rad].
        seed: of the mission that it was drawn for.
    """

    kind: str
    scene: Scene
    goal: Array
    seed: int

    def outlines(self) -> list[Array]:
        """Return the corners (k, 2) of what is concealed, of a tether its two ends, in `world` [m]."""
        concealed, pose = self.scene.concealed, np.array(self.scene.bodies[SQUARE].pose)
        found = [np.array(tile.polygon) for tile in concealed.floor_patch]
        found += [np.array(body.polygon) + np.array(body.pose[:2]) for body in concealed.unseen_body]
        for cord in concealed.tether.values():
            found.append(np.array([cord.anchor[:2], _at(np.array([cord.point[:2]]), pose)[0]]))
        return found


def draw_concealing(rng: np.random.Generator, kind: str) -> Concealing:
    """Draw a room.

    Args:
        rng: of the draws.
        kind: of what is concealed, one of `KINDS`.

    Raises:
        BringupError: none of the draws has a place for it.
    """
    for _ in range(DRAWS):
        pose = np.array([*(np.array(TABLE) + rng.uniform(-0.05, 0.05, 2)), rng.uniform(-0.06, 0.06)])
        start = np.array([rng.uniform(-0.5, 0.4), rng.uniform(-0.9, 0.9), rng.uniform(-math.pi, math.pi)])
        goal = np.array([GOAL[0] + rng.uniform(-0.3, 0.3), GOAL[1] + rng.uniform(-0.8, 0.8), math.nan])
        seen, seed = seen_room(pose, start, goal), int(rng.integers(2**31))
        if not closed(seen):
            continue
        believed = unlearned(seen.movable[SQUARE], NamoSettings())
        chosen = plan(seen, {SQUARE: believed}, job_seed(seed, 1)).chosen
        if chosen is None or chosen.plan is None:
            continue
        meeting = _meeting(kind, seen, chosen.plan, float(rng.uniform(*MET)))
        if meeting is not None and _another_way(seen, chosen.plan, meeting, seed):
            return Concealing(kind, _told(pose, start, meeting.concealed), goal, seed)
    raise BringupError(f"room: expected one of {DRAWS} draws to have a place for a {kind}, none had")


def track(scene: NamoScene, what: ManipulationPlan) -> Array:
    """Return the poses (n, 3) of a thing that does as planned, evenly in time [m, rad]."""
    pose = np.array(scene.poses[what.object], dtype=float)
    poses = [pose.copy()]
    for motion in what.motions:
        for _ in range(STEPS):
            there = np.empty(3)
            moved(pose, np.asarray(motion.twist, dtype=float), motion.duration / STEPS, there)
            pose = there
            poses.append(pose.copy())
    return np.array(poses)


def _another_way(scene: NamoScene, what: ManipulationPlan, meeting: Meeting, seed: int) -> bool:
    """Tell whether a planner who knows what was met, and that the table rolls freely, finds something else to do."""
    leave = compose(inverse(scene.poses[SQUARE]), what.drive_to)
    there = scene.moved({SQUARE: meeting.pose}, compose(meeting.pose, leave))
    free = BodyParameters(mass=MASSES[SQUARE], mu_ground=ROLLING).to_vector()[None]
    made = plan(there, {SQUARE: ObjectBelief(outline_of(SQUARE), free, (meeting.stop,))}, job_seed(seed, 2))
    return made.chosen is not None and made.chosen.plan is not None


def _stop(pose: Array, point: Array, ahead: Array) -> Stop:
    """Return the line through a point (2,) in `world` that the table does not cross with it, square to its way."""
    own = rotation(float(pose[2])).T @ (point - pose[:2])
    return Stop(own, ahead, float(point @ ahead))


def _meeting(kind: str, scene: NamoScene, what: ManipulationPlan, share: float) -> Meeting | None:
    """Return what to conceal so that it is met after a share of a motion; None: there is no place for it."""
    poses = track(scene, what)
    met = max(1, round(share * (len(poses) - 1)))
    if kind == CARPET:
        return _carpet(poses, met)
    if kind == TETHER:
        return _tether(scene, poses, met)
    if kind == UNSEEN:
        return _crate(scene, what, poses, met)
    raise BringupError(f"room: expected one of {', '.join(KINDS)}, got {kind!r}")


def _at(points: Points, pose: Array) -> Points:
    return np.asarray(points @ rotation(float(pose[2])).T + pose[:2])


def _corners(pose: Array) -> Points:
    return _at(outline_of(SQUARE), pose)


def _carpet(poses: Array, met: int) -> Meeting | None:
    """Return a carpet whose edge the foremost caster meets, square to the way it then goes."""
    before, there = _at(CASTERS, poses[met - 1]), _at(CASTERS, poses[met])
    step = there - before
    first = int(np.argmax(np.hypot(*step.T)))
    ahead = step[first] / np.hypot(*step[first])
    aside, edge = np.array([-ahead[1], ahead[0]]), there[first]
    for width in CARPETS:
        a, b, far = edge + 0.5 * width * aside, edge - 0.5 * width * aside, LONG_CARPET * ahead
        tile = [a, b, b + far, a + far]
        if not shapely.intersects_xy(shapely.Polygon(tile).buffer(BESIDE), *_at(CASTERS, poses[0]).T).any():
            break
    else:
        return None  # the table would stand on it from the start
    concealed = {"floor_patch": [{"polygon": np.array(tile).tolist(), "rolling_resistance": PILE}]}
    return Meeting(concealed, poses[met], _stop(poses[met], edge, ahead))


def _tether(scene: NamoScene, poses: Array, met: int) -> Meeting | None:
    """Return a cord to the corner that goes furthest, from behind it, taut after a share of that."""
    begun, ended = _corners(poses[0]), _corners(poses[-1])
    first = int(np.argmax(np.hypot(*(ended - begun).T)))
    ahead = (ended - begun)[first] / np.hypot(*(ended - begun)[first])
    anchor = begun[first] - SLACK * ahead
    there = _corners(poses[met])[first]
    room = scene.room.buffer(0.05)
    if not shapely.intersects_xy(room, *anchor):
        return None
    point = outline_of(SQUARE)[first] * 0.98
    length = float(np.hypot(*(there - anchor)))
    cord = {
        "anchor": [*anchor.tolist(), HEIGHT - 0.05],
        "point": [*point.tolist(), -0.05],
        "slack_length": length,
        "stiffness": STRETCH,
    }
    away = (there - anchor) / length
    return Meeting({"tether": {SQUARE: cord}}, poses[met], _stop(poses[met], there, away))


def _crate(scene: NamoScene, what: ManipulationPlan, poses: Array, met: int) -> Meeting | None:
    """Return a crate that the fastest side of the table meets, clear of all else."""
    swept = shapely.union_all([shapely.Polygon(_corners(pose)) for pose in poses[:met]])
    stand = compose(inverse(poses[0]), what.stand)
    robot = shapely.union_all([shapely.Polygon(scene.robot.at(compose(pose, stand))) for pose in poses[::4]])
    kept = shapely.union_all([PASSAGE, *scene.fixed.values(), robot, shapely.Polygon(scene.robot.at(what.drive_to))])
    before, there = shapely.Polygon(_corners(poses[met - 1])), shapely.Polygon(_corners(poses[met]))
    best, score, stop = None, 0.0, None
    ring = there.exterior
    for share in np.linspace(0.0, 1.0, 40, endpoint=False):
        point = shapely.get_coordinates(ring.interpolate(share, normalized=True))[0]
        on, ahead = _velocity(poses[met - 1], poses[met], point)
        if on < 1e-6:
            continue
        middle = point + 0.5 * CRATE * ahead
        box = shapely.Polygon(_box(middle, ahead))
        depth = before.distance(box)
        far = swept.distance(box) >= 0.0 and not swept.buffer(-0.005).intersects(box)
        free = scene.room.buffer(-CLEAR).covers(box) and kept.distance(box) > CLEAR
        if far and free and on > score and depth < 0.1:
            best, score, stop = box, on, _stop(poses[met], point, ahead)
    if best is None or stop is None:
        return None
    corners = np.asarray(shapely.orient_polygons(best).exterior.coords)[:-1]
    return Meeting({"unseen_body": [_block(corners)]}, poses[met], stop)


def _velocity(before: Array, after: Array, point: Array) -> tuple[float, Array]:
    """Return how far a point of the table goes between two poses [m], and the direction (2,)."""
    own = rotation(float(after[2])).T @ (point - after[:2])
    step = point - (rotation(float(before[2])) @ own + before[:2])
    size = float(np.hypot(*step))
    return size, step / max(size, 1e-12)


def _box(middle: Array, ahead: Array) -> Points:
    aside = np.array([-ahead[1], ahead[0]])
    half = 0.5 * CRATE
    return np.array(
        [middle + half * (a * ahead + b * aside) for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))]
    )


def _block(corners: Points) -> dict[str, Any]:
    middle = corners.mean(axis=0)
    return {
        "kind": "block",
        "polygon": (corners - middle).tolist(),
        "height": 1.0,
        "nominal_mass": LOAD,
        "friction": GRIP,
        "pose": [*middle.tolist(), 0.0],
    }


def seen_room(pose: Array, start: Array, goal: Array) -> NamoScene:
    """Return what can be seen of a room: table's pose (3,), base's start (3,) and goal (3,) in `world` [m, rad]."""
    movable = {SQUARE: Movable(outline_of(SQUARE), HEIGHT, MASSES[SQUARE])}
    return NamoScene.of(_room(), {CUPBOARD: np.array(CLOSET)}, movable, {SQUARE: pose}, start, goal)


def _room() -> Points:
    (low, high), y = LENGTH, HALF_WIDTH
    return np.array([[low, -y], [high, -y], [high, y], [low, y]])


def _told(pose: Array, start: Array, concealed: dict[str, Any]) -> Scene:
    bodies = {
        SQUARE: {
            "kind": "office_table",
            "size": list(SIZES[SQUARE]),
            "height": HEIGHT,
            "nominal_mass": MASSES[SQUARE],
            "pose": pose.tolist(),
        },
        CUPBOARD: {"kind": "fixture", "polygon": [list(corner) for corner in CLOSET], "height": 1.0},
    }
    told = {
        "name": "namo-concealed",
        "room": {"outline": _room().tolist()},
        "robot": {"pose": start.tolist()},
        "bodies": bodies,
        "concealed": concealed,
    }
    return parse_settings(told, Scene, "a room that conceals something")
