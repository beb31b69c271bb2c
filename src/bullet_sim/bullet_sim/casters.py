"""Casters: a fork on a swivel joint or bolted on, a wheel on an axle; rolling resistance, bearing friction, brakes.

The wheel touches the floor as a sphere. Bullet's cylinders are polygons unless told otherwise, which costs a
rolling resistance as large as carpet, and even a true cylinder flickers between the ends of its line of contact,
which would turn the swivel; a sphere has one contact point, under the axle, and rolls about the axle alone
because the fork lets it do nothing else. What the width of the tread does (scrub torque) is added as Bullet's
spinning friction, and where the make says so less of it the faster the wheel rolls: on its own Bullet resists a turn
at full speed as much as one on the spot, and a cart that rolls round a bend carries the full scrub of all its wheels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import CasterSettings
from bullet_sim.client import BulletClient, yaw_quaternion
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]

LOAD_TIME = 0.02
"""Time constant [s] over which a wheel's load is averaged; contact forces of single steps flicker."""


@dataclass(frozen=True)
class CasterLinks:
    """Where one caster sits in its body.

    Attributes:
        name: of the caster.
        place: swivel axis (2,) [m] in the body's frame.
        swivel: joint number of the fork.
        wheel: joint number of the wheel.
        angle: swivel angle [rad] it was left at.
        locked: whether swivel and wheel are braked. Both joints are then rigid: a brake made of Bullet's motors
            creeps, by as much as 3 cm of rolling for a table's turn by 50 degrees at 60 solver sweeps.
        fixed: whether the fork is bolted on straight ahead, its axle under its place: the wheel rolls along the
            body's x and holds across it.
    """

    name: str
    place: tuple[float, float]
    swivel: int
    wheel: int
    angle: float
    locked: bool
    fixed: bool = False

    @property
    def swivels(self) -> bool:
        """Whether the fork can turn."""
        return not (self.locked or self.fixed)


@dataclass
class LinkTable:
    """The link arrays of Bullet's `createMultiBody`, filled caster by caster."""

    columns: dict[str, list] = field(
        default_factory=lambda: {
            key: []
            for key in (
                "linkMasses",
                "linkCollisionShapeIndices",
                "linkVisualShapeIndices",
                "linkPositions",
                "linkOrientations",
                "linkInertialFramePositions",
                "linkInertialFrameOrientations",
                "linkParentIndices",
                "linkJointTypes",
                "linkJointAxis",
            )
        }
    )

    def add(
        self,
        mass: float,
        shapes: tuple[int, int],
        place: Sequence[float],
        parent: int,
        axis: Sequence[float],
        *,
        turn: float = 0.0,
        rigid: bool = False,
        joint: int = bullet.JOINT_REVOLUTE,
        centre: Sequence[float] = (0, 0, 0),
    ) -> int:
        """Append one link and give its number.

        Args:
            mass: [kg].
            shapes: Bullet's numbers of the collision and the visual shape, -1 for none.
            place: (3,) [m] of the joint in the parent's frame.
            parent: number of the parent link, -1 for the base.
            axis: (3,) of the joint.
            turn: of the link against its parent about the vertical [rad].
            rigid: whether the joint does not move.
            joint: Bullet's kind of the joint otherwise.
            centre: (3,) [m] of the mass in the link's frame.
        """
        number = len(self.columns["linkMasses"])
        row = {
            "linkMasses": mass,
            "linkCollisionShapeIndices": shapes[0],
            "linkVisualShapeIndices": shapes[1],
            "linkPositions": list(place),
            "linkOrientations": yaw_quaternion(turn).tolist(),
            "linkInertialFramePositions": list(centre),
            "linkInertialFrameOrientations": [0, 0, 0, 1],
            "linkParentIndices": parent + 1,
            "linkJointTypes": bullet.JOINT_FIXED if rigid else joint,
            "linkJointAxis": list(axis),
        }
        for key, value in row.items():
            self.columns[key].append(value)
        return number


def add_caster_links(
    client: BulletClient,
    links: LinkTable,
    settings: CasterSettings,
    name: str,
    place: tuple[float, float],
    *,
    drop: float,
    angle: float,
    locked: bool,
    fixed: bool = False,
) -> CasterLinks:
    """Append fork and wheel of one caster to a body that is being put together.

    Args:
        client: the world.
        links: the body's links so far.
        settings: make of the caster.
        name: of the caster.
        place: swivel axis (2,) [m] in the body's frame.
        drop: height [m] of the body's base centre above the axle.
        angle: swivel angle [rad] it was left at; a fixed one has none.
        locked: whether it is braked.
        fixed: whether it does not swivel.
    """
    api = client.api
    rigid, angle, trail = locked or fixed, 0.0 if fixed else angle, 0.0 if fixed else settings.trail
    half_fork = [0.018, 0.018, (settings.height - settings.radius) / 2]
    fork_shape = api.createVisualShape(
        bullet.GEOM_BOX,
        halfExtents=half_fork,
        visualFramePosition=[-trail / 2, 0, half_fork[2]],
        rgbaColor=[0.25, 0.25, 0.28, 1],
    )
    wheel_shape = api.createVisualShape(
        bullet.GEOM_CYLINDER,
        radius=settings.radius,
        length=0.025,
        visualFrameOrientation=[np.sin(np.pi / 4), 0, 0, np.cos(np.pi / 4)],
        rgbaColor=[0.1, 0.1, 0.1, 1],
    )
    tread = api.createCollisionShape(bullet.GEOM_SPHERE, radius=settings.radius)
    swivel = links.add(
        settings.fork_mass,
        (-1, fork_shape),
        (*place, -drop),
        -1,
        (0, 0, 1),
        turn=angle if rigid else 0.0,
        rigid=rigid,
    )
    wheel = links.add(settings.wheel_mass, (tread, wheel_shape), (-trail, 0, 0), swivel, (0, 1, 0), rigid=locked)
    return CasterLinks(name, place, swivel, wheel, angle, locked, fixed)


class Casters:
    """The casters of one body: their friction kept up to date with the load each wheel carries.

    Attributes:
        links: the casters in the order of `loads`.
        loads: (n,) smoothed normal force [N] under each wheel.
        levers: (n,) of the rolling resistance [m] where each wheel is now.
    """

    def __init__(
        self,
        client: BulletClient,
        body: str,
        links: Sequence[CasterLinks],
        settings: CasterSettings,
        *,
        share: float,
    ) -> None:
        """Set up friction and starting angles.

        Args:
            client: the world.
            body: name of the body they carry.
            links: the casters.
            settings: their make.
            share: first guess of each wheel's load [N].
        """
        self.links = tuple(links)
        self.loads: Array = np.full(len(self.links), share)
        self.levers: Array = np.full(len(self.links), settings.rolling_resistance)
        self._client, self._body, self._settings = client, client.body(body), settings
        self._rolling = [caster for caster in self.links if not caster.locked]
        self._index = {caster.wheel: number for number, caster in enumerate(self.links)}
        self._scrub = settings.sliding_friction * settings.contact_width / 4  # lever of the torque on the spot [m]
        self._keep = float(np.exp(-client.step_time / LOAD_TIME))
        for caster in self.links:
            self._prepare(caster)

    def _prepare(self, caster: CasterLinks) -> None:
        api, settings = self._client.api, self._settings
        m, r, w = settings.wheel_mass, settings.radius, 0.025
        disc = [m / 12 * (3 * r * r + w * w), m / 2 * r * r, m / 12 * (3 * r * r + w * w)]
        fork = [settings.fork_mass / 12 * 0.0052, settings.fork_mass / 12 * 0.0052, settings.fork_mass / 12 * 0.0026]
        api.changeDynamics(self._body, caster.swivel, localInertiaDiagonal=fork)
        api.changeDynamics(
            self._body,
            caster.wheel,
            localInertiaDiagonal=disc,
            lateralFriction=settings.sliding_friction,
            rollingFriction=0,
            spinningFriction=self._scrub,
            restitution=0,
        )
        if caster.swivels:
            api.resetJointState(self._body, caster.swivel, caster.angle)
            api.setJointMotorControl2(
                self._body, caster.swivel, bullet.VELOCITY_CONTROL, targetVelocity=0, force=settings.swivel_friction
            )

    def update(self) -> None:
        """Bring friction up to date with load and motion of each wheel; call before each step."""
        self._resist_rolling()
        self._resist_turning()

    def _resist_turning(self) -> None:
        """Set each rolling wheel's scrub to what is left of it at the speed at which it rolls."""
        api, length = self._client.api, self._settings.scrub_length
        if length is None or not self._rolling:
            return
        wheels = [caster.wheel for caster in self._rolling]
        for wheel, state in zip(wheels, api.getLinkStates(self._body, wheels, computeLinkVelocity=1), strict=True):
            speed, turned = math.hypot(*state[6][:2]), length * abs(state[7][2])
            share = turned / speed if speed > turned else 1.0
            api.changeDynamics(self._body, wheel, spinningFriction=share * self._scrub)

    def _resist_rolling(self) -> None:
        """Set each rolling wheel's resistance to f times the load it carries now."""
        api = self._client.api
        seen = np.zeros(len(self.links))
        for contact in api.getContactPoints(self._body):
            link = contact[3] if contact[1] == self._body else contact[4]
            number = self._index.get(link)
            if number is not None:
                seen[number] += contact[9]
        self.loads = self._keep * self.loads + (1 - self._keep) * seen
        wheels = [caster.wheel for caster in self._rolling]
        if wheels:
            resisting = self.levers * self.loads
            torques = [float(resisting[self._index[wheel]]) for wheel in wheels]
            api.setJointMotorControlArray(
                self._body, wheels, bullet.VELOCITY_CONTROL, targetVelocities=[0.0] * len(wheels), forces=torques
            )

    def angles(self) -> Array:
        """Give the swivel angles (n,) [rad], zero where the wheel trails a body moving along its own +x."""
        states = self._client.api.getJointStates(self._body, [caster.swivel for caster in self.links])
        turned = [
            state[0] if caster.swivels else caster.angle for caster, state in zip(self.links, states, strict=True)
        ]
        return np.array(turned)

    def contacts(self) -> Array:
        """Give the points (n, 3) [m] in `world` where the wheels touch the floor."""
        states = self._client.api.getLinkStates(
            self._body, [caster.wheel for caster in self.links], computeForwardKinematics=1
        )
        return np.array([state[4] for state in states]) - [0, 0, self._settings.radius]
