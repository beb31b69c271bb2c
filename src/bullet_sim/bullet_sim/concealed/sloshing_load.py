"""Sloshing load: a mass that swings on a rod or slides between stops inside a body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bullet_sim.casters import LinkTable
from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.quiet import bullet
from bullet_sim.settings import Fraction, Positive, Settings, Vector2

Array = NDArray[np.float64]

CROSS_MASS, CROSS_INERTIA = 0.05, 1e-4
"""Mass [kg] and inertia [kg m^2] of the cross piece in the pendulum's universal joint."""

STOP_STIFFNESS, STOP_DAMPING = 2.0e4, 150.0
"""Of the stops at the ends of a slide [N/m], [N s/m]."""


class SloshingLoadSettings(Settings):
    """A load that is part of what the body weighs, and moves.

    Attributes:
        motion: "swing": a bob on a rod that hangs in a universal joint; "slide": a block on a rail between springs.
        mass: of the load [kg].
        place: (x, y) [m] in the body's frame where it rests.
        length: of the rod [m], from joint to bob.
        height: of the rod's joint, or of the rail, over the floor [m].
        heading: of the rail in the body's frame [rad].
        frequency: of the block between its springs [Hz]; a pendulum has that of its length.
        travel: of the block either way, to the stops [m].
        damping_ratio: of the motion.
    """

    motion: Literal["swing", "slide"] = "swing"
    mass: Positive = 8.0
    place: Vector2 = (0.0, 0.0)
    length: Positive = 0.30
    height: Positive = 0.60
    heading: float = 0.0
    frequency: Positive = 1.0
    travel: Positive = 0.15
    damping_ratio: Fraction = 0.05


class SlidingLoad:
    """A block on a rail: a prismatic joint with springs and stops; see `fittings.Fitting`."""

    light = False

    def __init__(self, settings: SloshingLoadSettings) -> None:
        """Describe it."""
        self.mass, self.place, self._settings = settings.mass, settings.place, settings
        self._stiffness = self.mass * (2 * math.pi * settings.frequency) ** 2
        self._damping = 2 * settings.damping_ratio * math.sqrt(self._stiffness * self.mass)
        self.away = 0.0

    def fit(self, client: BulletClient, links: LinkTable, centre: Array) -> None:
        """Append rail and block."""
        where = [self.place[0] - centre[0], self.place[1] - centre[1], self._settings.height - centre[2]]
        self._joint = links.add(
            self.mass, (-1, -1), where, -1, (1, 0, 0), turn=self._settings.heading, joint=bullet.JOINT_PRISMATIC
        )

    def ready(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Free the joint."""
        self._api, self._body = client.api, client.body(body)
        self._api.changeDynamics(self._body, self._joint, localInertiaDiagonal=[self.mass * 0.005] * 3)
        self._api.setJointMotorControl2(self._body, self._joint, bullet.VELOCITY_CONTROL, force=0)

    def update(self) -> None:
        """Let springs, damper and stops act."""
        self.away, speed = self._api.getJointState(self._body, self._joint)[:2]
        force = -self._stiffness * self.away - self._damping * speed
        over = abs(self.away) - self._settings.travel
        if over > 0:
            force -= math.copysign(STOP_STIFFNESS * over, self.away) + STOP_DAMPING * speed
        self._api.setJointMotorControl2(self._body, self._joint, bullet.TORQUE_CONTROL, force=force)


class SwingingLoad:
    """A bob on a rod: two revolute joints that cross, gravity does the rest; see `fittings.Fitting`."""

    light = False

    def __init__(self, settings: SloshingLoadSettings) -> None:
        """Describe it."""
        self.mass, self.place, self._settings = settings.mass, settings.place, settings
        natural = math.sqrt(GRAVITY / settings.length)
        self._damping = 2 * settings.damping_ratio * natural * self.mass * settings.length**2
        self.away = 0.0

    def fit(self, client: BulletClient, links: LinkTable, centre: Array) -> None:
        """Append cross piece and bob."""
        where = [self.place[0] - centre[0], self.place[1] - centre[1], self._settings.height - centre[2]]
        cross = links.add(CROSS_MASS, (-1, -1), where, -1, (1, 0, 0))
        bob = links.add(
            self.mass - CROSS_MASS, (-1, -1), (0, 0, 0), cross, (0, 1, 0), centre=(0, 0, -self._settings.length)
        )
        self._joints = [cross, bob]

    def ready(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Free the joints."""
        self._api, self._body = client.api, client.body(body)
        for joint, inertia in zip(self._joints, (CROSS_INERTIA, self.mass * 0.002), strict=True):
            self._api.changeDynamics(self._body, joint, localInertiaDiagonal=[inertia] * 3)
            self._api.setJointMotorControl2(self._body, joint, bullet.VELOCITY_CONTROL, force=0)

    def update(self) -> None:
        """Let the joints' friction act."""
        states = self._api.getJointStates(self._body, self._joints)
        self.away = self._settings.length * math.sin(min(math.pi / 2, math.hypot(states[0][0], states[1][0])))
        forces = [-self._damping * state[1] for state in states]
        self._api.setJointMotorControlArray(self._body, self._joints, bullet.TORQUE_CONTROL, forces=forces)


def sloshing_load(settings: SloshingLoadSettings) -> SlidingLoad | SwingingLoad:
    """Make the load that the settings ask for."""
    return SlidingLoad(settings) if settings.motion == "slide" else SwingingLoad(settings)


class SloshingLoad(Effect):
    """How far the load has gone from where it rests."""

    name, unit = "sloshing_load", "m"

    def __init__(self, body: Furniture, load: SlidingLoad | SwingingLoad) -> None:
        """Watch a load that is built in."""
        super().__init__(body.name)
        self._load = load

    def strength(self) -> float:
        """Give the way [m]."""
        return abs(self._load.away)

    def acting(self) -> bool:
        """Tell whether it is a millimetre off."""
        return self.strength() > 1e-3
