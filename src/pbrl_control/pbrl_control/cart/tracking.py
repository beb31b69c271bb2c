"""From errors to commands: prediction over the delay, critically damped feedback, limits.

The thesis's law is proportional (12), (13), which is stable with a delay only while it is slow, and slow lags behind
its goal. Here the plan's own rates are fed forward, and errors die away as those of a critically damped oscillator,
whose state is the rate by which commands differ from the plan's: a command cannot jump.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from pbrl_control.cart.settings import CartLimits
from pbrl_control.cart.tracking_kernel import limit_rates
from pbrl_control.planar import Array

REMEMBERED = 1.0  # [s] of commands


class CommandHistory:
    """What was commanded when, to tell where base and cart are when the next command arrives.

    Args:
        delay: from a command to its motion [s].
    """

    def __init__(self, delay: float) -> None:
        self._delay = delay
        self._sent: deque[tuple[float, Array]] = deque()

    def add(self, now: float, rates: Array) -> None:
        """Note rates (4,) that are commanded at `now` [s]: forward, left, turning, articulation."""
        self._sent.append((now, rates))
        while self._sent[0][0] < now - REMEMBERED and len(self._sent) > 1:
            self._sent.popleft()

    def base(self, now: float, seen: float, pose: Array) -> Array:
        """Return the base's pose (3,) a delay after `now`, given the pose at the time `seen` [s]; heading may wind."""
        x, y, heading = pose
        for span, rates in self._between(seen - self._delay, now):
            vx, vy, omega, _ = rates
            middle = heading + 0.5 * omega * span
            c, s = math.cos(middle), math.sin(middle)
            x, y, heading = x + span * (c * vx - s * vy), y + span * (s * vx + c * vy), heading + span * omega
        return np.array([x, y, heading])

    def articulation(self, now: float, seen: float, angle: float) -> float:
        """Return the articulation a delay after `now`, given that at the time `seen` [s]."""
        return angle + sum(span * float(rates[3]) for span, rates in self._between(seen - self._delay, now))

    def _between(self, begin: float, end: float) -> list[tuple[float, Array]]:
        """Return for how long which rates were commanded between two times; before the first: none."""
        sent = list(self._sent)
        found = []
        for k, (time, rates) in enumerate(sent):
            until = sent[k + 1][0] if k + 1 < len(sent) else end
            span = min(until, end) - max(time, begin)
            if span > 0.0:
                found.append((span, rates))
        return found


def feedback(error: Array, extra: Array, frequency: float, dt: float) -> Array:
    """Return the rates (n,) beyond the plan's that bring errors to naught, critically damped.

    With e the error and w the rates beyond the plan's, e' = -w and w' = -2 k w + k^2 e. In steps of dt the same holds
    exactly with w <- z^2 w + (1 - z)^2 / dt e and z = exp(-k dt), which has the double pole z.

    Args:
        error: (n,) from where it is to the goal.
        extra: (n,) the rates beyond the plan's in the last step.
        frequency: k [rad/s].
        dt: [s].
    """
    z = math.exp(-frequency * dt)
    return z * z * extra + (1.0 - z) ** 2 / dt * error


def room_beside(planned: Array, extra: Array, speeds: Array) -> float:
    """Return the greatest share of planned rates (4,) that leaves speeds (3,) room for the rates that correct errors.

    At full speed straight on there is none for going sideways: an error would stay for as long as that lasts.
    """
    along, across = float(planned[:2] @ planned[:2]), float(planned[:2] @ extra[:2])
    share = 1.0
    if along > 0.0:
        left = float(speeds[0] ** 2 - extra[:2] @ extra[:2])
        share = (math.sqrt(max(across**2 + along * left, 0.0)) - across) / along if left > 0.0 else 0.0
    for k in (2, 3):
        if planned[k] != 0.0:
            share = min(
                share, float((speeds[k - 1] - math.copysign(extra[k], extra[k] * planned[k])) / abs(planned[k]))
            )
    return min(max(share, 0.0), 1.0)


def to_world(rates: Array, heading: float) -> Array:
    """Return rates (4,) whose first two are in the robot's axes with these in those of its parent."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * rates[0] - s * rates[1], s * rates[0] + c * rates[1], rates[2], rates[3]])


def to_base(rates: Array, heading: float) -> Array:
    """Return the opposite of `to_world`: T_b of (12)."""
    return to_world(rates, -heading)


class RateLimits:
    """Keeps commands within limits.

    Args:
        limits: of base and articulation.
    """

    def __init__(self, limits: CartLimits) -> None:
        self.speeds, self.accelerations, self.brakings = limits.speeds, limits.accelerations, limits.brakings
        self._range = limits.articulation

    def nearest(self, wish: Array, last: Array, speeds: Array, dt: float, articulation: float) -> Array:
        """Return the rates (4,) nearest to a wish that may be commanded after `last`.

        A rate that is to get smaller may change by the braking limits, any other by the accelerations. Articulation
        ends where it still can brake before its range does. What is not finite is a wish to stand.

        Args:
            wish: (4,) forward, left, turning, articulation.
            last: (4,) commanded before.
            speeds: (3,) greatest of translation, turning, articulation, at most those of the limits.
            dt: since the last command [s].
            articulation: where the cart is [rad].
        """
        wish = wish if math.isfinite(wish.sum()) else np.zeros(4)
        found = np.empty(4)
        limit_rates(wish, last, speeds, self.accelerations, self.brakings, *self._range, dt, articulation, found)
        return found
