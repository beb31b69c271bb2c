"""Whether a goal among movable things is out of reach: proofs, from what is true of each thing.

A goal counts as out of reach only where one of two proofs holds. Both give the robot more than it has: no margins, any
force, and things that it could move are as good as gone.

1. *What can ever be moved.* The first thing that is moved has to be grasped where it stands, from where the robot can
   drive. Take it away, and see what can be grasped then; and so on. What is never grasped like this can never be moved,
   in no order, for whatever was moved is in the way of more than if it were gone. If start and goal are apart with
   everything else gone, the goal is out of reach.
2. *What only turns.* Something that start and goal are apart by, all else gone that can be moved, and that is free only
   to turn about a point, has one coordinate. All angles are visited that it can be brought to, in as many grasps as it
   takes, with all sides of it that the robot can come to on the way. At first only what can be moved before it is gone;
   then also what can be grasped from a place come to on the way, and all angles are visited anew. If from none of them
   the goal can be reached, it is out of reach.

What neither proves is taken to be within reach. So "wrongly said to be out of reach" may still be said of a room in
which nothing helps; the other way round only by the resolution: grasps every few centimetres, angles every few degrees.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
import shapely

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import Array, rotation
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.body import Body
from pbrl_namo.manipulation.grasps import Grasp
from pbrl_namo.manipulation.pieces import Pieces
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.rollout import Roller
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.stances import Stances
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import ARC, FreeSpace, as_regions, free_space
from pbrl_namo.regions.openings import Opening
from pbrl_namo.regions.whereabouts import region_of
from pbrl_namo.scene import NamoScene

SPACING = 0.04
"""[m] between grasps along a face."""
AROUND = 320
ANGLE = 2.0 * math.pi / AROUND
"""[rad] between angles of what only turns; so many are a full turn."""
LEAST = 0.01
"""[m], [rad] of a motion that is one."""


def out_of_reach(scene: NamoScene, truth: Mapping[str, ObjectModel]) -> bool:
    """Say whether it is proved that the goal is out of reach.

    Args:
        scene: as it stands; the robot in it.
        truth: what each movable thing is.
    """
    try:
        return Proof(scene, truth).holds()
    except NamoError:  # start or goal are in no region even with everything gone
        return True


class Proof:
    """Looks for a proof in one scene.

    Args:
        scene: as it stands.
        truth: what each movable thing is.
    """

    def __init__(self, scene: NamoScene, truth: Mapping[str, ObjectModel]) -> None:
        told = ManipulationSettings()
        self._scene = scene
        self._settings = told.model_copy(
            update={
                "motion": told.motion.model_copy(update={"clearance": 0.0}),
                "grasping": told.grasping.model_copy(update={"clearance": 0.0}),
            }
        )
        self._freedoms = {name: Freedom.of(model, scene.poses[name]) for name, model in truth.items()}
        self._stances: dict[str, Stances] = {}
        self._rollers: dict[tuple[str, frozenset[str]], tuple[Pieces, Roller]] = {}

    def holds(self) -> bool:
        """Say whether one was found.

        Raises:
            NamoError: start or goal are in no region.
        """
        gone = self._movable()
        if not self._joined(gone):
            return True
        return any(
            self._freedoms[name].model_class == ModelClass.FIXED_POINT
            and not self._joined(gone - {name})
            and not self._turned(name)
            for name in sorted(gone)
        )

    def _movable(self, stays: str = "") -> set[str]:
        """Return what can ever be moved, at most, while one thing stays where it is."""
        gone: set[str] = set()
        while True:
            bare, free = self._without(gone)
            region = free.regions[region_of(bare, free, bare.start)]
            more = {
                name
                for name in bare.movable
                if name != stays and len(self._freedoms[name].moves) and self._moves(bare, name, region)
            }
            if not more:
                return gone
            gone |= more

    def _moves(self, scene: NamoScene, name: str, region: shapely.Polygon) -> bool:
        """Say whether a thing can be grasped from a region, and moved at all."""
        pieces, roller = self._prepared(scene, name)
        pose = np.array(scene.poses[name], dtype=float)
        grasps = self._grasps(name).free_ones(pose, region, pieces)
        if not grasps or self._freedoms[name].model_class == ModelClass.UNCONSTRAINED:
            return len(grasps) > 0  # what is free goes back at least, as the robot came
        return bool((self._went(roller, name, pose, grasps) > LEAST).any())

    def _turned(self, name: str) -> bool:
        """Say whether the goal can be reached past a thing that only turns."""
        gone = self._movable(stays=name)
        while True:
            reached, parts = self._visited(name, gone)
            if reached:
                return True
            bare, _ = self._without(gone | {name})
            more = {
                other
                for other in bare.movable
                if len(self._freedoms[other].moves) and any(self._held_from(bare, other, part) for part in parts)
            }
            if not more:
                return False
            gone |= more

    def _visited(self, name: str, gone: Collection[str]) -> tuple[bool, list[shapely.Polygon]]:
        """Say whether the goal can be reached past a thing that only turns, all else gone; else from where it cannot.

        Returns:
            Whether it can; the parts of the floor that the robot can come to. Where nothing can be said, it can.
        """
        bare, free = self._without(set(gone))
        turn = Turn(bare, free, name, self._freedoms[name].moves[0])
        pieces, roller = self._prepared(bare, name)
        stances = self._grasps(name)
        begun = turn.side(0, bare.start[:2])
        if begun is None:
            return True, []  # the robot stands where the disc has no room: nothing is proved
        waiting = [(0, begun)]
        seen = set(waiting)
        if turn.parts(0)[begun].intersects(turn.goal):
            return True, []
        while waiting:
            k, side = waiting.pop()
            grasps = stances.free_ones(turn.pose(k), turn.parts(k)[side], pieces)
            if not grasps:
                continue
            went = self._went(roller, name, turn.pose(k), grasps)
            leaves = np.array([grasp.leave[:2] for grasp in grasps])
            for row, sign in enumerate((1, -1)):
                for steps in range(1, int(went[row].max() / ANGLE) + 1):
                    other = (k + sign * steps) % AROUND
                    sides = turn.sides(other, leaves[went[row] >= steps * ANGLE])
                    if any(turn.parts(other)[each].intersects(turn.goal) for each in sides):
                        return True, []
                    new = {(other, each) for each in sides} - seen
                    seen |= new
                    waiting += sorted(new)
        return False, [turn.parts(k)[side] for k, side in sorted(seen)]

    def _held_from(self, scene: NamoScene, name: str, part: shapely.Polygon) -> bool:
        """Say whether a thing of a scene can be grasped from a part of the floor."""
        pieces, _ = self._prepared(scene, name)
        return bool(self._grasps(name).free(np.array(scene.poses[name], dtype=float), part, pieces).any())

    def _went(self, roller: Roller, name: str, pose: Array, grasps: tuple[Grasp, ...]) -> Array:
        """Return how far a thing goes (c, g), its moves in the one direction first, with each grasp."""
        moves = self._freedoms[name].moves
        twists = np.vstack((moves, -moves))
        held = roller.regrasped(pose, grasps, None)
        return held.roll(twists, np.ones((len(twists), len(grasps)), dtype=bool)).went

    def _prepared(self, scene: NamoScene, name: str) -> tuple[Pieces, Roller]:
        key = (name, frozenset(scene.movable))
        if key not in self._rollers:
            yard = Yard.of(scene, free_space(scene).radius, self._settings.cell)
            body = Body.of(scene.movable[name].footprint)
            roller = Roller(yard, Opening(0, 0, name), body, (), None, self._settings)
            self._rollers[key] = yard.pieces.taken(np.flatnonzero(~yard.owned((name,)))), roller
        return self._rollers[key]

    def _grasps(self, name: str) -> Stances:
        if name not in self._stances:
            self._stances[name] = Stances.of(self._scene, name, SPACING, self._settings.grasping)
        return self._stances[name]

    def _without(self, gone: Collection[str]) -> tuple[NamoScene, FreeSpace]:
        bare = self._scene.without(gone)
        return bare, free_space(bare)

    def _joined(self, gone: Collection[str]) -> bool:
        bare, free = self._without(gone)
        return region_of(bare, free, bare.start) == region_of(bare, free, bare.goal, "goal")


class Turn:
    """A thing that only turns, at equal angles, and the parts of the floor that it then leaves.

    Args:
        scene: with it and what stays.
        free: its free space.
        name: of the thing.
        twist: (3,) of its origin in its axes, when it turns by 1 rad/s.
    """

    def __init__(self, scene: NamoScene, free: FreeSpace, name: str, twist: Array) -> None:
        self.goal = shapely.Point(scene.goal[:2])
        self._thing, self._radius, self._twist = scene.movable[name], free.radius, twist
        self._start = np.array(scene.poses[name], dtype=float)
        self._floor = shapely.union_all(list(free_space(scene, free.radius, name).regions))
        self._parts: dict[int, tuple[shapely.Polygon, ...]] = {}

    def pose(self, k: int) -> Array:
        """Return the pose (3,) in `world` at the k-th angle [m, rad]."""
        there = np.empty(3)
        moved(self._start, self._twist, k * ANGLE, there)
        return there

    def parts(self, k: int) -> tuple[shapely.Polygon, ...]:
        """Return the parts of the floor at the k-th angle."""
        if k not in self._parts:
            grown = self._thing.at(self.pose(k)).buffer(self._radius, quad_segs=ARC)
            self._parts[k] = as_regions(self._floor.difference(grown))
        return self._parts[k]

    def side(self, k: int, point: Array) -> int | None:
        """Return the part that a point (2,) in `world` is in [m]; None where in none."""
        return next((j for j, part in enumerate(self.parts(k)) if shapely.intersects_xy(part, *point)), None)

    def sides(self, k: int, points: Array) -> set[int]:
        """Return the parts in which points (n, 2) of the thing's frame are [m]."""
        pose = self.pose(k)
        x, y = (points @ rotation(float(pose[2])).T + pose[:2]).T
        return {j for j, part in enumerate(self.parts(k)) if shapely.intersects_xy(part, x, y).any()}
