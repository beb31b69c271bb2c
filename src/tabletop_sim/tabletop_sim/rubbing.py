"""Dry friction under an item: a few places at which it rests, each an elastic bristle that holds, then slides.

As `bullet_sim.feet`, but for things of grams to pounds that rest on their whole underside: bristles are as stiff as the
item's mass allows at this step, and the load is spread by statics, not felt. Friction that holds may be greater than
that which slides (Stribeck): such feet break loose all at once and skip.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import GRAVITY, BulletClient
from bullet_sim.motion import BodyMotion
from tabletop_sim.catalogue import DeskItem

Array = NDArray[np.float64]

STIFF = 0.25
"""Stiffness of all bristles together over mass / step^2: an explicit step shakes from 1 on."""
DAMPED = 0.3
"""Of critical."""
LOOSE = 0.01
"""Speed [m/s] at which a foot that slides has forgotten that it held."""
INSET = 0.85
"""Where feet are, as a share of half of each side."""
FELT = (5, 3)
"""Places along the sides that stand for felt."""


class Rubbing:
    """Friction of one item on the table.

    Args:
        client: the world.
        name: of the item's body, whose base is at its centre of mass.
        item: what it is like.
    """

    def __init__(self, client: BulletClient, name: str, item: DeskItem) -> None:
        self._motion = BodyMotion(client, name, (0.0, 0.0, 0.0))
        self._step = client.step_time
        centre = np.array(item.centre)
        self._places = _places(item) - centre
        self._loads = item.mass * GRAVITY * _shares(self._places)
        self._mu, self._breakaway = item.friction, item.breakaway
        total = STIFF * item.mass / self._step**2
        self._stiffness = total / len(self._places)
        self._damping = 2.0 * DAMPED * math.sqrt(total * item.mass) / len(self._places)
        self._bristles = np.zeros_like(self._places)
        self._slip = np.zeros(len(self._places))

    def update(self) -> None:
        """Rub on the table during the next step."""
        motion = self._motion
        motion.look()
        cos, sin = math.cos(motion.yaw), math.sin(motion.yaw)
        arms = self._places @ np.array([[cos, sin], [-sin, cos]])
        speed = np.array([motion.vx, motion.vy]) + motion.spin * np.column_stack((-arms[:, 1], arms[:, 0]))
        limit = self._mu * self._loads * (1.0 + (self._breakaway - 1.0) * np.exp(-((self._slip / LOOSE) ** 2)))
        bristles = self._bristles + speed * self._step
        shear = self._stiffness * np.hypot(bristles[:, 0], bristles[:, 1])
        back = np.minimum(limit / np.maximum(shear, 1e-12), 1.0)
        self._slip = np.maximum(shear - limit, 0.0) / self._stiffness / self._step
        self._bristles = bristles * back[:, None]
        force = -self._stiffness * self._bristles - self._damping * speed
        size = np.hypot(force[:, 0], force[:, 1])
        force *= np.minimum(limit / np.maximum(size, 1e-12), 1.0)[:, None]
        push = force.sum(axis=0)
        motion.push((float(push[0]), float(push[1]), 0.0), (motion.x, motion.y, 0.0))
        motion.turn(float((arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]).sum()))


def _places(item: DeskItem) -> Array:
    """Return where an item rests (k, 2), from its middle [m]."""
    half = np.array([item.length, item.width]) / 2.0
    if item.rests_on == "feet":
        return INSET * half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    columns, rows = FELT
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns * 2 - 1, (np.arange(rows) + 0.5) / rows * 2 - 1)
    return half * np.column_stack((x.ravel(), y.ravel()))


def _shares(places: Array) -> Array:
    """Return which part of the weight each place (k, 2) bears, given from the centre of mass: as even as can be."""
    balance = np.vstack((np.ones(len(places)), places.T))
    even = np.full(len(places), 1.0 / len(places))
    missing = np.array([1.0, 0.0, 0.0]) - balance @ even
    return np.asarray(np.maximum(even + np.linalg.pinv(balance) @ missing, 0.0))
