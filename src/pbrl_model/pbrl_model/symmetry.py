"""Different numbers, same wheel: the wheel's symmetries, and means of angles.

A wheel turned by 90 degrees with its coefficients exchanged is the same wheel, and so is one turned by 180 degrees.
The representative that is reported has mu_x <= mu_y, x being the direction in which it rolls, and wheel_theta in
(-pi/2, pi/2], which is then an angle of period pi.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

THETA_PERIOD = math.pi
WHEEL_NAMES = ("wheel_theta", "mu_x", "mu_y")


def canonical_wheel(draws: Array, names: Sequence[str]) -> Array:
    """Return a copy of draws (..., K) with every wheel as its representative.

    Draws without all three of wheel_theta, mu_x and mu_y have no such symmetry and come back as they are.
    """
    out = np.array(draws, dtype=float)
    if not all(name in names for name in WHEEL_NAMES):
        return out
    theta, mu_x, mu_y = (list(names).index(name) for name in WHEEL_NAMES)
    turned = out[..., mu_x] > out[..., mu_y]
    out[..., theta] = wrap(out[..., theta] + np.where(turned, math.pi / 2.0, 0.0), THETA_PERIOD)
    low, high = np.minimum(out[..., mu_x], out[..., mu_y]), np.maximum(out[..., mu_x], out[..., mu_y])
    out[..., mu_x], out[..., mu_y] = low, high
    return out


def equivalent_wheels(draws: Array, names: Sequence[str]) -> Array:
    """Return (4, ..., K): the draws turned by 0, 90, 180 and 270 degrees, each the same wheels, angles in [-pi, pi]."""
    rows = np.asarray(draws, dtype=float)
    turned = np.stack([rows] * 4)
    if not all(name in names for name in WHEEL_NAMES):
        return turned
    theta, mu_x, mu_y = (list(names).index(name) for name in WHEEL_NAMES)
    for quarter in range(4):
        turned[quarter, ..., theta] = wrap(rows[..., theta] + quarter * math.pi / 2.0, 2.0 * math.pi)
    turned[1::2, ..., mu_x], turned[1::2, ..., mu_y] = rows[..., mu_y], rows[..., mu_x]
    return turned


def wheel_features(draws: Array, names: Sequence[str]) -> Array:
    """Return draws (..., K) with wheel_theta, mu_x and mu_y replaced by numbers that are the same for the same wheel.

    The friction coefficient in direction a is, up to its shape in between, m + d cos(2 (a - theta)) with the mean m and
    half the difference d of the two; m, d cos(2 theta) and d sin(2 theta) are the same in all four descriptions, and a
    wheel that holds alike in every direction has no turn.
    """
    out = np.array(draws, dtype=float)
    if not all(name in names for name in WHEEL_NAMES):
        return out
    theta, mu_x, mu_y = (list(names).index(name) for name in WHEEL_NAMES)
    half = (draws[..., mu_x] - draws[..., mu_y]) / 2.0
    out[..., theta] = (draws[..., mu_x] + draws[..., mu_y]) / 2.0
    out[..., mu_x], out[..., mu_y] = half * np.cos(2.0 * draws[..., theta]), half * np.sin(2.0 * draws[..., theta])
    return out


def wrap(angle: Array, period: float) -> Array:
    """Bring angles [rad] into (-period / 2, period / 2]."""
    return angle - period * np.ceil(angle / period - 0.5)


def circular_mean(angle: Array, period: float) -> float:
    """Return the mean direction [rad] of angles of a period, in (-period / 2, period / 2]."""
    turns = np.exp(2j * np.pi * np.asarray(angle) / period)
    return float(np.angle(turns.mean()) * period / (2.0 * np.pi))


def circular_sd(angle: Array, period: float) -> float:
    """Return the circular standard deviation [rad], sqrt(-2 ln R); it grows without bound as R goes to zero."""
    turns = np.exp(2j * np.pi * np.asarray(angle) / period)
    length = min(float(np.abs(turns.mean())), 1.0)
    return math.sqrt(-2.0 * math.log(length)) * period / (2.0 * np.pi) if length > 0.0 else math.inf
