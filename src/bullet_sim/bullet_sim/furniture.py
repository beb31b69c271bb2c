"""A body of the scene as it stands in Bullet: where its tag frame is, and what edge a gripper can clamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon

from bullet_sim.casters import Casters
from bullet_sim.catalogue import Body
from bullet_sim.client import BulletClient, Pose, Twist, cross
from bullet_sim.feet import Feet
from bullet_sim.fittings import Fitting
from bullet_sim.motion import BodyMotion
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slab:
    """A flat part whose edge can be clamped, in the body's tag frame.

    Attributes:
        outline: (k, 2) [m], counter-clockwise.
        top: height [m] of the upper face over the tag frame.
        bottom: height [m] of the lower face over the tag frame.
    """

    outline: Array
    top: float
    bottom: float


class Furniture:
    """One body of the scene.

    Attributes:
        name: in the scene.
        settings: what the scene says of it.
        slabs: what can be clamped.
        casters: its casters; None where it has none.
        feet: its feet that slide; None where it has none.
        fittings: what else is built into it.
    """

    def __init__(
        self,
        client: BulletClient,
        name: str,
        settings: Body,
        tag: Array,
        *,
        slabs: tuple[Slab, ...] = (),
        casters: Casters | None = None,
        fittings: Sequence[Fitting] = (),
    ) -> None:
        """Take note of a body that is in the client already; `tag` (3,) [m] is the tag in the base's own frame."""
        self.name, self.settings, self.slabs, self.casters = name, settings, slabs, casters
        self.feet: Feet | None = None
        self.fittings = tuple(fittings)
        self._client, self._tag = client, tag
        self._wedge: int | None = None

    @property
    def tag_offset(self) -> tuple[float, float, float]:
        """Where the tag is [m] in the base's own frame, whose origin is the base's centre of mass."""
        return float(self._tag[0]), float(self._tag[1]), float(self._tag[2])

    def motion(self) -> BodyMotion:
        """Give a reader of its motion in the plane."""
        return BodyMotion(self._client, self.name, self.tag_offset)

    def pose(self) -> Pose:
        """Give the pose of the tag frame: at the top of the body."""
        centre = self._client.centre_pose(self.name)
        return Pose(centre.point(self._tag), centre.quaternion)

    def twist(self) -> Twist:
        """Give the velocity of the tag frame's origin and the angular velocity."""
        return self.state()[1]

    def state(self) -> tuple[Pose, Twist]:
        """Give `pose` and `twist`, at little more than the price of one."""
        centre, motion = self._client.centre_pose(self.name), self._client.centre_twist(self.name)
        lever = centre.matrix @ self._tag
        pose = Pose(centre.position + lever, centre.quaternion)
        return pose, Twist(motion.linear + cross(motion.angular, lever), motion.angular)

    def slab_at(self, point: Array) -> Slab:
        """Give the slab in which a clamped `point` (3,) [m] of the tag frame lies, or that nearest to it."""
        middle = Point(point[:2])
        return min(self.slabs, key=lambda slab: float(Polygon(slab.outline).distance(middle)))

    def apply_force(self, force: Array, point: Array) -> None:
        """Push with `force` (3,) [N] at `point` (3,) [m], both in `world`, during the next step."""
        self._client.apply_force(self.name, -1, force, point)

    def park(self) -> None:
        """Hold it where it stands, as a wedge under a wheel does, until `unpark`; a second call does nothing."""
        if self._wedge is None:
            centre, number = self._client.centre_pose(self.name), self._client.body(self.name)
            place, turn = centre.position.tolist(), centre.quaternion.tolist()
            self._wedge = self._client.api.createConstraint(
                number, -1, -1, -1, bullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0], place, childFrameOrientation=turn
            )

    def unpark(self) -> None:
        """Let it go."""
        if self._wedge is not None:
            self._client.api.removeConstraint(self._wedge)
            self._wedge = None

    def update(self) -> None:
        """Do what has to be done before each step."""
        if self.casters is not None:
            self.casters.update()
        if self.feet is not None:
            self.feet.update()
        for fitting in self.fittings:
            fitting.update()
