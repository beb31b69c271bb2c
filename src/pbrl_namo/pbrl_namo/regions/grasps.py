"""Grasp samples: where the robot's base would stand to take hold of a movable thing (thesis 6.2.1, figure 39).

Points are drawn on every face and projected off it by as much as the arms reach, with one gripper or both, by the
geometry of `pbrl_control.grasping`; what is kept are stands where the robot and its lowered arms are free. All faces of
all things are done at once: the search of `pbrl_control.grasping.candidates`, one thing at a time and with a path to
each grasp, costs a second for eighty things and is for the one that is chosen in the end.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.grasping.candidates import EVERY_HAND
from pbrl_control.grasping.contacts import FacePoint, Hands, Reach, place_plates
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.navigation.footprint import Footprint, reaching_arms
from pbrl_control.planar import Array, compose
from pbrl_namo.regions.settings import RegionSettings
from pbrl_namo.scene import Movable, NamoScene

STRAIGHT = 1e-6
"""Distance [m] of a corner from the line between its neighbours below which two edges are one face."""


@dataclass(frozen=True)
class Stands:
    """Grasps of movable things that are free where the base would stand.

    Attributes:
        objects: names of the movable things.
        thing: (n,) index into `objects`.
        hands: (n,) index into `EVERY_HAND`: who grasps.
        contacts: (n, 2) on the outline, in the thing's frame: middle between the plates, or of the one pair [m].
        normals: (n,) of the outward normal there, in the thing's frame [rad].
        poses: (n, 3) of the base in `world` when it has arrived, grippers before the edge [m, rad].
    """

    objects: tuple[str, ...]
    thing: NDArray[np.int64]
    hands: NDArray[np.int64]
    contacts: Array
    normals: Array
    poses: Array

    def take(self, kept: NDArray[np.int64] | NDArray[np.bool_]) -> Stands:
        """Return some of them."""
        rows = (self.thing[kept], self.hands[kept], self.contacts[kept], self.normals[kept], self.poses[kept])
        return Stands(self.objects, *rows)


def grasp_refusal(thing: Movable, settings: GraspSettings) -> str:
    """Return why no gripper can take hold of a thing wherever it stands; empty where one can."""
    height, (low, high) = thing.height - settings.edge_thickness / 2.0, settings.heights
    if not low <= height <= high:
        return f"edge: expected {low} to {high} m above the floor, is at {height:.3f} m"
    if settings.edge_thickness > settings.opening - settings.opening_margin:
        return (
            f"edge: expected one that plates {settings.opening} m apart go over, is {settings.edge_thickness} m thick"
        )
    need, longest = 2.0 * _half(settings), float(_faces(thing.footprint)[2].max())
    return "" if longest > need else f"faces: expected one over {need:.3f} m long, the longest is {longest:.3f} m"


def sample_stands(
    scene: NamoScene,
    rng: np.random.Generator,
    settings: RegionSettings,
    *,
    only: Collection[str] | None = None,
    fine: bool = False,
) -> Stands:
    """Draw points on all faces of all things, and return the stands before them; what is in their way is not asked yet.

    Args:
        scene: things where they stand.
        rng: draws the places on the faces.
        settings: of spacing, grippers and arms.
        only: the things to be grasped; None: all.
        fine: by the finer of the two spacings.
    """
    spacing = settings.fine_spacing if fine else settings.grasp_spacing
    names, grasp = tuple(scene.movable), settings.grasp
    rows: list[tuple[int, int, Array, Array]] = []
    for number, name in enumerate(names):
        thing = scene.movable[name]
        if (only is None or name in only) and not grasp_refusal(thing, grasp):
            faces = _faces(thing.footprint)
            for hand, hands in enumerate(EVERY_HAND):
                rows.append((number, hand, *_face_points(faces, _room(hands, grasp), spacing, rng)))
    if not rows:
        none = np.zeros(0, dtype=np.int64)
        return Stands(names, none, none, np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3)))
    counts = [len(normals) for _, _, _, normals in rows]
    things, hand_of = (np.repeat([row[column] for row in rows], counts) for column in (0, 1))
    contacts, normals = np.concatenate([row[2] for row in rows]), np.concatenate([row[3] for row in rows])
    back = np.array([-grasp.standoff - grasp.depth, 0.0, 0.0])
    bases = np.array([compose(_reach(hands, grasp).base, back) for hands in EVERY_HAND])
    faces_at = _after(np.array([scene.poses[name] for name in names])[things], _facing(contacts, normals))
    return Stands(names, things, hand_of, contacts, normals, _after(faces_at, bases[hand_of]))


def join_stands(rows: Sequence[Stands]) -> Stands:
    """Return some stands of one scene, one or more, as one."""
    columns = ("thing", "hands", "contacts", "normals", "poses")
    return Stands(rows[0].objects, *(np.concatenate([getattr(row, column) for row in rows]) for column in columns))


def free_stands(stands: Stands, scene: NamoScene, settings: RegionSettings) -> NDArray[np.bool_]:
    """Say of each stand (n,) whether robot and lowered arms are free there and on the last straight way to the grasp.

    The tests are those of `pbrl_control.grasping.candidates`, with the arms as far apart as they ever are.
    """
    if len(stands.thing) == 0:
        return np.zeros(0, dtype=bool)
    grasp = settings.grasp
    names = [*scene.fixed, *scene.movable]
    things = np.array([*scene.fixed.values(), *scene.outlines.values()], dtype=object)
    floor = scene.floor().free
    roomy = floor.buffer(-grasp.clearance) if grasp.clearance > 0.0 else floor
    shapely.prepare([roomy, scene.room])
    onward = grasp.standoff + grasp.depth
    free = shapely.covers(roomy, swept_from(scene.robot, stands.poses, onward))
    kept = np.flatnonzero(free)
    if len(kept) == 0 or len(things) == 0:
        return free
    arms = reaching_arms(grasp.home[1])
    covered = swept_from(arms, stands.poses[kept], onward)
    reaching = shapely.covers(scene.room, covered)
    own = stands.thing[kept] + len(names) - len(scene.movable)
    stand, other = shapely.STRtree(things).query(covered, predicate="intersects")
    reaching[stand[other != own[stand]]] = False
    reaching &= ~shapely.intersects(things[own], swept_from(arms, stands.poses[kept], 0.0))
    free[kept] = reaching
    return free


def swept_from(footprint: Footprint, poses: Array, distance: float) -> NDArray[np.object_]:
    """Return what a footprint covers from each pose (n, 3) straight ahead for a distance [m]: (n,) polygons."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack((np.stack((cos, sin), axis=1), np.stack((-sin, cos), axis=1)), axis=1)  # (n, 2, 2), transposed
    placed = footprint.outline @ turns + poses[:, None, :2]
    onward = placed + distance * np.stack((cos, sin), axis=1)[:, None, :]
    return shapely.convex_hull(shapely.linestrings(np.concatenate((placed, onward), axis=1)))


def _reach(hands: Hands, settings: GraspSettings) -> Reach:
    """Return where the base stands for a grasp at the middle of a wide face along the y axis of the frame."""
    found = place_plates(FacePoint(np.zeros(3), math.inf, math.inf), hands, settings)
    assert isinstance(found, Reach), "a face without end has room for every grasp"
    return found


def _half(settings: GraspSettings) -> float:
    """Return how much straight face [m] a pair of plates needs to both sides of its middle."""
    return settings.plate_width / 2.0 + settings.corner_margin


def _room(hands: Hands, settings: GraspSettings) -> float:
    """Return how much straight face [m] a grasp needs to both sides of its point."""
    return _half(settings) + (settings.lateral[0] if len(hands) > 1 else 0.0)


def _faces(footprint: Array) -> tuple[Array, Array, Array]:
    """Return start (k, 2), unit direction (k, 2) and length (k,) [m] of each face, the inside on its left."""
    outline = shapely.orient_polygons(shapely.Polygon(footprint))
    corners = shapely.get_coordinates(outline.exterior)[:-1]
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    across = after - before
    off = np.abs(across[:, 0] * (corners - before)[:, 1] - across[:, 1] * (corners - before)[:, 0])
    corners = corners[off > STRAIGHT * np.hypot(*across.T)]
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*edges.T)
    return corners, edges / lengths[:, None], lengths


def _face_points(
    faces: tuple[Array, Array, Array], room: float, spacing: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Draw points (n, 2) on faces with room to both sides [m], and return them with outward normals (n,) [rad].

    What is long enough of each face is cut into equal parts, with one point in each.
    """
    points, normals = [np.zeros((0, 2))], [np.zeros(0)]
    for start, along, length in zip(*faces, strict=True):
        wide = float(length) - 2.0 * room
        if wide <= 0.0:
            continue
        count = max(2, math.ceil(wide / spacing))
        places = room + wide * (np.arange(count) + rng.random(count)) / count
        points.append(start + places[:, None] * along)
        normals.append(np.full(count, math.atan2(-along[0], along[1])))
    return np.concatenate(points), np.concatenate(normals)


def even_points(footprint: Array, hands: Hands, spacing: float, settings: GraspSettings) -> Array:
    """Return points (n, 2) at equal distances on the faces of an outline (k, 2) that hands can grasp it at [m].

    What is long enough of each face is cut into equal parts of at most the spacing [m], with a point in the middle of
    each; two at least.
    """
    room, points = _room(hands, settings), [np.zeros((0, 2))]
    for start, along, length in zip(*_faces(footprint), strict=True):
        wide = float(length) - 2.0 * room
        if wide > 0.0:
            count = max(2, math.ceil(wide / spacing))
            points.append(start + (room + wide * (np.arange(count) + 0.5) / count)[:, None] * along)
    return np.concatenate(points)


def _facing(points: Array, normals: Array) -> Array:
    """Return poses (n, 3) at points of faces that look inwards."""
    return np.column_stack((points, normals + math.pi))


def _after(a: Array, b: Array) -> Array:
    """Return the poses (n, 3) of c in the frame of a's parent, given a, and b = c in the frame of a; row by row."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    x = a[:, 0] + cos * b[:, 0] - sin * b[:, 1]
    y = a[:, 1] + sin * b[:, 0] + cos * b[:, 1]
    return np.column_stack((x, y, np.remainder(a[:, 2] + b[:, 2] + math.pi, 2.0 * math.pi) - math.pi))
