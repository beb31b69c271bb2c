"""Driving along one planned way, while looking whether the object stays where the way leads."""

from __future__ import annotations

import numpy as np

from pbrl_control.errors import ControlError
from pbrl_control.fetching.settings import FetchSettings
from pbrl_control.fetching.surroundings import Surroundings
from pbrl_control.fetching.whereabouts import Whereabouts
from pbrl_control.grasping import GraspCandidate
from pbrl_control.navigation import KRANG_STOWED, FloorMap, MotionChecker, PathTracker, TrackStatus
from pbrl_control.planar import Array, compose, inverse
from pbrl_control.settings import BaseSettings
from pbrl_control.types import PlanarTwist


class WayLostError(ControlError):
    """A way or grasp has to be given up; another may do."""


class Drive:
    """One way to one grasp.

    Args:
        candidate: the grasp and the way to it.
        floor: the map on which it was planned.
        pose: (3,) of the object then, in `world` [m, rad].
        limits: of the base.
        settings: patience and tolerances.

    Attributes:
        candidate: the grasp.
    """

    def __init__(
        self, candidate: GraspCandidate, floor: FloorMap, pose: Array, limits: BaseSettings, settings: FetchSettings
    ) -> None:
        self.candidate = candidate
        self._pose = pose.copy()
        self._floor = floor
        self._settings = settings
        checker = MotionChecker(floor, KRANG_STOWED)
        self._tracker = PathTracker(candidate.path, limits, settings.tracker, checker)
        self._begun: float | None = None

    def step(self, now: float, where: Whereabouts, around: Surroundings) -> tuple[PlanarTwist, bool, str]:
        """Return the base's twist, whether it has arrived, and a sentence.

        Args:
            now: [s].
            where: is the base.
            around: stands what.

        Raises:
            WayLostError: this way is no good any more, and why.
            ControlError: what driving needs is not seen any more.
        """
        name, settings = self.candidate.object, self._settings
        self._begun = now if self._begun is None else min(now, self._begun)
        age = around.age(name, now)
        # Planning may have taken its time: what was not looked at meanwhile is not lost.
        if min(age, now - self._begun) > settings.tag_age + settings.patience:
            raise ControlError(
                f"drive: expected to see tag {name!r} on the way, last saw it {age:.1f} s ago; "
                f"bring it back into a camera's view"
            )
        self.check_object(around)
        if now - self._begun > settings.drive_timeout:
            raise WayLostError(f"drive: expected to arrive within {settings.drive_timeout:.0f} s, did not")
        self._look_out(around)
        lost = where.fault(now)
        blind = age > settings.tag_age
        command = self._tracker.step(now, None if blind else where.pose(now))
        if command.status == TrackStatus.FAILED and lost:
            raise ControlError(f"drive: {lost}; bring the grippers back into a camera's view, or check the odometry")
        if command.status == TrackStatus.FAILED and not blind:
            stopped, here = "", where.pose(now)
            if command.struck and here is not None:
                stopped = around.struck.add(self._floor, KRANG_STOWED, here, command.struck)
            raise WayLostError(f"drive: {command.reason}" + (f"; it is remembered as {stopped!r}" if stopped else ""))
        sentence = f"waiting to see tag {name!r} again" if blind else lost or command.reason or "on the way"
        return PlanarTwist(vx=command.v, omega=command.omega), command.status == TrackStatus.ARRIVED, sentence

    def check_object(self, around: Surroundings) -> None:
        """Raise WayLostError where the object is no longer where the way leads."""
        pose = around.pose(self.candidate.object)
        if pose is None:
            return
        away = compose(inverse(self._pose), pose)
        distance, turned = float(np.hypot(*away[:2])), abs(float(away[2]))
        if distance > self._settings.moved or turned > self._settings.moved_yaw:
            raise WayLostError(
                f"{self.candidate.object!r}: expected it to stay where the way leads, "
                f"it moved by {distance:.2f} m and {turned:.2f} rad"
            )

    def _look_out(self, around: Surroundings) -> None:
        """Give the tracker a new map where something has moved."""
        floor = around.floor()
        if floor is not self._floor:
            self._floor = floor
            self._tracker.update_map(MotionChecker(floor, KRANG_STOWED))
