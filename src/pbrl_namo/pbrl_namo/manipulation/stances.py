"""All grasps of one thing, in its own frame, and which of them are free with the thing at some pose.

The roadmap's grasps are of things where they stand. Who moves a thing in several steps takes hold of it again where it
has come to; these are for that: points at equal distances on every face, which need no roadmap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.grasping.candidates import EVERY_HAND
from pbrl_control.grasping.contacts import face_point, place_plates
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.planar import Array, compose
from pbrl_namo.manipulation.body import circle_around
from pbrl_namo.manipulation.grasps import Grasp, complete, covers_before
from pbrl_namo.manipulation.pieces import Pieces
from pbrl_namo.manipulation.stance_kernel import nearer_than
from pbrl_namo.regions.grasps import even_points, grasp_refusal
from pbrl_namo.scene import NamoScene

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Stances:
    """Grasps of one thing.

    Attributes:
        grasps: g of them, in the thing's frame.
        leaves: (g, 2) where the base's middle is before each and after it has backed off, in the thing's frame [m].
        hulls: (k, 2) corners of what robot and arms cover, two convex outlines a grasp, in the thing's frame [m].
        starts: (2 g + 1,) where each begins.
        circles: (2 g, 3) around each.
        clearances: (2 g,) that each keeps from everything else [m].
    """

    grasps: tuple[Grasp, ...]
    leaves: Array
    hulls: Array
    starts: Indices
    circles: Array
    clearances: Array

    @classmethod
    def of(cls, scene: NamoScene, name: str, spacing: float, grasping: GraspSettings) -> Self:
        """Place grasps on all faces of a thing.

        Args:
            scene: with the thing and the robot.
            name: of the thing.
            spacing: between grasps along a face [m].
            grasping: what grippers and arms can do.
        """
        thing = scene.movable[name]
        outline = shapely.orient_polygons(shapely.Polygon(thing.footprint))
        corners, centre = np.asarray(outline.exterior.coords)[:-1], np.asarray(outline.centroid.coords[0])
        before = covers_before(scene.robot, grasping)
        found: list[Grasp] = []
        for hands in () if grasp_refusal(thing, grasping) else EVERY_HAND:
            for point in even_points(thing.footprint, hands, spacing, grasping):
                reach = place_plates(face_point(corners, point), hands, grasping)
                if not isinstance(reach, str):
                    grasp = complete(hands, reach.contacts, reach.base, centre, before, grasping)
                    if shapely.Polygon(grasp.covers[0]).distance(outline) >= grasping.clearance:
                        found.append(grasp)
        outlines = [cover for grasp in found for cover in grasp.covers]
        starts = np.concatenate(([0], np.cumsum([len(each) for each in outlines]))).astype(np.int64)
        return cls(
            tuple(found),
            np.array([grasp.leave[:2] for grasp in found]).reshape(-1, 2),
            np.vstack(outlines) if outlines else np.zeros((0, 2)),
            starts,
            np.array([circle_around(each) for each in outlines]).reshape(-1, 3),
            np.tile([grasping.clearance, 0.0], len(found)),
        )

    def __len__(self) -> int:
        return len(self.grasps)

    def free(self, pose: Array, region: shapely.Polygon, pieces: Pieces) -> Flags:
        """Say which grasps (g,) the robot can take with the thing at a pose.

        Args:
            pose: (3,) of the thing in `world` [m, rad].
            region: of the free space, that the robot is in.
            pieces: of everything but the thing.
        """
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x, y = (self.leaves @ np.array([[c, s], [-s, c]]) + pose[:2]).T
        inside: Flags = shapely.intersects_xy(region, x, y)
        met = np.zeros(2 * len(self), dtype=np.bool_)
        nearer_than(
            np.asarray(pose, dtype=float),
            self.hulls,
            self.starts,
            self.circles,
            np.repeat(inside, 2),
            self.clearances,
            pieces.points,
            pieces.starts,
            pieces.boxes,
            met,
        )
        return inside & ~met.reshape(-1, 2).any(axis=1)

    def free_ones(self, pose: Array, region: shapely.Polygon, pieces: Pieces) -> tuple[Grasp, ...]:
        """Return the grasps that `free` says."""
        return self.taken(np.flatnonzero(self.free(pose, region, pieces)).tolist())

    def taken(self, chosen: Sequence[int]) -> tuple[Grasp, ...]:
        """Return some of the grasps."""
        return tuple(self.grasps[k] for k in chosen)


def leave_point(pose: Array, grasp: Grasp) -> Array:
    """Return where the base's middle is (2,) in `world`, once it has backed off from a thing at a pose (3,) [m]."""
    return compose(pose, grasp.leave)[:2]
