"""Where robot and cart are, from odometry, a localiser, and whatever sees the cart; no ROS, time is given."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pbrl_control.cart import CartBody, CartSight, choose_sight
from pbrl_control.cart.whereabouts import Whereabouts
from pbrl_control.planar import Array, compose, rotation
from pbrl_planner.cart.outline import GRIP, frame_at_grip, pr2_with
from pbrl_planner.lattice.body import rectangle

SOURCES = ("hands", "checkerboard")
"""Of the cart's pose, the one that jitters least first (thesis 4.4)."""
SIGHT_AGE, MISFIT = 0.25, 0.03
"""As old [s] and as far off [m] a reading of the cart may be before the next source is asked."""
AHEAD = 0.2
"""[s] that a stamp may be ahead of a clock that comes in steps, and by another way."""
SET_BACK = 1.0
"""[s] by which odometry jumps back where its clock has begun again."""
ALONE = pr2_with(rectangle(0.0, 0.1, 0.1)).robot
"""Outline (k, 2) of the robot in `base` [m]."""


class CartTracker:
    """The latest of every stream, put together in `map`.

    Attributes:
        whereabouts: of the base.
        body: outlines of robot and cart; None: no hand has held a cart yet.
        cart: outline (k, 2) of that cart in its own frame [m].
        held: what each hand holds, by side.
        kept_out: outlines (k, 2) of places that nothing may enter [m].
    """

    def __init__(self) -> None:
        self.whereabouts = Whereabouts()
        self.body: CartBody | None = None
        self.cart: Array | None = None
        self.held: dict[str, str] = {}
        self.kept_out: list[Array] = []
        self._newest = -math.inf
        self._movable: dict[str, Array] = {}
        self._seen: dict[str, tuple[float, Array]] = {}

    def moved(self, time: float, pose: Array, twist: Array) -> bool:
        """Take in odometry: pose (3,) in `odom`, twist (3,) in `base`, `time` [s].

        Returns:
            Whether its clock has begun again, so that all that was known of places is void.
        """
        again = time < self._newest - SET_BACK
        if again:
            self.whereabouts, self._seen, self._newest = Whereabouts(), {}, -math.inf
        if time > self.whereabouts.time:
            self.whereabouts.moved(time, pose, twist)
        self._newest = max(self._newest, time)
        return again

    def localised(self, time: float, pose: Array) -> None:
        """Take in a localiser's pose (3,) in `map` of the time `time` [s]."""
        self.whereabouts.localised(time, pose)

    def furniture(self, movable: Mapping[str, Array]) -> None:
        """Take in outlines (k, 2) of what can be moved, each in its own frame, by name [m]."""
        self._movable = dict(movable)
        self._take_cart()

    def grasps(self, held: Mapping[str, str]) -> None:
        """Take in what each hand holds, by side."""
        self.held = dict(held)
        self._take_cart()

    def cart_seen(self, source: str, time: float, pose: Array) -> None:
        """Take in the pose (3,) of the cart's own frame in `base`, by one of `SOURCES`."""
        self._seen[source] = (time, pose)
        self._newest = max(self._newest, time)

    def now(self, clock: float) -> float:
        """Return the time [s]: the clock's, or that of the newest reading where this is a little ahead of it."""
        return self._newest if clock < self._newest <= clock + AHEAD else clock

    def pose(self, now: float) -> Array | None:
        """Return the pose (3,) of `base` in `map`; None: not known."""
        return self.whereabouts.pose(now)

    def pose_time(self, now: float) -> float:
        """Return of when the base's pose is [s]: of now, while odometry leads it on for less than 50 ms.

        After a clock was set back by less than odometry shows it is one ahead of `now`, which nobody relies upon.
        """
        return now if abs(now - self.whereabouts.time) < 0.05 else self.whereabouts.time

    def sight(self, now: float) -> CartSight | None:
        """Return the reading of the cart that can be relied upon at `now` [s]."""
        return choose_sight(now, [self._reading(source) for source in SOURCES], SIGHT_AGE, MISFIT)

    def last_sight(self) -> CartSight | None:
        """Return the newest reading of the cart, however old; None: there was none."""
        readings = [each for each in map(self._reading, SOURCES) if each is not None]
        return max(readings, key=lambda each: each.time) if readings else None

    def state(self, now: float) -> Array | None:
        """Return x, y, heading and articulation (4,) of robot and cart at `now` [s]; None: not known."""
        pose, sight = self.pose(now), self.sight(now)
        return None if pose is None or sight is None else np.append(pose, sight.articulation)

    def own(self, now: float) -> list[Array]:
        """Return outlines (k, 2) of robot and cart in `map` at a time [m]; none where nothing is known of them."""
        pose = self.pose(now)
        if pose is None:
            return []
        if self.body is None:
            return [ALONE @ rotation(float(pose[2])).T + pose[:2]]
        # What is held is where it was last seen: nobody sees it for a while, and lasers go on seeing it.
        sight = self.sight(now) or (self.last_sight() if self.held else None)
        return self.body.seen_outlines(pose, None if sight is None else sight.pose)

    @property
    def missing(self) -> str:
        """What has never come yet, in words; empty where all has."""
        wanted = {
            "odometry on /odom": math.isfinite(self.whereabouts.time),
            "a localiser's pose on /amcl_pose": self.pose(self.whereabouts.time) is not None,
            "a cart in the hands, on /scene and /grasps": self.body is not None,
            "the cart's pose on /cart_pose/hands": self.last_sight() is not None,
        }
        return next((what for what, there in wanted.items() if not there), "")

    def _take_cart(self) -> None:
        for name in sorted(set(self.held.values()) & set(self._movable)):
            self.body = CartBody.of(pr2_with(self._movable[name]))
            self.cart = self._movable[name]

    def _reading(self, source: str) -> CartSight | None:
        if source not in self._seen or self.cart is None:
            return None
        time, pose = self._seen[source]
        return CartSight(time, source, compose(pose, frame_at_grip(self.cart)))


def up_to(now: float, time: float) -> float:
    """Return a stamp [s]; `now`, where it is a little ahead of it."""
    return now if now < time <= now + AHEAD else time


def grip_offset(sight: CartSight) -> tuple[float, float]:
    """Return where the cart's grip is from where the hands should have it (2,), in `base` [m]."""
    return sight.grip_offset(GRIP)
