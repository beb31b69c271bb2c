"""Messages about the floor to library types: odometry, room, what is built in. Plain functions, no node needed."""

from __future__ import annotations

import numpy as np
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import Scene

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, yaw_of
from pbrl_control.ros.conversions import seconds


def odometry_from_msg(message: Odometry) -> tuple[float, Array]:
    """Return when odometry was taken [s], and the pose (3,) of `base` in `odom` [m, rad]."""
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return seconds(message.header.stamp), np.array([p.x, p.y, yaw_of(np.array([q.x, q.y, q.z, q.w]))])


def room_from_msg(message: Scene) -> Array | None:
    """Return the corners (k, 2) of the free floor in `world` [m]; None where it has no bounds.

    Raises:
        ControlError: they are fewer than three, or a number is not finite.
    """
    corners = np.array([[corner.x, corner.y] for corner in message.room])
    if len(corners) and not (len(corners) > 2 and np.isfinite(corners).all()):
        raise ControlError(f"/scene: room: expected three finite corners at least, got {len(corners)} of them")
    return corners if len(corners) else None


def fixed_from_msg(message: Scene) -> dict[str, Array]:
    """Return the pose (3,) in `world` of each body that is built in [m, rad], by name."""
    return {
        body.name: np.array([body.pose.x, body.pose.y, body.pose.theta]) for body in message.bodies if not body.movable
    }
