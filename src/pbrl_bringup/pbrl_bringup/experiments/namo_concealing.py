"""A carpet, a tether or a thing that nobody sees, put where a given motion of a table meets it on its way.

They are there for good: what was met is met again by any motion that goes the same way, however hard it is pushed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.namo_rooms import HEIGHT, SIZES, SQUARE, outline_of
from pbrl_control.planar import Array, compose, inverse, placed, rotation
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.scene import NamoScene

CARPET, TETHER, UNSEEN = "carpet edge", "tether", "unseen body"
KINDS = (CARPET, TETHER, UNSEEN)
STEPS = 40
"""In which a motion is followed."""
AGAIN = 0.03
"""How far past a line a motion has to go to be stopped there for certain [m]."""
PILE = 0.03
"""Lever of the rolling resistance of the table's casters on the carpet: a thick pile, four fifths of the load [m]."""
FAR = 10.0
"""How far the carpet goes on beyond its edge, and to both sides: over all the floor that is there [m]."""
EDGES = 72
"""Directions of edges that are tried."""
BESIDE = 0.02
"""How far from its edge the casters stand at first [m]."""
INSET = 0.06
CASTERS = outline_of(SQUARE) * (1.0 - 2.0 * INSET / SIZES[SQUARE][0])
"""Where the casters' axes are (4, 2) in the table's frame [m]."""
STRETCH, SLACK = 3000.0, 0.6
"""Of the tether, a cable [N/m], and how far behind the table's middle it is hooked [m]."""
LEAST_WAY = 0.2
"""That the middle goes, so that a cable can end it [m]."""
LENGTHS, DEPTH = (1.2, 0.9, 0.6), 0.3
"""Of the body that nobody sees, the first length that fits is taken [m]."""
LOAD, GRIP = 200.0, 0.6
"""Mass of that, a pallet of tiles [kg], and friction."""
CLEAR = 0.15
"""Between that and the cupboard, the robot and the walls before they move [m]."""


@dataclass(frozen=True)
class Meeting:
    """What is concealed, and what is then met.

    Attributes:
        concealed: part of the scene.
        pose: (3,) of the table when it meets it, in `world` [m, rad].
        stops: lines that it cannot cross.
        solid: the body that nobody sees, in `world`; None: it is none.
    """

    concealed: dict[str, Any]
    pose: Array
    stops: tuple[Stop, ...]
    solid: shapely.Polygon | None = None

    def stopping(self, scene: NamoScene, what: ManipulationPlan) -> bool:
        """Tell whether it stops a thing that is moved as planned."""
        poses = track(scene, what)
        for stop in self.stops:
            past = stop.beyond(poses)
            if float(past.max()) > max(float(past[0]), 0.0) + AGAIN:
                return True
        return self.solid is not None and any(self.solid.intersects(scene.movable[what.object].at(p)) for p in poses)


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


def conceal(kind: str, scene: NamoScene, what: ManipulationPlan, share: float, kept: shapely.Polygon) -> Meeting | None:
    """Return what to conceal so that it is met on the way.

    Args:
        kind: of `KINDS`.
        scene: what is seen of the room.
        what: is done with the table.
        share: of that motion after which it is met.
        kept: floor on which nothing is put.

    Returns:
        What is met; None: there is no place for it.

    Raises:
        BringupError: the kind is none.
    """
    poses = track(scene, what)
    met = max(1, round(share * (len(poses) - 1)))
    if kind == CARPET:
        return _carpet(poses, met)
    if kind == TETHER:
        return _tether(scene, poses, met)
    if kind == UNSEEN:
        return _pallet(scene, what, poses, met, kept)
    raise BringupError(f"room: expected one of {', '.join(KINDS)}, got {kind!r}")


def _carpet(poses: Array, met: int) -> Meeting | None:
    """Return a carpet that the casters come to then and no sooner, the one that the motion would go furthest onto."""
    casters = np.array([placed(CASTERS, pose) for pose in poses])
    best, score = None, 0.0
    for angle in np.linspace(-math.pi, math.pi, EDGES, endpoint=False):
        ahead = np.array([math.cos(angle), math.sin(angle)])
        foremost = (casters @ ahead).max(axis=1)
        level, on = float(foremost[met]), float(foremost.max() - foremost[met])
        if on > score and level > foremost[:met].max() and level > foremost[0] + BESIDE:
            best, score = (ahead, level), on
    if best is None:
        return None
    ahead, level = best
    edge, aside = level * ahead, FAR * np.array([-ahead[1], ahead[0]])
    tile = [edge + aside, edge - aside, edge - aside + FAR * ahead, edge + aside + FAR * ahead]
    concealed = {"floor_patch": [{"polygon": np.array(tile).tolist(), "rolling_resistance": PILE}]}
    return Meeting(concealed, poses[met], tuple(Stop(caster, ahead, level) for caster in CASTERS))


def _tether(scene: NamoScene, poses: Array, met: int) -> Meeting | None:
    """Return a cable to the table's middle, from behind it, taut after a share of the way that goes."""
    begun, there = poses[0, :2], poses[met, :2]
    gone = float(np.hypot(*(poses[-1, :2] - begun)))
    if gone < LEAST_WAY:
        return None
    ahead = (poses[-1, :2] - begun) / gone
    anchor = begun - SLACK * ahead
    length = float(np.hypot(*(there - anchor)))
    if not shapely.intersects_xy(scene.room.buffer(0.05), *anchor) or length < SLACK:
        return None
    cord = {
        "anchor": [*anchor.tolist(), HEIGHT - 0.05],
        "point": [0.0, 0.0, -0.05],
        "slack_length": length,
        "stiffness": STRETCH,
    }
    away = (there - anchor) / length
    return Meeting({"tether": {SQUARE: cord}}, poses[met], (Stop(np.zeros(2), away, float(there @ away)),))


def _pallet(
    scene: NamoScene, what: ManipulationPlan, poses: Array, met: int, passage: shapely.Polygon
) -> Meeting | None:
    """Return a pallet that the fastest side of the table meets, clear of all else, the longest that fits."""
    swept = shapely.union_all([shapely.Polygon(_corners(pose)) for pose in poses[:met]])
    stand = compose(inverse(poses[0]), what.stand)
    robot = shapely.union_all([shapely.Polygon(scene.robot.at(compose(pose, stand))) for pose in poses[::4]])
    kept = shapely.union_all([passage, *scene.fixed.values(), robot, shapely.Polygon(scene.robot.at(what.drive_to))])
    before, there = shapely.Polygon(_corners(poses[met - 1])), shapely.Polygon(_corners(poses[met]))
    inside, clean = scene.room.buffer(-CLEAR), swept.buffer(-0.005)
    for length in LENGTHS:
        best, score = None, 0.0
        for share in np.linspace(0.0, 1.0, 40, endpoint=False):
            point = shapely.get_coordinates(there.exterior.interpolate(share, normalized=True))[0]
            on, ahead = _velocity(poses[met - 1], poses[met], point)
            if on < 1e-6:
                continue
            block = _block(point + 0.5 * DEPTH * ahead, ahead, length)
            fits = inside.covers(block) and kept.distance(block) > CLEAR and not clean.intersects(block)
            if fits and on > score and before.distance(block) < 0.1:
                best, score = block, on
        if best is not None:
            return Meeting({"unseen_body": [_told(best)]}, poses[met], (), best)
    return None


def _corners(pose: Array) -> Array:
    return placed(outline_of(SQUARE), pose)


def _velocity(before: Array, after: Array, point: Array) -> tuple[float, Array]:
    """Return how far a point of the table goes between two poses [m], and the direction (2,)."""
    own = rotation(float(after[2])).T @ (point - after[:2])
    step = point - (rotation(float(before[2])) @ own + before[:2])
    size = float(np.hypot(*step))
    return size, step / max(size, 1e-12)


def _block(middle: Array, ahead: Array, length: float) -> shapely.Polygon:
    across = np.array([[0.5 * DEPTH, 0.5 * length], [-0.5 * DEPTH, 0.5 * length]])
    corners = np.concatenate((across, -across))
    return shapely.Polygon(placed(corners, np.array([*middle, math.atan2(ahead[1], ahead[0])])))


def _told(block: shapely.Polygon) -> dict[str, Any]:
    corners = np.asarray(shapely.orient_polygons(block).exterior.coords)[:-1]
    middle = corners.mean(axis=0)
    return {
        "kind": "block",
        "polygon": (corners - middle).tolist(),
        "height": 1.0,
        "nominal_mass": LOAD,
        "friction": GRIP,
        "pose": [*middle.tolist(), 0.0],
    }
