"""Krang alone on an endless floor, and small scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from bullet_sim.client import BulletClient
from bullet_sim.quiet import bullet
from bullet_sim.scene import Scene
from krang_sim.postures import posture
from krang_sim.robot import Krang
from krang_sim.session import KrangSession


class Stage:
    """A robot on a floor, and how to let time pass."""

    def __init__(self, name: str) -> None:
        self.client = BulletClient()
        ground = self.client.api.createCollisionShape(bullet.GEOM_PLANE)
        floor = self.client.add("floor", self.client.api.createMultiBody(0, ground))
        self.client.api.changeDynamics(floor, -1, lateralFriction=1.0)
        self.robot = Krang(self.client, (0, 0, 0), posture(name))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.client.step_time)):
            self.robot.drive()
            self.client.step()


@pytest.fixture
def stage() -> Iterator[Stage]:
    made = Stage("square_table_push")
    yield made
    made.client.close()


@pytest.fixture
def stages() -> Iterator[type[Stage]]:
    """The class itself, for tests over several postures."""
    yield Stage


TABLE = {
    "kind": "office_table",
    "size": [0.75, 1.5],
    "height": 0.7775,
    "nominal_mass": 33.0,
    "pose": [1.19, -0.25, 0.0],
}
ROOM = {"outline": [[-3.0, -3.0], [5.0, -3.0], [5.0, 3.0], [-3.0, 3.0]]}


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    """Make a scene with one table in front of the robot; keyword arguments replace or add sections."""

    def make(**sections: Any) -> Scene:
        return Scene.model_validate({"room": ROOM, "bodies": {"desk": TABLE}} | sections)

    return make


@pytest.fixture
def near_scene(make_scene: Callable[..., Scene]) -> Scene:
    """The table's edge is between the plates already."""
    return make_scene(bodies={"desk": TABLE | {"pose": [1.0, -0.25, 0.0]}})


@pytest.fixture
def make_session() -> Iterator[Callable[..., KrangSession]]:
    """Open sessions that are closed after the test."""
    opened: list[KrangSession] = []

    def make(scene: Scene, seed: int = 1) -> KrangSession:
        opened.append(KrangSession(scene, seed=seed))
        return opened[-1]

    yield make
    for session in opened:
        session.close()
