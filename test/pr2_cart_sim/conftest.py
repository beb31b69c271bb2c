"""The PR2 in small scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from bullet_sim.client import BulletClient
from bullet_sim.quiet import bullet
from pr2_cart_sim.observations import Observation
from pr2_cart_sim.postures import posture
from pr2_cart_sim.robot import PR2
from pr2_cart_sim.scene import OfficeScene
from pr2_cart_sim.session import Pr2Session


class Stage:
    """A robot on a floor, and how to let time pass."""

    def __init__(self, name: str = "edge_grasp", start: tuple[float, float, float] = (1.0, 2.0, 0.5)) -> None:
        self.client = BulletClient()
        ground = self.client.api.createCollisionShape(bullet.GEOM_PLANE)
        self.client.add("floor", self.client.api.createMultiBody(0, ground))
        self.robot = PR2(self.client, start, posture(name))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.client.step_time)):
            self.robot.drive()
            self.client.step()


@pytest.fixture
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.client.close()


CART = {
    "kind": "utility_cart",
    "size": [1.0, 0.55],
    "height": 0.90,
    "nominal_mass": 25.0,
    "pose": [1.134, 0.0, 0.0],
}
ROOM = {"outline": [[-3.0, -3.0], [6.0, -3.0], [6.0, 3.0], [-3.0, 3.0]]}
FEW_BEAMS = {"base_laser": {"increment": 0.05}, "tilt_laser": {"increment": 0.05}}


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., OfficeScene]:
    """Make a scene with a cart in the robot's hands; keyword arguments replace or add sections."""

    def make(**sections: Any) -> OfficeScene:
        robot = {"torso": 0.244, "holds": "cart"} if "cart" in sections.get("bodies", {"cart": None}) else {}
        whole = {"room": ROOM, "bodies": {"cart": CART}, "robot": robot, "sensors": FEW_BEAMS}
        return OfficeScene.model_validate(whole | sections)

    return make


@pytest.fixture
def make_session() -> Iterator[Callable[..., Pr2Session]]:
    """Open sessions that are closed after the test."""
    opened: list[Pr2Session] = []

    def make(scene: OfficeScene, seed: int = 1, **options: Any) -> Pr2Session:
        opened.append(Pr2Session(scene, seed=seed, **options))
        return opened[-1]

    yield make
    for session in opened:
        session.close()


def let_run(session: Pr2Session, seconds: float, command: Callable[[], None] | None = None) -> list[Observation]:
    """Step a session; `command` is called before each step."""
    seen: list[Observation] = []
    until = session.time + seconds - 1e-9
    while session.time < until:
        if command:
            command()
        seen += session.step()
    return seen


@pytest.fixture(scope="session")
def run() -> Callable[..., list[Observation]]:
    return let_run
