"""What is built into a body besides its own parts: struts with a wheel or a glide, loads; and how it is measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bullet_sim.casters import LinkTable
from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.feet import RubberFoot
from bullet_sim.motion import BodyMotion
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]

STRUT_MASS, TIP_MASS = 0.05, 0.10
"""Mass [kg] of a strut and of the wheel or ball under it: little, so that a body is as heavy where it is as before.

The wheel is a hoop. Bullet solves friction in two fixed directions by sweeps; a wheel that is much easier to roll than
its body is to shift aside makes them converge slowly, and it creeps, see `client.SOLVED`.
"""


POST = 0.30
"""Length [m] of what is seen of a strut."""


class Fitting(Protocol):
    """Something that becomes links of a body when that is built.

    Attributes:
        mass: of all its links [kg], taken from the mass of the body.
        place: (2,) [m] in the body's frame, where that mass is.
        light: whether the body is balanced as if it were not there; a load is not light.
    """

    mass: float
    place: tuple[float, float]
    light: bool

    def fit(self, client: BulletClient, links: LinkTable, centre: Array) -> None:
        """Append its links; `centre` (3,) [m] is the base's centre of mass over the floor, in the body's axes."""

    def ready(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Take note of the body that has been built, with its tag at (3,) [m] of the base; set motors and friction."""

    def update(self) -> None:
        """Do what has to be done before each step."""


class Strut:
    """A leg that a spring of constant force presses on the floor: with a wheel under it, or a ball that slides.

    As under a hospital bed, where such a fifth wheel is let down to steer. The force is constant, so that how hard the
    floor holds the wheel does not depend on how the body is tilted by its push.

    Attributes:
        load: with which it bears on the floor [N], its own weight included.
        lever: of its own rolling resistance [m].
        tip: link number of wheel or ball once it is built.
    """

    light = True
    mass = STRUT_MASS + TIP_MASS

    def __init__(
        self,
        place: tuple[float, float],
        load: float,
        *,
        friction: float,
        radius: float,
        heading: float | None = None,
        lever: float = 0.0,
    ) -> None:
        """Describe a strut.

        Args:
            place: (2,) [m] in the body's frame.
            load: on the floor [N].
            friction: Coulomb coefficient of its tread on a floor of friction 1.
            radius: of wheel or ball [m].
            heading: direction in which the wheel rolls, in the body's frame [rad]; None: it does not roll.
            lever: of the rolling resistance [m].
        """
        self.place, self.load, self.lever, self.tip = place, load, lever, -1
        self._friction, self._radius, self._heading = friction, radius, heading
        self._press = load - self.mass * GRAVITY
        self._leg = -1
        self._sliding: tuple[BodyMotion, RubberFoot] | None = None
        self._limit = self._rubbed = 0.0

    @property
    def rolls(self) -> bool:
        """Whether there is a wheel under it."""
        return self._heading is not None

    def fit(self, client: BulletClient, links: LinkTable, centre: Array) -> None:
        """Append leg and tip; see `Fitting`."""
        api = client.api
        where = [self.place[0] - centre[0], self.place[1] - centre[1], self._radius - centre[2]]
        tread = api.createCollisionShape(bullet.GEOM_SPHERE, radius=self._radius)
        look = api.createVisualShape(bullet.GEOM_SPHERE, radius=self._radius, rgbaColor=[0.15, 0.15, 0.18, 1])
        post = api.createVisualShape(
            bullet.GEOM_BOX,
            halfExtents=[0.012, 0.012, POST / 2],
            visualFramePosition=[0, 0, POST / 2],
            rgbaColor=[0.3, 0.32, 0.35, 1],
        )
        turn = 0.0 if self._heading is None else self._heading
        self._leg = links.add(STRUT_MASS, (-1, post), where, -1, (0, 0, 1), turn=turn, joint=bullet.JOINT_PRISMATIC)
        self.tip = links.add(TIP_MASS, (tread, look), (0, 0, 0), self._leg, (0, 1, 0), rigid=self._heading is None)

    def ready(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Set friction and axle brake; see `Fitting`."""
        self._client, self._number = client, client.body(body)
        api, inertia = client.api, [TIP_MASS * self._radius**2] * 3
        api.changeDynamics(self._number, self._leg, localInertiaDiagonal=inertia)
        api.changeDynamics(
            self._number,
            self.tip,
            localInertiaDiagonal=inertia,
            lateralFriction=self._friction if self.rolls else 0.0,
            rollingFriction=0,
            spinningFriction=0,
            restitution=0,
        )
        api.setJointMotorControl2(self._number, self._leg, bullet.VELOCITY_CONTROL, force=0)
        if self.rolls:
            self.set_lever(self.lever)
        elif self._friction > 0:
            self._sliding = BodyMotion(client, body, tag), RubberFoot(client.step_time)
            self._limit = self._friction * client.floor_friction * self.load

    def set_lever(self, lever: float) -> None:
        """Brake the axle with the torque that a rolling resistance of `lever` [m] makes."""
        api = self._client.api
        api.setJointMotorControl2(
            self._number, self.tip, bullet.VELOCITY_CONTROL, targetVelocity=0, force=lever * self.load
        )

    def update(self) -> None:
        """Press, and slide where there is no wheel; see `Fitting`."""
        self._client.api.setJointMotorControl2(self._number, self._leg, bullet.TORQUE_CONTROL, force=-self._press)
        if self._sliding is None:
            return
        motion, rubber = self._sliding
        motion.look()
        x, y = motion.point(self.place)
        force_x, force_y = rubber.force(*motion.speed_at((x, y)), self._limit)
        self._rubbed = math.hypot(force_x, force_y)
        motion.push((force_x, force_y, 0.0), (x, y, 0.0))

    def friction_force(self) -> float:
        """Give the friction [N] between floor and tip in the last step."""
        return contact_friction(self._client, self._number, self.tip) if self.rolls else self._rubbed


def contact_friction(client: BulletClient, body: int, link: int) -> float:
    """Give the magnitude [N] of the friction that a link felt in the last step."""
    total = np.zeros(3)
    for contact in client.api.getContactPoints(bodyA=body, linkIndexA=link):
        total += contact[10] * np.array(contact[11]) + contact[12] * np.array(contact[13])
    return math.sqrt(float(total @ total))
