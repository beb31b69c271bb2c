"""Base steering: how a base that cannot go sideways keeps what the arms carry in the middle of their workspace.

`Predictive` looks some seconds ahead (see `steering_kernel`). `Waypoint` is the thesis's law (section 6.3.1, equations
45 and 46): a threshold decides whether the base turns towards where it should be or as it should stand there.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from pbrl_control.planar import Array, compose, inverse, shift, turn, wrap
from pbrl_control.settings import BaseSettings
from pbrl_control.whole_body.steering_kernel import steer

STEP = 0.25
"""Of the plan [s]."""
BEYOND = 50.0
"""How much more a gripper's yaw counts beyond what arms can do."""
FIRST_ROUNDS, ROUNDS = 30, 1
"""Iterations of a new plan, and at each tick."""


class Steering(Protocol):
    """A way to steer."""

    def wish(self, carried: Array, twist: Array, home: Array) -> Array:
        """Return the (2,) base speed and yaw rate to be had [m/s, rad/s].

        Args:
            carried: (3,) pose in the base of the frame that is carried [m, rad].
            twist: (3,) asked of it over the floor, at its origin, in base axes [m/s, rad/s].
            home: (3,) where it should be in the base.
        """
        ...

    def stop(self) -> None:
        """Forget what was planned."""
        ...


def unsteered(carried: Array, twist: Array) -> Array:
    """Return the (2,) base velocity that carries a frame along with its twist, as far as a base can."""
    at_base = shift(twist, -carried[:2])
    return np.array([at_base[0], at_base[2]])


class NoSteering:
    """The base does of the asked twist what it can, and no more (the wish of equation 44)."""

    def __init__(self, settings: BaseSettings) -> None:
        """Nothing of the settings is needed."""

    def wish(self, carried: Array, twist: Array, home: Array) -> Array:
        """See `Steering.wish`."""
        return unsteered(carried, twist)

    def stop(self) -> None:
        """Nothing is remembered."""


class Waypoint:
    """The thesis's threshold steering.

    The base goes to the pose from which the carried frame is at home. Driving backwards is as good as forwards, so the
    way to the waypoint is never more than a quarter turn off.

    Args:
        settings: gains and thresholds.
    """

    def __init__(self, settings: BaseSettings) -> None:
        self._settings = settings

    def wish(self, carried: Array, twist: Array, home: Array) -> Array:
        """See `Steering.wish`."""
        settings = self._settings
        error = compose(carried, inverse(home))
        plain = unsteered(carried, twist)
        towards = math.atan2(error[1], error[0])
        if abs(towards) > 0.5 * math.pi:
            towards = wrap(towards + math.pi)
        far = math.hypot(error[0], error[1]) > settings.waypoint_far
        turned = towards if far else error[2]
        ahead = 0.0 if far and abs(towards) > settings.waypoint_aside else error[0]
        return plain + np.array([settings.waypoint_gain * ahead, settings.waypoint_turn * turned])

    def stop(self) -> None:
        """Nothing is remembered."""


class Predictive:
    """Steering by looking ahead.

    Args:
        settings: horizon and weights.
    """

    def __init__(self, settings: BaseSettings) -> None:
        self._ceiling = np.array([settings.speed, settings.yaw_rate])
        sides = np.array([settings.apart_forward, settings.apart_sideways, settings.apart_yaw])
        effort = settings.effort / np.square(self._ceiling)
        self._weights = np.array(
            [*(1.0 / np.square(sides)), *effort, settings.last_weight, settings.turn_limit, BEYOND]
        )
        self._plan = np.zeros((max(round(settings.horizon / STEP), 2), 2))
        self._planned = False

    def wish(self, carried: Array, twist: Array, home: Array) -> Array:
        """See `Steering.wish`."""
        own = turn(twist, -carried[2])
        plain = unsteered(carried, twist)
        if self._planned:
            steer(carried, own, home, plain, self._ceiling, self._weights, STEP, self._plan, ROUNDS)
        else:
            self._plan, self._planned = self._begin(carried, own, home, plain), True
        return self._plan[0].copy()

    def _begin(self, carried: Array, own: Array, home: Array, plain: Array) -> Array:
        """Return the best of a few plans: sideways, turning either way is as good and going straight a saddle."""
        plans: list[tuple[float, int, Array]] = []
        for turned in (0.0, 0.5, -0.5):
            plan = np.tile(np.clip(plain, -self._ceiling, self._ceiling), (len(self._plan), 1))
            plan[: len(plan) // 2, 1] += turned * self._ceiling[1]
            cost = steer(carried, own, home, plain, self._ceiling, self._weights, STEP, plan, FIRST_ROUNDS)
            plans.append((cost, len(plans), plan))
        return min(plans)[2]

    def stop(self) -> None:
        """Forget the plan."""
        self._plan[:] = 0.0
        self._planned = False


def steering_of(settings: BaseSettings) -> Steering:
    """Return the way to steer that settings name."""
    ways: dict[str, type[Predictive] | type[Waypoint] | type[NoSteering]] = {
        "predictive": Predictive,
        "waypoint": Waypoint,
        "none": NoSteering,
    }
    return ways[settings.steering](settings)
