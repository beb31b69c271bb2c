"""A body's motion in the plane, in plain floats."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bullet_sim.client import BulletClient
from bullet_sim.quiet import bullet


class BodyMotion:
    """Where a body is in the plane, read once a step: cheaper than poses and twists in space.

    Attributes:
        x: of the tag frame [m].
        y: of the tag frame [m].
        yaw: [rad].
        vx: of the tag frame [m/s].
        vy: of the tag frame [m/s].
        spin: [rad/s].
        height: of the tag over the floor [m].
    """

    def __init__(self, client: BulletClient, body: str, tag: Sequence[float]) -> None:
        """Take note of a body and of where its tag is (3,) [m] in its base's own frame; `look` reads it."""
        self._api, self._number = client.api, client.body(body)
        self._tag = tag
        self.look()

    def look(self) -> None:
        """Bring everything up to date."""
        (x, y, z), (qx, qy, qz, qw) = self._api.getBasePositionAndOrientation(self._number)
        (vx, vy, _), (_, _, spin) = self._api.getBaseVelocity(self._number)
        self.yaw = math.atan2(2 * (qx * qy + qz * qw), 1 - 2 * (qy * qy + qz * qz))
        self._cos, self._sin = math.cos(self.yaw), math.sin(self.yaw)
        arm_x, arm_y = self.turned(self._tag[0], self._tag[1])
        self.x, self.y, self.height = x + arm_x, y + arm_y, z + self._tag[2]
        self.vx, self.vy, self.spin = vx - spin * arm_y, vy + spin * arm_x, spin

    def turned(self, x: float, y: float) -> tuple[float, float]:
        """Turn a vector of the body's frame into `world`."""
        return self._cos * x - self._sin * y, self._sin * x + self._cos * y

    def point(self, local: Sequence[float]) -> tuple[float, float]:
        """Take a point (x, y) [m] of the body's frame to `world`."""
        x, y = self.turned(local[0], local[1])
        return self.x + x, self.y + y

    def speed_at(self, place: Sequence[float]) -> tuple[float, float]:
        """Give the velocity (2,) [m/s] of the body at a place (x, y) [m] of `world`."""
        return self.vx - self.spin * (place[1] - self.y), self.vy + self.spin * (place[0] - self.x)

    def push(self, force: Sequence[float], place: Sequence[float]) -> None:
        """Push with (3,) [N] at (3,) [m], both in `world`, during the next step."""
        self._api.applyExternalForce(self._number, -1, force, place, bullet.WORLD_FRAME)

    def turn(self, torque: float) -> None:
        """Turn with `torque` [N m] about the vertical during the next step."""
        self._api.applyExternalTorque(self._number, -1, [0.0, 0.0, torque], bullet.WORLD_FRAME)
