"""Several manipulations of one thing, one after the other, each with a grasp of its own, until something is reached.

One grasp is often not enough: the base cannot go sideways, a wall comes in its way, a turn about a locked caster takes
it where there is no floor. Then the thing is moved as far as it goes, let go, and taken hold of again from where the
robot can then stand. This is a best-first search over poses of the thing: from each, grasps that the robot can reach
there are tried with all motions that the thing's class allows, and where a motion ends, or half-way there, is a pose
to go on from. What is wanted is an `Aim`: an opening, or that the thing is out of the way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.planar import Array
from pbrl_namo.manipulation.effort_kernel import SUM
from pbrl_namo.manipulation.grasps import Grasp, chosen
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.policies import TURNS, Commands, motions_of
from pbrl_namo.manipulation.reference import WayField
from pbrl_namo.manipulation.rollout import Roller, timing
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.stances import leave_point
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.ways_to_move import WaysToMove
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import ARC, FreeSpace, free_space
from pbrl_namo.regions.openings import Opening

Flags = NDArray[np.bool_]
SHORT = 0.05
"""Share of a unit, m or rad, below which a motion is none."""
SAME_PLACE, SAME_TURN = 0.12, 0.15
"""[m], [rad] between two poses that are looked at as one; of what can only turn a third of it."""
FINER = 3.0
LEVER = 0.5
"""[m] of a way that a turn of 1 rad counts as."""
DEEPER = 0.2
"""[m] of a way covered that a further step counts as."""


@dataclass(frozen=True)
class Step:
    """One manipulation.

    Attributes:
        pose: (3,) of the thing in `world` at its start [m, rad].
        grasp: of the thing.
        twist: (3,) of its origin in its axes, of unit size.
        way: how far that is followed, in units of it.
    """

    pose: Array
    grasp: Grasp
    twist: Array
    way: float

    def at(self, share: float) -> Array:
        """Return the pose (3,) of the thing in `world` after a share of it [m, rad]."""
        there = np.empty(3)
        moved(np.asarray(self.pose, dtype=float), self.twist, share * self.way, there)
        return there

    @property
    def end(self) -> Array:
        """The pose (3,) of the thing in `world` after it [m, rad]."""
        return self.at(1.0)

    @property
    def leave(self) -> Array:
        """Where the base's middle is (2,) in `world` once it has backed off after it [m]."""
        return leave_point(self.end, self.grasp)


@dataclass(frozen=True)
class Tries:
    """Motions from one pose, as far as they go.

    Attributes:
        pose: (3,) of the thing in `world` [m, rad].
        grasps: of it.
        held: (n,) index of the grasp of each.
        twists: (n, 3) unit twists.
        ways: (n,) how far they are followed.
        seconds: (n,) that takes [s].
        opened: (n,) whether a way to the target is open then.
    """

    pose: Array
    grasps: tuple[Grasp, ...]
    held: NDArray[np.int64]
    twists: Array
    ways: Array
    seconds: Array
    opened: Flags

    def __len__(self) -> int:
        return len(self.ways)

    def shared(self, shares: Sequence[float] | Array) -> Tries:
        """Return parts of all of them, the first share of each, then the next."""
        parts = np.asarray(shares, dtype=float)
        twice = np.tile(np.arange(len(self)), len(parts))
        share = np.repeat(parts, len(self))
        return Tries(
            self.pose,
            self.grasps,
            self.held[twice],
            self.twists[twice],
            share * self.ways[twice],
            share * self.seconds[twice],
            self.opened[twice] & (share >= 1.0),
        )

    def ends(self) -> Array:
        """Return the poses (n, 3) of the thing in `world` at their ends [m, rad]."""
        angles = self.twists[:, 2] * self.ways
        turns = np.abs(self.twists[:, 2]) > TURNS
        rate = np.where(turns, self.twists[:, 2], 1.0)
        sine = np.where(turns, np.sin(angles) / rate, self.ways)
        versine = np.where(turns, 2.0 * np.sin(0.5 * angles) ** 2 / rate, 0.0)
        x = self.twists[:, 0] * sine - self.twists[:, 1] * versine
        y = self.twists[:, 0] * versine + self.twists[:, 1] * sine
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        return np.column_stack((self.pose[0] + c * x - s * y, self.pose[1] + s * x + c * y, self.pose[2] + angles))

    def step(self, k: int) -> Step:
        """Return one of them."""
        return Step(self.pose, self.grasps[self.held[k]], self.twists[k], float(self.ways[k]))


class Aim(Protocol):
    """What steps are to lead to.

    Attributes:
        target: (2,) in `world` to which a way is to be open; None: none is [m].
    """

    target: Array | None

    def reached(self, tries: Tries) -> Step | None:
        """Return the step that gets there, the best of those tried or a part of one; None where none does."""

    def far(self, poses: Array, way: shapely.LineString | None) -> Array:
        """Return how far from it (n,) poses (n, 3) of the thing are [m]; infinite: not to be gone to.

        Args:
            poses: in `world` [m, rad].
            way: to the target as if the thing were gone; None: there is none.
        """


@dataclass(frozen=True)
class Place:
    """A pose of the thing that can be come to, how, and how far from what is wanted it is [m]."""

    pose: Array
    steps: tuple[Step, ...]
    far: float


class StepSearch:
    """Looks for steps.

    Args:
        yard: the scene, prepared.
        free: its free space.
        opening: its object is what is moved, its start where the robot is; its `then` are not gone round.
        study: of its object; the typical one of its worlds is looked at.
        aim: what is wanted.
        settings: budgets, motion.
        been: poses (3,) of the thing at which it has been let go already: it is not brought back there [m, rad].
    """

    def __init__(
        self,
        yard: Yard,
        free: FreeSpace,
        opening: Opening,
        study: Study,
        aim: Aim,
        settings: ManipulationSettings,
        been: Sequence[Array] = (),
    ) -> None:
        self._yard, self._free, self._opening, self._body = yard, free, opening, study.body
        self._stances, self._aim, self._settings = study.stances, aim, settings
        self._world = study.worlds.only(study.worlds.typical())
        self._freedom = self._world.freedoms[0]
        name = opening.object
        self._thing = yard.scene.movable[name]
        self._others = yard.pieces.taken(np.flatnonzero(~yard.owned((name,))))
        self._floor = shapely.union_all(list(free_space(yard.scene, free.radius, name).regions))
        self._roller = Roller(yard, opening, study.body, (), None, settings)
        self._field: WayField | None = None
        if aim.target is not None:
            self._field = yard.grid.field(yard.owned((name, *opening.then)), aim.target)
            self._roller = self._roller.looking(aim.target)
        self._line: shapely.LineString | None = None
        self._turns = self._freedom.model_class == ModelClass.FIXED_POINT
        self._finer = FINER if self._turns else 1.0
        self._seen = {self._key(pose) for pose in (yard.scene.poses[name], *been)}

    def find(self) -> tuple[Step, ...]:
        """Return the steps; empty where none were found within the budget."""
        if self._aim.target is not None and self._field is None:
            return ()
        waiting = [Place(np.array(self._yard.scene.poses[self._opening.object], dtype=float), (), 0.0)]
        gone_on: list[Array] = []
        for _ in range(self._settings.step_places):
            if not waiting:
                break
            place = waiting.pop(self._next(waiting, gone_on))
            gone_on.append(place.pose)
            last, tries = self._from(place)
            if last is not None:
                return (*place.steps, last)
            if tries is not None and len(place.steps) + 1 < self._settings.steps:
                waiting += [Place(step.end, (*place.steps, step), far) for far, step in self._worth(tries)]
        return ()

    def _next(self, waiting: list[Place], gone_on: list[Array]) -> int:
        """Return which place to go on from: near to what is wanted, few steps away, unlike those it was gone on from.

        Of what can only turn, how far it is from what is wanted says little: it may have to turn the other way round.
        """
        if not gone_on:
            return 0
        apart = np.array([place.pose for place in waiting])[:, None] - np.array(gone_on)
        away = np.hypot(apart[..., 0], apart[..., 1]) + LEVER * np.abs(apart[..., 2])
        far = np.array([0.0 if self._turns else place.far for place in waiting])
        deep = np.array([DEEPER * len(place.steps) for place in waiting])
        return int(np.argmin(far + deep - away.min(axis=1)))

    def _from(self, place: Place) -> tuple[Step | None, Tries | None]:
        """Return the step from a place that gets to what is wanted, or everything that leads somewhere."""
        region = self._region(place)
        if region is None:
            return None, None
        settings = self._settings
        usable = self._stances.free(place.pose, region, self._others)
        few = settings.model_copy(update={"grasps": settings.step_grasps})
        grasps = self._stances.taken(chosen(self._stances.grasps, usable, few))
        if not grasps:
            return None, None
        roller = self._roller.regrasped(place.pose, grasps, self._field)
        self._line = self._line or roller.reference()
        twists, mask = motions_of(self._freedom, [grasp.base for grasp in grasps], settings.radii)
        found = roller.roll(twists, mask & self._bearable(twists, mask, grasps))
        speeds, _ = timing(twists, grasps, settings.motion)
        c, g = np.nonzero((found.went > SHORT) | found.opened)
        ways = found.went[c, g]
        tries = Tries(place.pose, grasps, g, twists[c], ways, ways / speeds[c, g], found.opened[c, g])
        return self._aim.reached(tries) if len(tries) else None, tries

    def _bearable(self, twists: Array, mask: Flags, grasps: tuple[Grasp, ...]) -> Flags:
        """Say which twists (c, g) the grips have the force for."""
        rows = [(int(g), (int(c),), (1.0,)) for c, g in np.argwhere(mask)]
        commands = Commands.given(twists, self._world, self._settings)
        constraints = self._settings.constraints
        ways = WaysToMove.of(rows, commands, grasps, self._settings)
        taken = ways.efforts(self._world, grasps, constraints.torque_arm)
        bearable = np.zeros(mask.shape, dtype=bool)
        bearable[mask] = np.nan_to_num(taken[0, :, SUM], nan=np.inf) <= constraints.grip_force
        return bearable

    def _region(self, place: Place) -> shapely.Polygon | None:
        """Return the region that the robot is in when it has let go at a place; None where it is in none."""
        if not place.steps:
            return self._free.regions[self._opening.start]
        x, y = place.steps[-1].leave
        grown = self._thing.at(place.pose).buffer(self._free.radius, quad_segs=ARC)
        parts = shapely.get_parts(self._floor.difference(grown))
        return next((part for part in parts if shapely.intersects_xy(part, x, y)), None)

    def _worth(self, tries: Tries) -> list[tuple[float, Step]]:
        """Return steps to poses that are new, with how far from what is wanted they are [m]."""
        parts = tries.shared(self._settings.stops)
        poses, new = parts.ends(), []
        for k, pose in enumerate(poses):
            key = self._key(pose)
            if key not in self._seen:
                self._seen.add(key)
                new.append(k)
        if not new:
            return []
        far = self._aim.far(poses[new], self._line)
        return [(float(away), parts.step(k)) for away, k in zip(far, new, strict=True) if np.isfinite(away)]

    def _key(self, pose: Array) -> tuple[int, ...]:
        """Return a box that a pose (3,) is in, whole turns apart or not; poses in one are looked at as one."""
        x, y = (self._finer * pose[:2]).tolist()
        turn = self._finer * math.remainder(float(pose[2]), math.tau)
        half = round(self._finer * math.pi / SAME_TURN)  # boxes that half a turn has: the last is the first, too
        return round(x / SAME_PLACE), round(y / SAME_PLACE), round(turn / SAME_TURN) % (2 * half)
