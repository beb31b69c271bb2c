"""Laser scanners: Bullet's rays from where the laser is, with the noise of a Hokuyo; and the joint that nods one."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose
from bullet_sim.sensors import Ticker
from pr2_cart_sim.description import NAME
from pr2_cart_sim.sensor_settings import LaserSettings, TiltLaserSettings

Array = NDArray[np.float64]

ROBOT_GROUP = 64
"""Bit of the robot's links in Bullet's collision filter, which rays can leave out."""
STAGES = (2.5, 6.0, 14.0)
"""Ranges [m] up to which beams are cast before those that hit nothing are cast on: Bullet looks at all that a ray
crosses, also behind what it hits first."""
AT_ONCE = 16_000
"""Rays that Bullet takes in one call at most."""


def mark_robot(client: BulletClient) -> None:
    """Put the robot's links into a group of their own, which collides with everything as before."""
    number = client.body(NAME)
    for link in (-1, *client.joints(NAME).values()):
        client.api.setCollisionFilterGroupMask(number, link, ROBOT_GROUP, -1)


class Laser:
    """One scanner.

    Attributes:
        angle_min: of the first beam [rad].
    """

    def __init__(self, client: BulletClient, settings: LaserSettings, rng: Generator) -> None:
        """Set up.

        Args:
            client: the world, its robot marked by `mark_robot`.
            settings: what it is like.
            rng: draws noise.
        """
        if settings.beams > AT_ONCE:
            raise ValueError(f"expected at most {AT_ONCE} beams, got {settings.beams}")
        self._api, self._settings, self._rng = client.api, settings, rng
        self._mask = -1 if settings.sees_robot else ~ROBOT_GROUP
        half = settings.beams // 2
        self.angle_min = -half * settings.increment
        angles = settings.increment * np.arange(-half, half + 1)
        self._directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
        self._ticker = Ticker(settings.rate)

    def due(self, time: float) -> bool:
        """Say whether a scan is due; call at every step."""
        return self._ticker.due(time)

    def scan(self, pose: Pose) -> Array:
        """Measure.

        Args:
            pose: of the laser's frame in `world`.

        Returns:
            Ranges (n,) [m]; infinite where nothing is within reach.
        """
        settings = self._settings
        ranges = self._cast(pose.position, self._directions @ pose.matrix.T)
        noise = self._rng.normal(0.0, settings.noise, len(ranges)) if settings.noise > 0 else 0.0
        missed = self._rng.random(len(ranges)) < settings.dropout
        return np.where(missed, np.inf, np.maximum(ranges + noise, settings.range_min))

    def _cast(self, origin: Array, directions: Array) -> Array:
        """Give true ranges (n,) [m] along directions (n, 3) from a place (3,) in `world`, infinite where nothing is."""
        settings = self._settings
        ranges, near = np.full(len(directions), np.inf), settings.range_min
        open_beams = np.arange(len(directions))
        for far in (*(stage for stage in STAGES if near < stage < settings.range_max), settings.range_max):
            rays = directions[open_beams]
            start, end = origin + near * rays, origin + far * rays
            hits = self._api.rayTestBatch(start.tolist(), end.tolist(), numThreads=1, collisionFilterMask=self._mask)
            share = np.array([hit[2] for hit in hits])
            struck = share < 1.0
            ranges[open_beams[struck]] = near + share[struck] * (far - near)
            open_beams, near = open_beams[~struck], far
            if len(open_beams) == 0:
                break
        return ranges


class Nod:
    """The way the tilting laser's joint goes: to and fro between two angles at one speed."""

    def __init__(self, settings: TiltLaserSettings) -> None:
        """Take note of where it goes; it begins level, on its way down."""
        self._low, self._high = settings.low, settings.high
        self._speed = 2 * (settings.low - settings.high) / settings.period
        self._way = 1.0

    def rate(self, angle: float) -> float:
        """Give the rate [rad/s] to ask of the joint at `angle` [rad]."""
        if angle >= self._low:
            self._way = -1.0
        elif angle <= self._high:
            self._way = 1.0
        return self._way * self._speed
