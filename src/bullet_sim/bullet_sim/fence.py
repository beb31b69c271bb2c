"""The last fence: what may not be entered is not, whatever a robot is told. It knows the braking distance.

Every 10 ms each part of the robot and of what it holds is looked at where it is and where it would come to rest if it
braked now. What would come too near is stopped; from rest, only what leads away is begun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture
from bullet_sim.motion import BodyMotion
from bullet_sim.quiet import bullet
from bullet_sim.scene import Scene

Array = NDArray[np.float64]

CLEAR = 0.03
"""Nearest that anything comes to the fence [m]: rubber between plates and load gives way by as much at most."""
NEAR = 0.02
"""Beyond that, within which arms rest and the base begins only what leads away [m]."""
STOPPING = 0.12
"""[s] for which a part goes on at its speed, as far as it then comes while it brakes: half of the 0.2 s that base and
arms take at most, see each robot's `BRAKING`, and two looks."""
REACH = 2.5
"""[m] from the base, beyond which there is no part of the robot nor of what it holds."""
START_CLEAR = 0.1
"""[m] from what is kept out of, at the start."""
LOOK = 0.01
"""[s] between two looks."""
NOISE = 1e-5
"""[m] of a distance that a look may be off."""


@dataclass(frozen=True)
class Verdict:
    """What may be done of what is commanded.

    Attributes:
        base: whether the base may.
        joints: whether arms, waist and torso may.
    """

    base: bool = True
    joints: bool = True


class Robot(Protocol):
    """A robot in the world."""

    @property
    def number(self) -> int:
        """Bullet's number of it."""
        ...

    def base_pose(self) -> Pose:
        """Return the true pose of `base` in `world`."""
        ...


class Fence:
    """Polygons that nothing may enter.

    Args:
        client: the world.
        robot: in it.
        scene: with the polygons, and what can be held.
        furniture: that, by name.
        load_stopping: time for which what is held goes on at its speed, as far as it then comes [s]: longer than that
            of the robot's own parts where arms give.

    Raises:
        SimError: the robot reaches into one of them.
    """

    def __init__(
        self,
        client: BulletClient,
        robot: Robot,
        scene: Scene,
        furniture: Mapping[str, Furniture],
        load_stopping: float = STOPPING,
    ) -> None:
        self._api, self._robot, self._load_stopping = client.api, robot, load_stopping
        self._region = shapely.union_all([shapely.Polygon(corners) for corners in scene.keep_out])
        shapely.prepare(self._region)
        parts = [part for link in (-1, *self._links()) for part in self._corners(link)]
        self._links_of = np.array([link for link, _ in parts])
        self._boxes = np.array([corners for _, corners in parts])
        self._motions: Mapping[str, BodyMotion] = {name: body.motion() for name, body in furniture.items()}
        self._footprints: Mapping[str, Array] = {name: scene.bodies[name].footprint for name in furniture}
        if (near := self.distance(())) < START_CLEAR:
            raise SimError(
                f"keep_out: expected a robot that starts {START_CLEAR} m off at least, got {near:.2f} m; its pose is "
                f"{list(scene.robot.pose)}"
            )

    def distance(self, held: Sequence[str]) -> float:
        """Return how far robot and load are from the fence now [m]: for scoring too."""
        places, _, _ = self._look(held)
        return float(shapely.distance(_hulls(places), self._region).min())

    def allow(self, base: Array, held: Sequence[str]) -> Verdict:
        """Say what may be done now.

        Args:
            base: (3,) commanded speeds forward and to the left [m/s] and rate of turning left [rad/s].
            held: names of what is held.
        """
        pose = self._robot.base_pose()
        if self._region.distance(shapely.Point(pose.position[:2])) > REACH:
            return Verdict()
        places, speeds, stopping = self._look(held)
        here = shapely.distance(_hulls(places), self._region)
        if self._leads_in(places, stopping * speeds, here, CLEAR):
            return Verdict(False, False)
        if here.min() > CLEAR + NEAR:
            return Verdict()
        ahead = np.array([np.cos(pose.yaw), np.sin(pose.yaw)])
        aside = np.array([-ahead[1], ahead[0]])
        around = places - pose.position[:2]
        turned = np.stack((-around[..., 1], around[..., 0]), axis=-1)
        wanted = base[0] * ahead + base[1] * aside + base[2] * turned
        return Verdict(not self._leads_in(places, stopping * wanted, here, CLEAR + NEAR), False)

    def _leads_in(self, places: Array, way: Array, here: Array, clear: float) -> bool:
        """Tell whether any part comes nearer than it is, and too near, on its way (n, k, 2) to rest [m]."""
        after = places + way
        there = shapely.distance(_hulls(after), self._region)
        passing = shapely.distance(_hulls(np.concatenate((places, after), axis=1)), self._region)
        return bool(((passing < clear) & (there < here - NOISE)).any())

    def _look(self, held: Sequence[str]) -> tuple[Array, Array, Array]:
        """Return corners of all parts in `world` [m], their velocities [m/s], and for how long each part goes on [s].

        Returns:
            (n, k, 2), (n, k, 2) and (n, 1, 1), k that of the part with most; what is held comes last.
        """
        position, turn, linear, angular = (each[self._links_of] for each in self._states())  # base: the last row
        arms = np.einsum("nij,nkj->nki", turn, self._boxes)
        places = (position[:, None] + arms)[..., :2]
        wx, wy, wz = angular[:, None].transpose(2, 0, 1)
        speeds = linear[:, None, :2] + np.stack(
            (wy * arms[..., 2] - wz * arms[..., 1], wz * arms[..., 0] - wx * arms[..., 2]), axis=-1
        )
        for name in set(held):
            motion = self._motions[name]
            motion.look()
            points = np.array([motion.point(corner) for corner in self._footprints[name]])
            places, speeds = _beside(places, points), _beside(speeds, np.array([*map(motion.speed_at, points)]))
        stopping = np.full((len(places), 1, 1), STOPPING)
        stopping[len(arms) :] = self._load_stopping
        return places, speeds, stopping

    def _states(self) -> tuple[Array, Array, Array, Array]:
        """Return position, rotation, velocity and angular velocity of every link's centre of mass, the base's last."""
        number = self._robot.number
        found = self._api.getLinkStates(number, self._links(), computeLinkVelocity=1)
        rows = [(state[0], state[1], state[6], state[7]) for state in found]
        rows.append((*self._api.getBasePositionAndOrientation(number), *self._api.getBaseVelocity(number)))
        position, quaternion, linear, angular = (np.array(column) for column in zip(*rows, strict=True))
        turn = np.array([self._api.getMatrixFromQuaternion(each) for each in quaternion]).reshape(-1, 3, 3)
        return position, turn, linear, angular

    def _links(self) -> list[int]:
        return list(range(self._api.getNumJoints(self._robot.number)))

    def _corners(self, link: int) -> list[tuple[int, Array]]:
        """Return the corners (8, 3) of a box about each collision shape of a link, from its centre of mass [m]."""
        found = []
        for _, _, kind, size, _, position, quaternion in self._api.getCollisionShapeData(self._robot.number, link):
            if kind == bullet.GEOM_BOX:
                half = 0.5 * np.array(size)
            elif kind == bullet.GEOM_SPHERE:
                half = np.full(3, size[0])
            else:  # cylinder: length, radius
                half = np.array([size[1], size[1], 0.5 * size[0]])
            signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            turn = np.reshape(self._api.getMatrixFromQuaternion(quaternion), (3, 3))
            found.append((link, (signs * half) @ turn.T + np.array(position)))
        return found


class Watch:
    """What a fence allows, looked at anew each `LOOK` seconds.

    Args:
        fence: None: there is nothing that may not be entered.
    """

    def __init__(self, fence: Fence | None) -> None:
        self._fence, self._allowed, self._looked = fence, Verdict(), -1.0

    def allowed(self, now: float, base: Array, held: Sequence[str]) -> Verdict:
        """Return what may be done at a time [s]; see `Fence.allow`."""
        if self._fence is not None and now - self._looked >= LOOK - 1e-9:
            self._looked = now
            self._allowed = self._fence.allow(base, held)
        return self._allowed

    @property
    def halted(self) -> str:
        """Say that the fence holds the robot back, in a sentence; empty where it does not."""
        if self._allowed.base and self._allowed.joints:
            return ""
        what = "arms are" if self._allowed.base else "the robot is"
        return f"fence: {what} held back at a place that is kept out of; command what leads away"


def _beside(rows: Array, points: Array) -> Array:
    """Return rows (n, k, 2) and one more of points (m, 2), filled up: a corner that is there twice changes no hull."""
    most = max(rows.shape[1], len(points))
    wide = np.concatenate((rows, np.repeat(rows[:, :1], most - rows.shape[1], axis=1)), axis=1)
    last = np.concatenate((points, np.repeat(points[:1], most - len(points), axis=0)))
    return np.concatenate((wide, last[None]))


def _hulls(places: Array) -> NDArray[np.object_]:
    """Return the convex hull of each row of points (n, k, 2)."""
    return shapely.convex_hull(shapely.multipoints(places))
