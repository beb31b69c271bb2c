"""Table, items and obstacles in Bullet."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose, yaw_quaternion
from bullet_sim.quiet import bullet
from tabletop_sim.catalogue import DeskItem
from tabletop_sim.errors import TabletopError
from tabletop_sim.rubbing import Rubbing
from tabletop_sim.scene import DeskScene

Array = NDArray[np.float64]

TABLE = "table"
THICK = 0.04
"""Of the table top [m]."""
LABEL = 0.3
"""Part of an item's length, where x points to, that is lighter: a label, so that its ends can be told apart."""
LABEL_HEIGHT = 0.0005
TABLE_COLOUR, LABEL_COLOUR = (0.93, 0.92, 0.90, 1.0), (0.48, 0.48, 0.50, 1.0)
ITEM_COLOUR, OBSTACLE_COLOUR = (0.18, 0.22, 0.30, 1.0), (0.30, 0.14, 0.12, 1.0)
SIDE_FRICTION = 0.3
"""Of the ball, whose own is 1, on the sides of an item."""


class DeskWorld:
    """A desk as Bullet bodies.

    Attributes:
        scene: what was built.
    """

    def __init__(self, client: BulletClient, scene: DeskScene, rng: Generator) -> None:
        """Build it.

        Args:
            client: where.
            scene: what.
            rng: kept for draws of the physics; there are none yet.
        """
        self.scene, self._client = scene, client
        half = [scene.table.length / 2, scene.table.width / 2, THICK / 2]
        self._box(TABLE, 0.0, half, (0.0, 0.0, -THICK / 2), 0.0, TABLE_COLOUR)
        # Bullet takes the product of two frictions: what holds an item on the table is `Rubbing` alone.
        client.api.changeDynamics(client.body(TABLE), -1, lateralFriction=0.0, restitution=0)
        self._rubbing = []
        for name, item in scene.items.items():
            self._build(name, item)
            self._rubbing.append(Rubbing(client, name, item))

    def step(self) -> None:
        """Advance by one physics step."""
        for each in self._rubbing:
            each.update()
        self._client.step()

    def pose(self, name: str) -> Array:
        """Return where the middle of an item truly is, (3,) in `world` [m, rad]: for sensors and scoring only."""
        centre = np.array([*self._item(name).centre, 0.0])
        pose = self._client.centre_pose(name)
        return np.array([*pose.point(-centre)[:2], pose.yaw])

    def height(self, name: str) -> float:
        """Return how high the middle of an item is over the table [m]: far below where it fell off."""
        return float(self._client.centre_pose(name).position[2])

    def place(self, name: str, pose: Array) -> None:
        """Put an item at a pose (3,) in `world` [m, rad], at rest: what a person does between two trials."""
        item = self._item(name)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        shift = np.array([[cos, -sin], [sin, cos]]) @ np.array(item.centre)
        at = [float(pose[0] + shift[0]), float(pose[1] + shift[1]), item.height / 2]
        body = self._client.body(name)
        self._client.api.resetBasePositionAndOrientation(body, at, yaw_quaternion(float(pose[2])).tolist())
        self._client.api.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0])

    def _item(self, name: str) -> DeskItem:
        if name not in self.scene.items:
            raise TabletopError(f"item {name!r}: expected one of {', '.join(self.scene.items)}")
        return self.scene.items[name]

    def _build(self, name: str, item: DeskItem) -> None:
        x, y, theta = item.pose
        half = [item.length / 2, item.width / 2, item.height / 2]
        cos, sin = np.cos(theta), np.sin(theta)
        shift = np.array([[cos, -sin], [sin, cos]]) @ np.array(item.centre)
        at = (x + float(shift[0]), y + float(shift[1]), item.height / 2)
        colour = OBSTACLE_COLOUR if item.obstacle else ITEM_COLOUR
        body = self._box(name, item.mass, half, at, theta, colour, centre=item.centre)
        sides = np.array([item.length, item.width, item.height]) ** 2
        self._client.api.changeDynamics(
            body,
            -1,
            lateralFriction=SIDE_FRICTION,
            restitution=0,
            localInertiaDiagonal=(item.mass * (sides.sum() - sides) / 12.0).tolist(),
        )

    def _box(
        self,
        name: str,
        mass: float,
        half: list[float],
        at: tuple[float, float, float],
        theta: float,
        colour: tuple[float, ...],
        centre: tuple[float, float] = (0.0, 0.0),
    ) -> int:
        """Make a box about its centre of mass, with its label."""
        api, middle = self._client.api, [-centre[0], -centre[1], 0.0]
        label = [LABEL * half[0], half[1], LABEL_HEIGHT / 2]
        label_at = [(1.0 - LABEL) * half[0] - centre[0], -centre[1], half[2] + LABEL_HEIGHT / 2]
        parts = [(half, middle, colour)] + ([(label, label_at, LABEL_COLOUR)] if name != TABLE else [])
        visual = api.createVisualShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * len(parts),
            halfExtents=[part[0] for part in parts],
            visualFramePositions=[part[1] for part in parts],
            rgbaColors=[part[2] for part in parts],
        )
        collision = api.createCollisionShapeArray(
            shapeTypes=[bullet.GEOM_BOX], halfExtents=[half], collisionFramePositions=[middle]
        )
        pose = Pose(np.array(at), yaw_quaternion(theta))
        body = api.createMultiBody(
            baseMass=mass,
            baseCollisionShapeIndex=collision,
            baseVisualShapeIndex=visual,
            basePosition=pose.position.tolist(),
            baseOrientation=pose.quaternion.tolist(),
        )
        return self._client.add(name, body)
