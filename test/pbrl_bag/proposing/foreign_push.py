"""One push as different laboratories would record it, with things around that play no role."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import WrenchStamped

from pbrl_bringup.benches.foreign_labs import (
    LABS,
    WRENCH,
    Lab,
    Message,
    fixed_frame,
    hand_seen,
    stamp,
    table_seen,
)

__all__ = ["CLOSED", "CONTACT", "LABS", "OPENED", "recorded"]

CONTACT = (-0.6, 0.1)
SECONDS, CLOSED, OPENED = 8.0, 1.0, 7.0


def pose_at(t: float) -> np.ndarray:
    """Where the table is (3,) at a time: it stands, is pushed round, and stands again."""
    along = np.clip(t - CLOSED - 0.5, 0.0, OPENED - CLOSED - 1.0)
    return np.array([0.5 + 0.12 * along, 0.3 * math.sin(0.4 * along), 0.15 * along])


def hand_at(t: float) -> np.ndarray:
    """Where the hand is (3,): it comes, holds, and goes."""
    x, y, yaw = pose_at(t)
    away = max(CLOSED - t, t - OPENED, 0.0)
    c, s = math.cos(yaw), math.sin(yaw)
    px, py = CONTACT[0] - 0.2 * away, CONTACT[1]
    return np.array([x + c * px - s * py, y + s * px + c * py, yaw])


def spatial(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position and quaternion of a pose (x, y, yaw)."""
    x, y, yaw = pose
    return np.array([x, y, 0.7]), np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])


def recorded(lab: Lab) -> list[Message]:
    """Return the messages of the push as a laboratory records it, with things around that play no role."""
    messages = fixed_frame(lab)
    bystander = Lab("/chair/pose", "/tf#base_link", lab.wrench, world=lab.world)
    for i in range(round(SECONDS * 100)):
        t, when = i / 100, i * 10_000_000
        felt = WrenchStamped()
        felt.header.stamp, felt.header.frame_id = stamp(when), lab.sensor
        felt.wrench.force.x = 15.0 + math.sin(t) if CLOSED < t < OPENED else 0.0
        felt.wrench.torque.z = 0.3
        messages.append((lab.wrench, WRENCH, felt, when))
        if i % 4 == 0:
            messages.append(table_seen(lab, *spatial(pose_at(t)), when))
            messages.append(hand_seen(lab, *spatial(hand_at(t)), when))
            messages.append(table_seen(bystander, *spatial(np.array([3.0, 1.0, 0.2])), when))
            messages.append(hand_seen(bystander, *spatial(np.array([0.3 * t, 0.0, 0.0])), when))
    return sorted(messages, key=lambda message: message[3])
