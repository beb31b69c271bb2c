"""Both arms move what they hold: from the cart's twist to the hands' twists to joint rates (thesis 4.5.6, (14))."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrl_control.cart.settings import ArmLawSettings
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_control.whole_body.arm_ik import damped_inverse, fitting_scale

LONGEST = 0.1  # [s] that a command may have to last


@dataclass(frozen=True)
class ArmState:
    """Both arms, left first.

    Attributes:
        jacobians: (2, 6, 7) of the hands, linear before angular, in `base`.
        joints: (2, 7) positions [rad].
        lower: (2, 7) stops [rad]; -inf for joints that turn on.
        upper: (2, 7).
        speed: (2, 7) greatest rates [rad/s].

    Raises:
        ControlError: a shape or number is not what it should be.
    """

    jacobians: Array
    joints: Array
    lower: Array
    upper: Array
    speed: Array

    def __post_init__(self) -> None:
        for name, shape in (("jacobians", (2, 6, 7)), *((n, (2, 7)) for n in ("joints", "lower", "upper", "speed"))):
            value = np.asarray(getattr(self, name), dtype=float)
            unbounded = name in ("lower", "upper")
            if value.shape != shape or not (np.isfinite(value).all() or (unbounded and not np.isnan(value).any())):
                raise ControlError(f"arms: expected finite {name} {shape}, got shape {value.shape}")
            object.__setattr__(self, name, value)
        if (self.speed < 0.0).any() or (self.lower > self.upper).any():
            raise ControlError("arms: expected speeds of 0 and more, and lower stops below the upper ones")

    def range(self, settings: ArmLawSettings) -> tuple[Array, Array]:
        """Return least and greatest rates (2, 7) from which every joint can stop before its stops [rad/s]."""
        ways = np.stack((self.joints - self.lower, self.upper - self.joints)) - settings.margin
        # So long at v, and then braking, end at the stop: v LONGEST + v^2 / (2 acceleration) = way.
        slow = settings.acceleration * LONGEST
        fast = np.sqrt(slow * slow + 2.0 * settings.acceleration * np.maximum(ways, 0.0)) - slow
        down, up = np.minimum(fast, self.speed)
        return -down, up


@dataclass(frozen=True)
class ArmRates:
    """What the arms do.

    Attributes:
        rates: (2, 7) to send [rad/s], within limits.
        scale: share of the wish that the joints' limits leave; the same for both arms, which hold one thing.
        missed: (2, 6) of the hands' twists that is not done even without limits [m/s, rad/s].
    """

    rates: Array
    scale: float
    missed: Array


def hand_twists(cart_twist: Array, grip: Array, hands: Array) -> Array:
    """Return both hands' twists (2, 6) in `base`: the cart is rigid, and stays level.

    Args:
        cart_twist: (3,) of the cart at the grip, in `base`: x, y [m/s], turning [rad/s].
        grip: (2,) about which it turns, in `base` [m].
        hands: (2, 2) where they hold it, in `base` [m].
    """
    vx, vy, omega = cart_twist
    lever = np.asarray(hands) - grip
    found = np.zeros((2, 6))
    found[:, 0], found[:, 1], found[:, 5] = vx - omega * lever[:, 1], vy + omega * lever[:, 0], omega
    return found


def pseudo_inverse_rates(arms: ArmState, twists: Array, settings: ArmLawSettings) -> ArmRates:
    """Return the joint rates that do both hands' twists (2, 6), by the damped pseudo-inverse of the grasp Jacobian.

    That Jacobian has a block for each arm: what the cart does couples the arms through their twists only.
    """
    rates = np.empty((2, 7))
    for k in range(2):
        inverse, _ = damped_inverse(arms.jacobians[k], settings.threshold, settings.damping)
        rates[k] = inverse @ twists[k]
    return _limited(arms, rates, twists, settings)


def transpose_rates(arms: ArmState, twists: Array, settings: ArmLawSettings) -> ArmRates:
    """Return the thesis's joint rates (14), J^T times the hands' twists (2, 6), for comparison.

    They are rates in name only: J^T of a twist is the torque of a wrench. Without a gain, that one is taken for both
    arms with which least of the twists is missed.
    """
    rates = np.einsum("kij,ki->kj", arms.jacobians, twists)
    if settings.gain is not None:
        return _limited(arms, settings.gain * rates, twists, settings)
    done = np.einsum("kij,kj->ki", arms.jacobians, rates)
    square = float(np.sum(done * done))
    gain = float(np.sum(done * twists)) / square if square > 0.0 else 0.0
    return _limited(arms, gain * rates, twists, settings)


def arm_rates(arms: ArmState, twists: Array, settings: ArmLawSettings) -> ArmRates:
    """Return the joint rates by the law that the settings name."""
    law = pseudo_inverse_rates if settings.law == "pseudo-inverse" else transpose_rates
    return law(arms, twists, settings)


def _limited(arms: ArmState, rates: Array, twists: Array, settings: ArmLawSettings) -> ArmRates:
    low, high = arms.range(settings)
    scale = fitting_scale(rates, low, high)
    scale = scale if math.isfinite(scale) else 0.0
    missed = twists - np.einsum("kij,kj->ki", arms.jacobians, rates)
    return ArmRates(np.clip(scale * rates, low, high), scale, missed)
