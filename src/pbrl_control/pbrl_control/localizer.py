"""Where the base is: wheel odometry, held to the world by the tags on the grippers.

The base wears no tag, but its grippers do, and kinematics says where they are in `base`. Odometry is smooth and
prompt and drifts, as a base that turns on the spot scrubs its slider and tyres; tags are late and noisy and stay
true. So tags move the frame `odom` slowly in the world, each compared with odometry at the moment it was taken.
"""

from __future__ import annotations

import bisect
import math
from collections import deque

import numpy as np

from pbrl_control.kinematics import Posture, RobotKinematics
from pbrl_control.percept import Tag
from pbrl_control.planar import Array, compose, inverse, rotate_vector, rotation, wrap
from pbrl_control.settings import Positive, Section

HISTORY = 2.0  # [s] of odometry that is kept for late tags
LONGEST_PERIOD = 0.2  # [s] that one tag stands for at most, after a gap


class LocalizerSettings(Section):
    """How odometry and gripper tags become a pose."""

    smoothing: Positive = 0.8  # [s] over which one gripper's tags correct odometry; with both, half of it
    odometry_age: Positive = 0.3  # [s] without odometry at which the pose is lost
    tag_age: Positive = 1.0  # [s] without a tag of either gripper at which it is lost
    jump: Positive = 0.3  # [m] off what is known at which a tag is not believed
    jump_yaw: Positive = 0.5  # [rad]


class BaseLocalizer:
    """Fuses odometry and gripper tags into the pose of `base` in `world`.

    Args:
        kinematics: of the robot.
        settings: time constants and gates.
    """

    def __init__(self, kinematics: RobotKinematics, settings: LocalizerSettings | None = None) -> None:
        self._kinematics = kinematics
        self._settings = settings or LocalizerSettings()
        self._odometry: deque[tuple[float, Array]] = deque()
        self._odom: Array | None = None  # (3,) of `odom` in `world`
        self._tags: dict[str, float] = {}  # time of each gripper's last tag

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` at a time [s]; what is not finite or not new is left out.

        Where it is older than anything that is kept the clock was set back, and all that was known is void.
        """
        here = np.array(pose, dtype=float)
        if here.shape != (3,) or not np.isfinite([time, *here]).all():
            return
        if self._odometry and time < self._odometry[-1][0] - HISTORY:
            self._odometry.clear()
            self._tags.clear()
            self._odom = None
        if self._odometry and time <= self._odometry[-1][0]:
            return
        self._odometry.append((time, here))
        while self._odometry[0][0] < time - HISTORY:
            self._odometry.popleft()

    def tag(self, side: str, tag: Tag, posture: Posture) -> None:
        """Take in a gripper's tag, with the posture it was taken in.

        Left out are tags that are not finite, not new, of a moment without odometry, or too far from what is known.
        """
        if not tag.finite() or not np.isfinite(posture.vector()).all() or tag.time <= self._tags.get(side, -math.inf):
            return
        odometry = self._odometry_at(tag.time)
        if odometry is None:
            return
        seen = self._base_from(side, tag, posture)
        if self._odom is None:
            self._odom = compose(seen, inverse(odometry))
        else:
            before = compose(self._odom, odometry)
            away = np.array([*(seen[:2] - before[:2]), wrap(seen[2] - before[2])])
            if np.hypot(*away[:2]) > self._settings.jump or abs(away[2]) > self._settings.jump_yaw:
                return
            since = min(tag.time - self._tags.get(side, -math.inf), LONGEST_PERIOD)
            share = 1.0 - math.exp(-since / self._settings.smoothing)
            self._odom = compose(before + share * away, inverse(odometry))
        self._tags[side] = tag.time

    def pose(self, now: float) -> Array | None:
        """Return the pose (3,) of `base` in `world` [m, rad]; None where it is not known, see `fault`."""
        if self.fault(now) or self._odom is None:
            return None
        return compose(self._odom, self._odometry[-1][1])

    def fault(self, now: float) -> str:
        """Return why the pose is not known at `now` [s], in one line; empty where it is."""
        settings = self._settings
        # What is ahead of the clock by so much was heard before the clock was set back.
        if not self._odometry or abs(now - self._odometry[-1][0]) > settings.odometry_age:
            return f"odometry: expected one in the last {settings.odometry_age} s, got none"
        if not self._tags or abs(now - max(self._tags.values())) > settings.tag_age:
            return f"gripper tags: expected a plausible one in the last {settings.tag_age} s, got none"
        return ""

    def _odometry_at(self, time: float) -> Array | None:
        """Return odometry's pose (3,) at a time within what is kept, between its samples; None outside."""
        index = bisect.bisect_left(self._odometry, time, key=lambda entry: entry[0])
        if index == len(self._odometry):
            newest = bool(self._odometry) and time - self._odometry[-1][0] <= self._settings.odometry_age
            return self._odometry[-1][1] if newest else None
        later, after = self._odometry[index]
        if index == 0:
            return after if later == time else None
        earlier, before = self._odometry[index - 1]
        share = (time - earlier) / (later - earlier)
        x, y = before[:2] + share * (after[:2] - before[:2])
        return np.array([x, y, wrap(before[2] + share * wrap(after[2] - before[2]))])

    def _base_from(self, side: str, tag: Tag, posture: Posture) -> Array:
        """Return the pose (3,) of `base` in `world` that a gripper's tag shows.

        The base stands level, so the tag's tilt, its noisiest part, is used for the yaw alone.
        """
        frame = self._kinematics.frame(posture, f"{side}_ft")
        axes = np.column_stack([rotate_vector(tag.quaternion, axis) for axis in np.eye(3)])
        turned = axes @ frame.rotation.T
        yaw = math.atan2(turned[1, 0], turned[0, 0])
        x, y = tag.position[:2] - rotation(yaw) @ frame.position[:2]
        return np.array([x, y, yaw])
