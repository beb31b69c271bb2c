"""Two ways in which the robot knows where its cart is (thesis section 4.4): by its hands, and by a checkerboard.

The hands: what they hold did not move between the fingers since they closed, so where the joints have the hands, there
are the points of the handle that they took. Two hands give place and heading; one gives them if it does not turn.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.bristle import wrap
from bullet_sim.observations import Hold
from bullet_sim.sensors import SLACK, Ticker
from pr2_cart_sim.observations import CartReading
from pr2_cart_sim.sensor_settings import BoardSettings

Array = NDArray[np.float64]


def pose_from_points(held: Array, seen: Array) -> tuple[Array, float]:
    """Find the planar pose that takes points of an object to where they are seen, by least squares.

    Args:
        held: (n, 2) [m] in the object's frame, n >= 2.
        seen: (n, 2) [m] in another frame.

    Returns:
        Pose (3,) of the object in that frame, and the root mean square misfit [m].
    """
    a, b = held - held.mean(axis=0), seen - seen.mean(axis=0)
    theta = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    place = seen.mean(axis=0) - turn @ held.mean(axis=0)
    rest = seen - held @ turn.T - place
    return np.array([*place, theta]), float(np.sqrt(np.mean(np.sum(rest**2, axis=1))))


class HandsEstimate:
    """Where the cart is by the hands that hold it."""

    def __init__(self, bias: float, rng: Generator) -> None:
        """Draw each hand's error, up to `bias` [m] along each axis of `base`."""
        self._bias = {side: rng.uniform(-bias, bias, 2) for side in ("left", "right")}
        self._turned: dict[str, float] = {}

    def close(self, side: str, hand_yaw: float, object_yaw: float) -> None:
        """Take note that a hand closed: its heading and that of what it holds, both in one frame [rad]."""
        self._turned[side] = object_yaw - hand_yaw

    def estimate(
        self, time: float, cart: str, holds: Sequence[Hold], hands: Mapping[str, tuple[Array, float]]
    ) -> CartReading | None:
        """Estimate the cart's pose in `base`.

        Args:
            time: now [s].
            cart: name of the body.
            holds: who holds what.
            hands: place (3,) [m] in `base` of the middle between each hand's fingers where it holds, and its heading.

        Returns:
            None where no hand holds it.
        """
        on = [hold for hold in holds if hold.object == cart]
        if not on:
            return None
        held = np.array([hold.contact_point[:2] for hold in on])
        seen = np.array([hands[hold.gripper][0][:2] + self._bias[hold.gripper] for hold in on])
        if len(on) > 1:
            pose, misfit = pose_from_points(held, seen)
            return CartReading(time, "hands", cart, pose, misfit)
        side = on[0].gripper
        theta = wrap(hands[side][1] + self._turned.get(side, 0.0))
        turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
        return CartReading(time, "hands", cart, np.array([*(seen[0] - turn @ held[0]), theta]), math.nan)


class BoardNoise:
    """The checkerboard as its errors are: calibration, jitter, misses, latency."""

    def __init__(self, settings: BoardSettings, cart: str, rng: Generator) -> None:
        """Draw the calibration's error from `rng`, which is kept for the noise."""
        self._settings, self._cart, self._rng = settings, cart, rng
        self._bias = rng.uniform(-1, 1, 3) * [settings.bias, settings.bias, settings.bias_yaw]
        self._sigma = np.array([settings.sigma_xy, settings.sigma_xy, settings.sigma_yaw])
        self._ticker = Ticker(settings.rate)
        self._underway: deque[tuple[float, CartReading]] = deque()

    def due(self, time: float) -> bool:
        """Say whether a picture is taken at this step; if so, call `capture`."""
        return self._ticker.due(time)

    def capture(self, time: float, pose: Array, visible: bool) -> None:
        """Take a picture of the cart at its true pose (3,) in `base`; `visible`: whether the camera has it in view."""
        draws, missed = self._rng.normal(size=3), self._rng.random() < self._settings.dropout
        if visible and not missed:
            seen = pose + self._bias + self._sigma * draws
            reading = CartReading(time, "checkerboard", self._cart, seen, math.nan)
            self._underway.append((time + self._settings.latency, reading))

    def deliver(self, time: float) -> list[CartReading]:
        """Give the readings whose latency has passed, oldest first."""
        arrived = []
        while self._underway and self._underway[0][0] <= time + SLACK:
            arrived.append(self._underway.popleft()[1])
        return arrived
