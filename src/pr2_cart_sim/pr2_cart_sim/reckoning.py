"""Where the robot believes that it is: dead reckoning, which drifts, and a localiser's pose in the map."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.sensors import SLACK, BiasField, Ticker
from pr2_cart_sim.observations import Localisation
from pr2_cart_sim.sensor_settings import LocalisationSettings, OdometrySettings

Array = NDArray[np.float64]


class Odometry:
    """Dead reckoning of an omnidirectional base, from (0, 0, 0) where the run began.

    Attributes:
        pose: (3,) x, y [m] and heading [rad] in `odom`.
        twist: (3,) [m/s], [rad/s] in `base`, over the last update.
    """

    def __init__(self, settings: OdometrySettings, start: Array, rng: Generator) -> None:
        """Begin.

        Args:
            settings: how far off it is.
            start: (3,) true pose of the base.
            rng: draws the scales' errors and the noise.
        """
        self._settings, self._rng = settings, rng
        self._scale = 1 + settings.scale * rng.normal(size=2)
        self._turn_scale = 1 + settings.turn_scale * rng.normal()
        self._last, self._time = start.copy(), 0.0
        self.pose, self.twist = np.zeros(3), np.zeros(3)

    def update(self, time: float, true: Array) -> None:
        """Take in the true pose (3,) at `time` [s]: what the wheels have rolled since the last update."""
        dx, dy, turn = true - self._last
        middle = self._last[2] + turn / 2
        cos, sin = math.cos(middle), math.sin(middle)
        way = np.array([cos * dx + sin * dy, -sin * dx + cos * dy])
        self._last = true.copy()
        draws = self._rng.normal(size=3)
        moved = self._scale * way + self._settings.noise * math.sqrt(math.hypot(*way)) * draws[:2]
        turned = self._turn_scale * turn + self._settings.turn_noise * math.sqrt(abs(turn)) * draws[2]
        heading = self.pose[2] + turned / 2
        cos, sin = math.cos(heading), math.sin(heading)
        self.pose += cos * moved[0] - sin * moved[1], sin * moved[0] + cos * moved[1], turned
        if time > self._time:
            self.twist = np.array([*moved, turned]) / (time - self._time)
        self._time = time


class Localiser:
    """Tells the pose in the map: the truth, an error that changes slowly over the floor, white noise, a latency."""

    def __init__(self, settings: LocalisationSettings, rng: Generator) -> None:
        """Set up with an error field drawn from `rng`, which is kept for the noise."""
        self._settings, self._rng = settings, rng
        self._field = BiasField(settings.bias, settings.bias_length, rng)
        self._ticker = Ticker(settings.rate)
        self._underway: deque[tuple[float, Localisation, Array]] = deque()
        spread = math.hypot(settings.sigma_xy, settings.bias / 2)
        self._sigma = np.array([spread, spread, settings.sigma_yaw])

    def measure(self, time: float, true: Array, reckoned: Array) -> list[tuple[Localisation, Array]]:
        """Take in where the robot is; give the readings whose latency has passed.

        Args:
            time: of this step [s].
            true: pose (3,) in `map`.
            reckoned: pose (3,) in `odom`.

        Returns:
            Each reading, and the pose in `odom` (3,) of the moment that it tells of.
        """
        settings = self._settings
        if self._ticker.due(time):
            pose = true + self._rng.normal(size=3) * [settings.sigma_xy, settings.sigma_xy, settings.sigma_yaw]
            pose[:2] += self._field.at(true[:2])
            self._underway.append((time + settings.latency, Localisation(time, pose, self._sigma), reckoned.copy()))
        arrived = []
        while self._underway and self._underway[0][0] <= time + SLACK:
            arrived.append(self._underway.popleft()[1:])
        return arrived
