"""An office in Bullet: what any scene has, the walls of a map, the robot, people."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import BulletClient
from bullet_sim.errors import SimError
from bullet_sim.prisms import FIXTURE_FRICTION
from bullet_sim.quiet import bullet
from bullet_sim.world import World
from pr2_cart_sim.description import NAME
from pr2_cart_sim.lasers import mark_robot
from pr2_cart_sim.maps import GridMap, load_map
from pr2_cart_sim.people import Crowd, Lead
from pr2_cart_sim.postures import posture
from pr2_cart_sim.proximity import Proximity
from pr2_cart_sim.robot import PR2
from pr2_cart_sim.scene import OfficeScene

Array = NDArray[np.float64]

OVERLAP = 0.005
"""[m] A body that reaches further than this into the robot stands in its place."""
CLEARANCE_EVERY = 0.1
"""[s] between two looks at how near furniture and walls are."""


class Office:
    """Everything that there is.

    Attributes:
        world: floor and furniture.
        robot: the PR2.
        grid: the map; None where the scene has none.
        crowd: the people.
        proximity: what robot and cart came near to.
        cart: name of the body that the robot is to push; None where there is none.
    """

    def __init__(self, client: BulletClient, scene: OfficeScene, rng: Generator) -> None:
        """Build it.

        Args:
            client: an empty client.
            scene: what to build.
            rng: draws what the scene leaves to chance.

        Raises:
            SimError: something that cannot be built, or that stands where the robot does.
        """
        world_rng, people_rng = rng.spawn(2)
        self._client, self._scene = client, scene
        self.world = World(client, scene.furnished(), world_rng)
        self.grid: GridMap | None = None
        if scene.map is not None:
            self.grid = load_map(Path(scene.map))
            build_walls(client, self.grid, scene.wall_height)
        start = posture(scene.robot.posture).at(scene.robot.torso)
        self.robot = PR2(client, scene.robot.pose, start)
        mark_robot(client)
        self._check_start()
        self.cart = scene.robot.holds or next((name for name, body in scene.bodies.items() if _is_cart(body)), None)
        self._cart_reach = 0.0
        if self.cart is not None:
            self._cart_reach = float(np.abs(self.world.find(self.cart).settings.footprint).max())
        margin = scene.manners.margin
        taken = [(*scene.robot.pose[:2], 0.9 + margin)]
        if self.cart is not None:
            taken.append((*scene.bodies[self.cart].pose[:2], 0.9 + margin))
        self.crowd = Crowd(client, scene.people, scene.manners, people_rng, taken)
        movers = {"robot": NAME} | ({self.cart: self.cart} if self.cart else {})
        self.proximity = Proximity(client, movers, scene.people)
        self._ticks = 0

    def _check_start(self) -> None:
        """Raise SimError where furniture or a wall reaches into the robot."""
        api, told = self._client.api, list(self._scene.robot.pose)
        for name, number in self._client.bodies.items():
            if name in (NAME, "floor"):
                continue
            near = api.getClosestPoints(self.robot.number, number, 0.0)
            if near and min(point[8] for point in near) < -OVERLAP:
                raise SimError(f"robot.pose: expected a place clear of {name}, got {told}; move one of the two")

    def step(self) -> None:
        """Advance by one physics step."""
        self.world.step()
        time = self._client.time
        self.proximity.watch_touches(time)
        if time + 1e-9 >= self._ticks * 0.01:
            if self._ticks % round(CLEARANCE_EVERY / 0.01) == 0:
                self.proximity.measure_things()
            self._ticks += 1
            self._move_people()

    def _move_people(self) -> None:
        if not self.crowd.walkers:
            return
        pose, rates = self.robot.base_state()
        places = {name: (float(each.place[0]), float(each.place[1])) for name, each in self.crowd.walkers.items()}
        near = self.proximity.near_people(places, (float(pose[0]), float(pose[1])))
        self.crowd.move(near, self._lead(pose, rates) if self._scene.manners.step_in_rate > 0 else None)

    def _lead(self, pose: Array, rates: Array) -> Lead:
        """Give what goes ahead of the robot: it, or its cart."""
        x, y, heading = pose.tolist()
        vx, vy, _ = rates.tolist()
        speed = math.hypot(vx, vy)
        cos, sin = (vx / speed, vy / speed) if speed > 1e-6 else (math.cos(heading), math.sin(heading))
        reach = 0.4
        if self.cart is not None:
            place = self.world.pose(self.cart).position
            off = float(place[0]) - x, float(place[1]) - y
            ahead = off[0] * cos + off[1] * sin
            if ahead > 0 and math.hypot(*off) < 2.0:
                reach = ahead + self._cart_reach
        direction = np.array([cos, sin])
        return Lead(np.array([x, y]) + reach * direction, direction, speed)


def _is_cart(body: object) -> bool:
    return getattr(body, "kind", None) == "utility_cart"


def build_walls(client: BulletClient, grid: GridMap, height: float) -> None:
    """Build what a map has occupied, as boxes `map_0`, `map_1` and so on.

    Args:
        client: the world.
        grid: the map.
        height: of the boxes [m].
    """
    api = client.api
    for number, (left, bottom, right, top) in enumerate(grid.boxes().tolist()):
        half = [(right - left) / 2, (top - bottom) / 2, height / 2]
        body = api.createMultiBody(
            baseMass=0,
            baseCollisionShapeIndex=api.createCollisionShape(bullet.GEOM_BOX, halfExtents=half),
            baseVisualShapeIndex=api.createVisualShape(
                bullet.GEOM_BOX, halfExtents=half, rgbaColor=[0.90, 0.89, 0.85, 1]
            ),
            basePosition=[(left + right) / 2, (bottom + top) / 2, height / 2],
        )
        client.add(f"map_{number}", body)
        api.changeDynamics(body, -1, lateralFriction=FIXTURE_FRICTION, restitution=0)
