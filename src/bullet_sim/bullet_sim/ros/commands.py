"""What commands say, taken out of their messages."""

from __future__ import annotations

import math

from geometry_msgs.msg import Twist

from bullet_sim.errors import SimError


def base_twist(message: Twist) -> tuple[float, float, float]:
    """Return what a base is commanded: forward [m/s], to the left [m/s], turning left [rad/s].

    Raises:
        SimError: a number is none, also one that no base on the floor obeys: whoever sends it is not to be believed in
            the others either.
    """
    linear, angular = message.linear, message.angular
    numbers = (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
    if not all(map(math.isfinite, numbers)):
        raise SimError(f"base command: expected finite numbers, got {list(numbers)}; send zeros to stop")
    return linear.x, linear.y, angular.z
