"""A scene built into Bullet: floor, walls, furniture; one step at a time; the truth for whoever scores.

Step size: 1/400 s. It divides the 10 ms of the sensors, and it is where halving the step no longer changes a
pushed table's path by more than a tag's noise (see `test/bullet_sim/test_world.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.catalogue import OfficeTable, PlainTable, UtilityCart
from bullet_sim.clamp import GripperSpec
from bullet_sim.client import FLOOR, GRAVITY, BulletClient, Pose, Twist, yaw_quaternion
from bullet_sim.concealed.build import effects_of, fittings_of, let_down_glides
from bullet_sim.errors import SimError, nearest
from bullet_sim.furniture import Furniture
from bullet_sim.plain import build_plain
from bullet_sim.prisms import FIXTURE_FRICTION, build_prism
from bullet_sim.quiet import bullet
from bullet_sim.scene import Room, Scene
from bullet_sim.wheeled import build_on_casters

Array = NDArray[np.float64]

WALL_THICKNESS = 0.10
"""Of the walls [m]; they stand outside the room's outline."""


@dataclass(frozen=True)
class BodyTruth:
    """Where a body really is: for scoring, never for a topic.

    Attributes:
        position: (3,) [m] of the tag frame in `world`.
        quaternion: (4,) x y z w.
        linear: (3,) [m/s] velocity of the tag frame's origin, `world` axes.
        angular: (3,) [rad/s], `world` axes.
    """

    position: Array
    quaternion: Array
    linear: Array
    angular: Array

    @property
    def planar(self) -> Array:
        """Pose (3,) x, y, theta in `world`."""
        return np.array([self.position[0], self.position[1], Pose(self.position, self.quaternion).yaw])


class World:
    """A scene in Bullet.

    Attributes:
        client: the Bullet client.
        scene: what was built.
        furniture: the bodies by name.
        effects: what is concealed and acts while the world steps.
    """

    def __init__(self, client: BulletClient, scene: Scene, rng: Generator) -> None:
        """Build floor, walls and furniture.

        Args:
            client: an empty client.
            scene: what to build.
            rng: draws what the scene leaves to chance (how the casters were left).

        Raises:
            SimError: a body that cannot be built.
        """
        self.client, self.scene = client, scene
        _build_floor(client, scene.room)
        concealed = scene.concealed
        self._fitted = {name: fittings_of(name, body, concealed) for name, body in scene.bodies.items()}
        self.furniture: dict[str, Furniture] = {name: self._build(name, rng) for name in scene.bodies}
        for name, body in self.furniture.items():
            let_down_glides(client, body, self._fitted[name])
        self.effects = effects_of(client, self.furniture, self._fitted, concealed)

    def _build(self, name: str, rng: Generator) -> Furniture:
        settings, concealed = self.scene.bodies[name], self.scene.concealed
        mass = concealed.mass.get(name)
        fittings = [fitting for fitted in self._fitted[name].values() for fitting in fitted]
        if isinstance(settings, PlainTable):
            casters = concealed.caster_swivel.get(name)
            return build_plain(self.client, name, settings, rng, mass=mass, fittings=fittings, casters=casters)
        if not isinstance(settings, OfficeTable | UtilityCart):
            return build_prism(self.client, name, settings, mass=mass)
        lever = concealed.rolling_resistance.get(name)
        if lever is not None:
            make = settings.casters.model_copy(update={"rolling_resistance": lever})
            settings = settings.model_copy(update={"casters": make})
        locked, fixed = concealed.locked_casters.get(name, ()), concealed.fixed_wheels.get(name, ())
        return build_on_casters(
            self.client, name, settings, rng, mass=mass, locked=locked, fixed=fixed, fittings=fittings
        )

    def step(self) -> None:
        """Advance by one physics step; forces applied since the last step act during this one."""
        for body in self.furniture.values():
            body.update()
        for effect in self.effects:
            effect.update(self.client.time)
        self.client.step()

    def find(self, name: str) -> Furniture:
        """Give a body of the scene by name; raise SimError for a name unknown."""
        if name not in self.furniture:
            raise SimError(f"body {name!r} is not in the scene; {nearest(name, self.furniture)}")
        return self.furniture[name]

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of fall (3,) [m/s^2] in `world`: straight down, unless the floor slopes."""
        slope = self.scene.concealed.floor_slope
        return (0.0, 0.0, -GRAVITY) if slope is None else slope.gravity

    def plates(self, spec: GripperSpec, body: str) -> GripperSpec:
        """Give a gripper's plates as they really are on a body."""
        worn = self.scene.concealed.grasp_compliance.get(body)
        return spec if worn is None else worn.worn(spec)

    def pose(self, name: str) -> Pose:
        """Give the pose of a body's tag frame."""
        return self.find(name).pose()

    def twist(self, name: str) -> Twist:
        """Give the velocity of a body's tag frame."""
        return self.find(name).twist()

    def truth(self, name: str) -> BodyTruth:
        """Give a body's true pose and velocity, for scoring only."""
        pose, twist = self.pose(name), self.twist(name)
        return BodyTruth(pose.position, pose.quaternion, twist.linear, twist.angular)


def _build_floor(client: BulletClient, room: Room) -> None:
    """Make an endless floor and, along the room's outline, walls."""
    api = client.api
    ground = api.createCollisionShape(bullet.GEOM_PLANE)
    outline = np.array(room.outline)
    span, middle = np.ptp(outline, axis=0) / 2 + WALL_THICKNESS, (outline.max(axis=0) + outline.min(axis=0)) / 2
    look = api.createVisualShape(
        bullet.GEOM_BOX,
        halfExtents=[*span, 0.01],
        visualFramePosition=[*middle, -0.01],
        rgbaColor=[0.86, 0.85, 0.82, 1],
    )
    floor = api.createMultiBody(baseMass=0, baseCollisionShapeIndex=ground, baseVisualShapeIndex=look)
    client.add(FLOOR, floor)
    api.changeDynamics(floor, -1, lateralFriction=room.floor_friction, rollingFriction=0, restitution=0)
    for number, (start, end) in enumerate(zip(outline, np.roll(outline, -1, axis=0), strict=True)):
        _build_wall(client, f"wall_{number}", start, end, room.wall_height)


def _build_wall(client: BulletClient, name: str, start: Array, end: Array, height: float) -> None:
    """Make one wall, outside the edge from `start` to `end` of a counter-clockwise outline."""
    along = end - start
    length = float(np.hypot(*along))
    outward = np.array([along[1], -along[0]]) / length
    half = [length / 2 + WALL_THICKNESS, WALL_THICKNESS / 2, height / 2]
    place = [*((start + end) / 2 + outward * WALL_THICKNESS / 2), height / 2]
    body = client.api.createMultiBody(
        baseMass=0,
        baseCollisionShapeIndex=client.api.createCollisionShape(bullet.GEOM_BOX, halfExtents=half),
        baseVisualShapeIndex=client.api.createVisualShape(
            bullet.GEOM_BOX, halfExtents=half, rgbaColor=[0.93, 0.92, 0.88, 1]
        ),
        basePosition=place,
        baseOrientation=yaw_quaternion(float(np.arctan2(along[1], along[0]))).tolist(),
    )
    client.add(name, body)
    client.api.changeDynamics(body, -1, lateralFriction=FIXTURE_FRICTION, restitution=0)
