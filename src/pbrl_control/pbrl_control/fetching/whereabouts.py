"""Where the base is and how the arms are: odometry, gripper tags and the posture that each tag was taken in."""

from __future__ import annotations

import bisect
from collections import deque

import numpy as np

from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.localizer import BaseLocalizer, LocalizerSettings
from pbrl_control.percept import Percept, gripper_tag
from pbrl_control.planar import Array, rotation

KEPT = 1.0  # [s] of postures: tags are late, and arms that stow are elsewhere by the time one comes


class Whereabouts:
    """The pose of `base` in `world`, from one percept after the other.

    Args:
        kinematics: of the robot.
        settings: of the localizer.
    """

    def __init__(self, kinematics: RobotKinematics, settings: LocalizerSettings) -> None:
        self._kinematics = kinematics
        self._localizer = BaseLocalizer(kinematics, settings)
        self._postures: deque[tuple[float, Posture]] = deque()

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` [m, rad] at a time [s]."""
        self._localizer.odometry(time, pose)

    def take(self, now: float, percept: Percept) -> None:
        """Take in joints and gripper tags as they are known at `now` [s]."""
        posture = percept.posture
        if self._postures and now < self._postures[-1][0]:  # a clock that was set back
            self._postures.clear()
        if posture is not None and np.isfinite(posture.vector()).all():
            self._postures.append((now, posture))
        while self._postures and self._postures[0][0] < now - KEPT:
            self._postures.popleft()
        for side in SIDES:
            tag = percept.tags.get(gripper_tag(side))
            then = None if tag is None else self._posture_at(tag.time)
            if tag is not None and then is not None:
                self._localizer.tag(side, tag, then)

    def posture(self) -> Posture | None:
        """Return the last finite posture; None where none has come lately."""
        return self._postures[-1][1] if self._postures else None

    def pose(self, now: float) -> Array | None:
        """Return the pose (3,) of `base` in `world` [m, rad]; None where it is not known, see `fault`."""
        return self._localizer.pose(now)

    def fault(self, now: float) -> str:
        """Return why the pose is not known at `now` [s], in one line; empty where it is."""
        return self._localizer.fault(now)

    def tips(self, now: float) -> dict[str, Array]:
        """Return where the ends of the plates are in `world`, (3,) [m] by gripper; nothing where that is not known."""
        pose, posture = self.pose(now), self.posture()
        if pose is None or posture is None:
            return {}
        found = {}
        for side in SIDES:
            tip = self._kinematics.tip(posture, side)
            found[side] = np.array([*(pose[:2] + rotation(float(pose[2])) @ tip[:2]), tip[2]])
        return found

    def _posture_at(self, time: float) -> Posture | None:
        """Return the posture nearest to a time within what is kept; None outside."""
        if not self._postures or not np.isfinite(time) or time < self._postures[0][0] - KEPT:
            return None
        index = bisect.bisect_left(self._postures, time, key=lambda entry: entry[0])
        near = [self._postures[k] for k in (index - 1, index) if 0 <= k < len(self._postures)]
        return min(near, key=lambda entry: abs(entry[0] - time))[1]
