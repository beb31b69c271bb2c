"""Many ways of moving one thing, followed until a way is open or something is hit (thesis 6.2.1 step 2, 6.3.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.planar import Array, rotation
from pbrl_namo.beliefs.stops import reach
from pbrl_namo.manipulation.body import Body, circle_around
from pbrl_namo.manipulation.grasps import Grasp
from pbrl_namo.manipulation.opening_kernel import draw_track
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.policies import TURNS
from pbrl_namo.manipulation.reference import WayField
from pbrl_namo.manipulation.rollout_kernel import OPEN, ROBOT, THING, roll
from pbrl_namo.manipulation.settings import ManipulationSettings, MotionSettings
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import free_space
from pbrl_namo.regions.openings import Opening
from pbrl_namo.regions.sewing import ways_through

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

FAR_SIDEWAYS = 1e-6
"""[m] per unit of a command below which the base is not carried sideways."""
NEVER = 1 << 60
"""Steps between two looks for an opening that nobody wants."""
NO_LIMIT = 1e-9
"""Share of what it can be carried sideways, per unit of a command, that limits nothing."""


@dataclass(frozen=True)
class Rollouts:
    """What became of each command with each grasp.

    Attributes:
        went: (c, g) how far the command was followed, in units of it.
        opened: (c, g) whether a way was open then.
        hits: (c, g) index of what was hit in the yard's names, else -1.
        robot: (c, g) whether it was the robot that hit it.
    """

    went: Array
    opened: Flags
    hits: Indices
    robot: Flags


class Roller:
    """Follows commands of one thing, for one opening.

    Args:
        yard: the scene, prepared.
        opening: that is to be made.
        body: outline of its object.
        grasps: g of them; none: everything in the room matters, see `regrasped`.
        target: (2,) in `world`; a way from where the base then is to here is what is wanted. None: nothing is, and
            commands are followed as far as they go.
        settings: of motion and grid.

    Attributes:
        pose: (3,) of the thing in `world` at the start [m, rad].
        grasps: as given.
    """

    def __init__(
        self,
        yard: Yard,
        opening: Opening,
        body: Body,
        grasps: Sequence[Grasp],
        target: Array | None,
        settings: ManipulationSettings,
    ) -> None:
        self.pose = np.array(yard.scene.poses[opening.object], dtype=float)
        self._body, self._motion = body, settings.motion
        self._target = np.zeros(2) if target is None else np.asarray(target, dtype=float)
        self._look = settings.motion.look if target is not None else NEVER
        self._hold(grasps)
        self._ways: list[Array | None] = [np.zeros((1, 2)) for _ in grasps]
        if target is not None:
            self._ways = reference_ways(yard, opening, target, list(self.leaves))
        reach = float(np.hypot(*np.vstack((body.points, *self._outlines)).T).max()) if len(grasps) else math.inf
        near = _nearby(yard, opening, self.pose, 2.0 * settings.motion.way + reach)
        self._pieces, self._clusters = yard.pieces.taken(near), yard.clusters((opening.object, *opening.then))[near]
        self._clusters[yard.owned(opening.then)[near]] = -1
        self._sizes = np.array([yard.radius, self._motion.spare, self._motion.clearance, self._motion.chord])

    def _hold(self, grasps: Sequence[Grasp]) -> None:
        self.grasps = tuple(grasps)
        self._outlines = [outline for grasp in grasps for outline in grasp.covers]
        self._leaves = np.array([grasp.leave[:2] for grasp in grasps]).reshape(-1, 2)

    @property
    def leaves(self) -> Array:
        """Where the base's middle is (g, 2) in `world` before it has grasped [m]."""
        places: Array = self._leaves @ rotation(float(self.pose[2])).T + self.pose[:2]
        return places

    def regrasped(self, pose: Array, grasps: Sequence[Grasp], field: WayField | None) -> Roller:
        """Return the same for the thing at another pose (3,), held in other ways; it must have been made with none.

        Args:
            pose: of the thing in `world` [m, rad].
            grasps: of it.
            field: ways to the target; None where none is wanted.
        """
        other = copy(self)
        other.pose = np.array(pose, dtype=float)
        other._hold(grasps)
        other._ways = [np.zeros((1, 2)) for _ in grasps]
        if field is not None:
            other._ways = [field.way(leave) for leave in other.leaves]
        return other

    def looking(self, target: Array) -> Roller:
        """Return the same, with a target (2,) to which a way is wanted [m]."""
        other = copy(self)
        other._target, other._look = np.asarray(target, dtype=float), self._motion.look
        return other

    def reference(self) -> shapely.LineString | None:
        """Return a way in `world`, from one of the grasps to the target, that would be free without the thing."""
        way = next((way for way in self._ways if way is not None and len(way) > 1), None)
        return None if way is None else shapely.LineString(way)

    def roll(self, twists: Array, usable: Flags) -> Rollouts:
        """Follow commands (c, 3) with those grasps that they may be tried with (c, g), from where the thing stands."""
        return self._roll(self.pose, range(len(self.grasps)), self._ways, twists, usable)

    def roll_on(self, first: Array, way: float, grasp: int, twists: Array) -> Rollouts:
        """Follow commands (c, 3) with one grasp after another command (3,) was followed for a way."""
        there, line = np.empty(3), self._ways[grasp]
        moved(self.pose, first, way, there)
        if line is not None:
            track = np.empty((math.ceil(abs(first[2]) * way / self._motion.chord) + 2, 2))
            count = draw_track(self.pose, first, way, self._leaves[grasp], self._motion.chord, track)
            line = np.vstack((track[: count - 1], line))
        used = float(aside(first[None], [self.grasps[grasp]], self._motion)[0, 0]) * way
        return self._roll(there, [grasp], [line], twists, np.ones((len(twists), 1), dtype=bool), min(used, 1.0))

    def _roll(
        self,
        pose: Array,
        chosen: Sequence[int],
        ways: Sequence[Array | None],
        twists: Array,
        usable: Flags,
        used: float = 0.0,
    ) -> Rollouts:
        """Follow commands from a pose (3,), with some of the grasps and the ways (n, 2) that belong to them.

        `used` is the share of what the base can be carried sideways that is used up.
        """
        body, motion, pieces = self._body, self._motion, self._pieces
        outlines = [self._outlines[2 * g + part] for g in chosen for part in (0, 1)]
        hulls = np.vstack(outlines)
        held = [self.grasps[g] for g in chosen]
        left = (1.0 - used) / np.maximum(aside(twists, held, motion), NO_LIMIT)
        ends = reach(body.stops, pose, twists, np.where(np.abs(twists[:, 2]) > TURNS, motion.turn, motion.way))
        limits = np.where(usable & [way is not None for way in ways], np.minimum(left, ends[:, None]), 0.0)
        lines = [np.zeros((1, 2)) if way is None else way for way in ways]
        went, causes, hits = np.zeros(limits.shape), *(np.full(limits.shape, -1, dtype=np.int64) for _ in range(2))
        roll(
            pose,
            body.points,
            body.starts,
            body.circle,
            body.hubs,
            body.doors,
            body.parents,
            hulls,
            _starts(outlines),
            np.array([circle_around(outline) for outline in outlines]),
            self._leaves[list(chosen)],
            pieces.points,
            pieces.starts,
            pieces.boxes,
            self._clusters,
            np.vstack(lines),
            _starts(lines),
            self._target,
            twists,
            np.array([motion.step / _fastest(twist, np.vstack((body.points, hulls))) for twist in twists]),
            limits,
            self._sizes,
            self._look,
            went,
            causes,
            hits,
        )
        hit = (causes == THING) | (causes == ROBOT)
        owners = np.where(hit, pieces.owners[np.where(hit, hits, 0)] if len(pieces) else -1, -1)
        return Rollouts(went, causes == OPEN, owners, causes == ROBOT)


def reference_ways(yard: Yard, opening: Opening, target: Array, starts: Sequence[Array]) -> list[Array | None]:
    """Return ways (n, 2) of the disc from each start to the target [m] as if the things that have to go were gone.

    A grid finds them; where it finds none, for a passage may be narrow, the exact free space's triangles are asked.
    """
    gone = (opening.object, *opening.then)
    ways = yard.grid.ways(yard.owned(gone), target, starts)
    if all(way is not None for way in ways):
        return ways
    free = free_space(yard.scene, yard.radius, gone)
    end = free.index(target)
    if end is None:
        return ways
    lost = [k for k, way in enumerate(ways) if way is None and free.index(starts[k]) == end]
    if lost:
        for k, way in zip(
            lost, ways_through(free.regions[end], target, np.array([starts[k] for k in lost])), strict=True
        ):
            ways[k] = np.ascontiguousarray(way[::-1])
    return ways


def base_twists(twists: Array, grasps: Sequence[Grasp]) -> Array:
    """Return the twist (c, g, 3) of the base, at its middle in its own axes, while it follows each command rigidly."""
    places = np.array([grasp.base for grasp in grasps]).reshape(-1, 3)
    vx = twists[:, None, 0] - twists[:, None, 2] * places[None, :, 1]
    vy = twists[:, None, 1] + twists[:, None, 2] * places[None, :, 0]
    c, s = np.cos(places[:, 2]), np.sin(places[:, 2])
    return np.stack((c * vx + s * vy, c * vy - s * vx, np.broadcast_to(twists[:, None, 2], vx.shape)), axis=-1)


def timing(twists: Array, grasps: Sequence[Grasp], motion: MotionSettings) -> tuple[Array, Array]:
    """Return factors (c, g) of the commands that keep base and object slow, and the times (c, g) to get there [s]."""
    base = base_twists(twists, grasps)
    going = np.maximum(np.hypot(base[..., 0], base[..., 1]), np.hypot(twists[:, 0], twists[:, 1])[:, None])
    turning = np.abs(base[..., 2])
    speeds = 1.0 / np.maximum(going / motion.speed, turning / motion.yaw_rate)
    ramps = speeds * np.maximum(going / motion.acceleration, turning / motion.yaw_acceleration)
    return speeds, ramps


def aside(twists: Array, grasps: Sequence[Grasp], motion: MotionSettings) -> Array:
    """Return the share (c, g) of what arms and shunting make up for sideways that a unit of each command uses up."""
    base = base_twists(twists, grasps)
    ahead, across = base[..., 0], np.abs(base[..., 1])
    forward = (across - motion.sideways_forward * ahead) / motion.sideways
    share = np.where(ahead >= 0.0, np.maximum(forward, 0.0), across / motion.sideways_backward)
    return np.where(across > FAR_SIDEWAYS, share, 0.0)


def _fastest(twist: Array, points: Array) -> float:
    """Return the greatest speed of points (n, 2) of a body with a unit twist (3,)."""
    return float(np.hypot(twist[0] - twist[2] * points[:, 1], twist[1] + twist[2] * points[:, 0]).max())


def _nearby(yard: Yard, opening: Opening, pose: Array, reach: float) -> Indices:
    """Return the pieces, other than the object's own, that matter within a distance [m] of where it is."""
    boxes = yard.pieces.boxes
    away = np.maximum(np.maximum(boxes[:, :2] - pose[:2], pose[:2] - boxes[:, 2:]), 0.0)
    near: Flags = (np.hypot(*away.T) <= reach + 3.0 * yard.radius) & ~yard.owned((opening.object,))
    return np.flatnonzero(near)


def _starts(rows: Sequence[Array]) -> Indices:
    return np.concatenate(([0], np.cumsum([len(row) for row in rows]))).astype(np.int64)
