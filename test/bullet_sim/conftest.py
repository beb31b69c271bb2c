"""Worlds to push things in, and a hand that pushes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bullet_sim.client import STEP, BulletClient
from bullet_sim.quiet import bullet
from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from bullet_sim.world import World

Array = NDArray[np.float64]
HALL = [[-8, -8], [8, -8], [8, 8], [-8, 8]]
TABLE = {
    "kind": "office_table",
    "size": [0.75, 1.5],
    "height": 0.7775,
    "nominal_mass": 33.0,
    "pose": [0, 0, 0],
}


def make_scene(bodies: dict[str, Any] | None = None, **keys: Any) -> Scene:
    """A hall with table_a at its middle, or with other bodies."""
    plain = {"room": {"outline": HALL}, "robot": {"pose": [-5, 0, 0]}, "bodies": bodies or {"table_a": TABLE}, **keys}
    return parse_settings(plain, Scene, "test.yaml")


class Hand:
    """A gripper on a rail along world x, with a wrist that turns about the vertical; approach is +x."""

    def __init__(self, world: World, tip: tuple[float, float, float]) -> None:
        self._world = world
        start = [tip[0] - 0.217, tip[1], tip[2]]
        client = world.client
        body = client.api.createMultiBody(
            baseMass=0,
            basePosition=start,
            baseOrientation=[0, 0, -np.sqrt(0.5), np.sqrt(0.5)],
            linkMasses=[5.0, 1.8],
            linkCollisionShapeIndices=[-1, -1],
            linkVisualShapeIndices=[-1, -1],
            linkPositions=[[0, 0, 0]] * 2,
            linkOrientations=[[0, 0, 0, 1]] * 2,
            linkInertialFramePositions=[[0, 0, 0]] * 2,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 2,
            linkParentIndices=[0, 1],
            linkJointTypes=[bullet.JOINT_PRISMATIC, bullet.JOINT_REVOLUTE],
            linkJointAxis=[[0, 1, 0], [0, 0, 1]],
        )
        self.body = client.add("hand", body)
        for link in (0, 1):
            client.api.changeDynamics(body, link, localInertiaDiagonal=[0.02, 0.02, 0.02])
        self.move(0.0)
        self.turn(0.0)

    @property
    def link(self) -> tuple[str, int]:
        return "hand", 1

    @property
    def travel(self) -> float:
        return float(self._world.client.api.getJointState(self.body, 0)[0])

    def move(self, speed: float, force: float = 2000.0) -> None:
        """Drive the rail at a speed [m/s]."""
        self._motor(0, speed, force)

    def turn(self, speed: float, torque: float = 200.0) -> None:
        """Drive the wrist at a speed [rad/s]."""
        self._motor(1, speed, torque)

    def _motor(self, joint: int, speed: float, force: float) -> None:
        self._world.client.api.setJointMotorControl2(
            self.body, joint, bullet.VELOCITY_CONTROL, targetVelocity=speed, force=force
        )


class Lab:
    """Builds worlds and does to them what most tests need; closes them in the end."""

    scene = staticmethod(make_scene)
    hand = Hand
    table = TABLE

    def __init__(self) -> None:
        self._clients: list[BulletClient] = []

    def world(self, scene: Scene | None = None, *, seed: int = 0, step: float = STEP) -> World:
        """A world of a scene, by default the free table in a hall."""
        self._clients.append(BulletClient(step=step))
        return World(self._clients[-1], scene or make_scene(), np.random.default_rng(seed))

    @staticmethod
    def run(world: World, seconds: float, before: Callable[[], object] = lambda: None) -> None:
        """Step for a time, doing something before each step."""
        for _ in range(round(seconds / world.client.step_time)):
            before()
            world.step()

    @staticmethod
    def align(world: World, name: str = "table_a", angle: float = 0.0) -> None:
        """Turn all casters that can turn to one angle."""
        casters = world.find(name).casters
        assert casters is not None
        for caster in casters.links:
            if not caster.locked:
                world.client.api.resetJointState(world.client.body(name), caster.swivel, angle)

    def close(self) -> None:
        for client in self._clients:
            client.close()


@pytest.fixture
def lab() -> Iterator[Lab]:
    made = Lab()
    yield made
    made.close()
