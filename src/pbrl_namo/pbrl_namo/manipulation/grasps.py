"""Grasps of one thing out of the roadmap's, and which of them suit a model class (thesis figure 39)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.grasping.contacts import Hands, face_point, place_plates
from pbrl_control.grasping.model_rules import BAND, GraspModel, fixed_point_angles
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.navigation.footprint import Footprint, reaching_arms
from pbrl_control.planar import Array, compose, rotation, wrap
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.regions.roadmap import Roadmap
from pbrl_namo.scene import NamoScene

Flags = NDArray[np.bool_]
BANDS = 2.0 * BAND
"""[rad] about the thesis's two angles of a fixed-point object: samples lie further apart than rays that are aimed."""


@dataclass(frozen=True)
class Grasp:
    """One grasp.

    Attributes:
        sides: who grasps.
        contacts: (2,) of each side on the outline, in the thing's frame [m].
        normal: of the face, outwards, in the thing's frame [rad].
        angle: of the ray from the thing's centre to the middle of the contacts, in its frame [rad].
        base: (3,) of the base when the plates have closed, in the thing's frame [m, rad].
        leave: (3,) of the base before that and after it has backed off, likewise.
        covers: what robot and arms cover from one to the other, two convex outlines (k, 2) in the thing's frame [m].
    """

    sides: Hands
    contacts: Mapping[str, Array]
    normal: float
    angle: float
    base: Array
    leave: Array
    covers: tuple[Array, Array]


def reachable_grasps(
    scene: NamoScene, roadmap: Roadmap, name: str, region: int, settings: ManipulationSettings
) -> tuple[Grasp, ...]:
    """Return the grasps of a thing that the robot can stand for in a region, both hands first, far apart ones first.

    Args:
        scene: things where they stand.
        roadmap: with its grasp samples.
        name: of the thing.
        region: of the free space.
        settings: how many, how far apart.
    """
    outline = shapely.orient_polygons(shapely.Polygon(scene.movable[name].footprint))
    corners = np.asarray(outline.exterior.coords)[:-1]
    centre = np.asarray(outline.centroid.coords[0])
    before = covers_before(scene.robot, settings.grasping)
    found = []
    for sample in roadmap.grasps[name]:
        if int(roadmap.regions[sample.component]) == region:
            reach = place_plates(face_point(corners, sample.contact), sample.hands, settings.grasping)
            if not isinstance(reach, str):
                found.append(complete(sample.hands, reach.contacts, reach.base, centre, before, settings.grasping))
    return tuple(found)


def complete(
    sides: Hands,
    contacts: Mapping[str, Array],
    base: Array,
    centre: Array,
    before: tuple[Array, Array],
    grasping: GraspSettings,
) -> Grasp:
    """Return a grasp from where plates and base are in the thing's frame.

    Args:
        sides: who grasps.
        contacts: (2,) of each side on the outline, in the thing's frame [m].
        base: (3,) of the base when the plates have closed, likewise [m, rad].
        centre: (2,) of the thing, likewise [m].
        before: outlines that robot and arms cover, see `covers_before`.
        grasping: what the grippers can do.
    """
    leave = compose(base, np.array([-grasping.standoff - grasping.depth, 0.0, 0.0]))
    out = np.mean([contacts[side] for side in sides], axis=0) - centre
    heading = float(base[2])
    covers = tuple(cover @ rotation(heading).T + base[:2] for cover in before)
    angle = math.atan2(out[1], out[0])
    return Grasp(sides, dict(contacts), wrap(heading + math.pi), angle, base, leave, (covers[0], covers[1]))


def covers_before(robot: Footprint, grasping: GraspSettings) -> tuple[Array, Array]:
    """Return what robot and arms cover from where they leave to where the plates close (k, 2), in that base's frame."""
    back = np.array([-grasping.standoff - grasping.depth, 0.0])
    parts = (robot, reaching_arms(grasping.home[1]))
    swept = [shapely.orient_polygons(part.swept(back, np.zeros(2), 0.0)) for part in parts]
    outlines = [np.asarray(cover.exterior.coords)[:-1] for cover in swept]
    return outlines[0], outlines[1]


def chosen(grasps: Sequence[Grasp], wanted: Flags, settings: ManipulationSettings) -> list[int]:
    """Return the indices of a few grasps, far from each other, both hands before one.

    Args:
        grasps: all of them.
        wanted: (g,) which may be chosen.
        settings: how many, how far apart.
    """
    middles = np.array([np.mean(list(grasp.contacts.values()), axis=0) for grasp in grasps]).reshape(-1, 2)
    hands = np.array([len(grasp.sides) for grasp in grasps], dtype=np.int64)
    gaps, kept = np.full(len(grasps), math.inf), list[int]()
    for count in (2, 1):
        left: Flags = np.asarray(wanted) & (hands == count)
        while left.any() and len(kept) < settings.grasps:
            best = int(np.argmax(np.where(left, gaps, -1.0)))
            if gaps[best] < settings.apart:
                break
            kept.append(best)
            left[best] = False
            gaps = np.minimum(gaps, np.hypot(*(middles - middles[best]).T))
    return kept


def suits(grasps: Sequence[Grasp], freedom: Freedom, footprint: Array, centre: Array) -> Flags:
    """Say of each grasp (g,) whether it is one of those that figure 39 allows a model class.

    Args:
        grasps: that are asked about.
        freedom: of the thing.
        footprint: (k, 2) its outline [m].
        centre: (2,) of the rays [m].
    """
    kind, count = freedom.model_class, len(grasps)
    if kind == ModelClass.STATIC:
        return np.zeros(count, dtype=bool)
    if kind == ModelClass.ANISOTROPIC:
        vx, vy, _ = freedom.moves[0]
        rule = GraspModel(kind, free_axis=math.atan2(vy, vx))
        return np.array([not rule.face_fault(grasp.normal) for grasp in grasps], dtype=bool)
    if kind == ModelClass.FIXED_POINT:
        angles = fixed_point_angles(footprint, centre, freedom.anchor)
        near = [any(abs(wrap(grasp.angle - angle)) <= BANDS for angle in angles) for grasp in grasps]
        return np.array(near, dtype=bool)
    return np.ones(count, dtype=bool)
