"""Following a path of the base: velocities from where the base is now. Pure; the time is given.

The thesis steers by thresholds: turn towards the waypoint while further than 5 cm from it (45), and drive
only while the heading is within 0.01 rad of it (46). Within those 5 cm nothing steers sideways and the heading
turns away, so it ends 3 to 5 cm beside the goal; and pose noise of 1 mm and 0.1 degrees stops it some forty
times in 1.7 m. Here the robot follows the line of the leg, not the direction of the leg's end: heading and
distance from the line are fed back along the way driven (Kanayama et al. 1990), well-behaved to the end of the
leg. Of (46) is kept that the base stands and turns when its heading is off by much, of (45) that it turns to
the goal's heading last.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pbrl_control.navigation.motion import MotionChecker
from pbrl_control.navigation.path import BasePath, Leg
from pbrl_control.navigation.settings import TrackerSettings
from pbrl_control.planar import Array, wrap
from pbrl_control.settings import BaseSettings

LONGEST_PERIOD = 0.1  # [s] that a command is reckoned to have lasted at most
BRAKE_SHARE = 0.4  # of the acceleration limit, that braking ahead of an end is planned with
APPROACH_RATE = 2.0  # [1/s] speed near an end for each metre or radian left
FAR = 0.2  # [m, rad] commanded, below which nobody asks where it led
SLOW, STILL = 0.02, 1e-3  # [m/s, rad/s] no longer under way; standing


class TrackStatus(StrEnum):
    """What the tracker is at."""

    MOVING = "on the way"
    WAITING = "standing until what is wrong is over"
    ARRIVED = "at the goal"
    FAILED = "given up; plan again"


@dataclass(frozen=True)
class TrackCommand:
    """Base velocities: v forward [m/s], omega [rad/s]; and, unless all is well, why, in one line.

    Given up because something held the base up on a drive, `struck` is above zero where that went forwards, below it
    where backwards, see `Struck.add`; else it is zero.
    """

    v: float
    omega: float
    status: TrackStatus
    reason: str = ""
    struck: int = 0


@dataclass
class _Stretch:
    """A while of driving or turning on one leg.

    Attributes:
        doing: number of the leg, and whether it is driven or turned on.
        since, last: from when until when it is counted [s].
        here: (3,) where it began [m, rad].
        commanded: how far the commands went [m or rad].
    """

    doing: tuple[int, bool]
    since: float
    last: float
    here: Array
    commanded: float = 0.0


class PathTracker:
    """Drives along one path; make a new one for a new path.

    Args:
        path: to follow.
        limits: of the base.
        settings: gains, tolerances, patience.
        checker: robot and map, to stop before what is in the way; None: nothing is looked for.
    """

    def __init__(
        self,
        path: BasePath,
        limits: BaseSettings,
        settings: TrackerSettings | None = None,
        checker: MotionChecker | None = None,
    ) -> None:
        self._path = path
        self._limits = limits
        self._settings = settings or TrackerSettings()
        self._checker = checker.bare(self._settings.slack) if checker else None
        self._leg = 0
        self._driving = False
        self._velocity = np.zeros(2)
        self._last: float | None = None
        self._trouble: float | None = None  # [s] since when it stands and waits
        self._progress: tuple[float, Array] | None = None
        self._stretch: _Stretch | None = None
        self._ended: tuple[TrackStatus, str] | None = None
        self._struck = 0

    def update_map(self, checker: MotionChecker) -> None:
        """Take in what is known of the floor now."""
        self._checker = checker.bare(self._settings.slack)

    def step(self, now: float, pose: Sequence[float] | Array | None) -> TrackCommand:
        """Return the velocities to drive with from now on.

        Args:
            now: [s]; where it has run backwards what is waited for is waited for anew.
            pose: (3,) of `base` in `world` [m, rad]; None where it is not known.
        """
        if self._last is not None and now < self._last:  # a clock that was set back
            self._progress = self._stretch = None
            self._trouble = None if self._trouble is None else now
        dt = 0.0 if self._last is None else float(np.clip(now - self._last, 0.0, LONGEST_PERIOD))
        self._last = now
        if self._ended:
            return self._command(0.0, 0.0, dt, *self._ended)
        here = np.full(3, np.nan) if pose is None else np.array(pose, dtype=float)
        if here.shape != (3,) or not np.isfinite(here).all():
            return self._wait(now, dt, "pose of the base: lost" if pose is None else "pose of the base: not finite")
        failure, held_up = self._off_path(here), self._held_up(now, here)
        if failure or held_up:
            self._struck = self._way if self._driving and not failure else 0
            failure = failure or held_up
            return self._end(dt, TrackStatus.FAILED, failure)
        v, omega = self._wish(here)
        if self._ended:
            return self._command(0.0, 0.0, dt, *self._ended)
        blocked = self._blocked(here, v, omega)
        if blocked:
            return self._wait(now, dt, f"{blocked} is in the way")
        self._trouble = None
        return self._command(v, omega, dt, TrackStatus.MOVING)

    def _wait(self, now: float, dt: float, reason: str) -> TrackCommand:
        """Stand; give up when it lasts too long."""
        self._progress = self._stretch = None
        self._trouble = now if self._trouble is None else self._trouble
        if now - self._trouble > self._settings.patience:
            return self._end(dt, TrackStatus.FAILED, f"{reason}, for more than {self._settings.patience} s")
        return self._command(0.0, 0.0, dt, TrackStatus.WAITING, reason)

    def _end(self, dt: float, status: TrackStatus, reason: str = "") -> TrackCommand:
        self._ended = (status, reason)
        return self._command(0.0, 0.0, dt, status, reason)

    def _command(self, v: float, omega: float, dt: float, status: TrackStatus, reason: str = "") -> TrackCommand:
        """Bring the velocities there as fast as the base's limits let it."""
        limits = self._limits
        least = -np.array([limits.speed, limits.yaw_rate])
        most = np.array([min(limits.speed, limits.forward_speed), limits.yaw_rate])
        change = dt * np.array([limits.acceleration, limits.yaw_acceleration])
        wanted = np.clip([v, omega], least, most)
        self._velocity = self._velocity + np.clip(wanted - self._velocity, -change, change)
        return TrackCommand(float(self._velocity[0]), float(self._velocity[1]), status, reason, self._struck)

    @property
    def _way(self) -> int:
        """Return which way the base drives: 1 forwards, -1 backwards."""
        return -1 if self._velocity[0] < 0.0 else 1

    def _off_path(self, here: Array) -> str:
        """Return that the base is too far from the path, where it is."""
        off = _distance_from(self._current, here[:2]) if self._current else _distance(here, self._path.goal)
        most = self._settings.off_path
        return f"path: expected to stay within {most} m of it, is {off:.2f} m away" if off > most else ""

    def _held_up(self, now: float, here: Array) -> str:
        """Return that the base does not move as it is told to, where it does not."""
        moving = bool(np.abs(self._velocity).max() > self._settings.creeping)
        if self._progress is None or not moving or np.abs(here - self._progress[1]).max() > self._settings.budge:
            self._progress = (now, here)
        elif now - self._progress[0] > self._settings.stall:
            return f"base: expected to move as commanded, has stood for {self._settings.stall} s"
        return self._headway(now, here)

    def _headway(self, now: float, here: Array) -> str:
        """Say where driving leads nowhere: slipping wheels and jittering poses look like motion from tick to tick."""
        doing = (self._leg, self._driving)
        if self._stretch is None or self._stretch.doing != doing:
            self._stretch = _Stretch(doing, now, now, here)
        stretch, settings = self._stretch, self._settings
        stretch.commanded += abs(float(self._velocity[0 if self._driving else 1])) * min(
            now - stretch.last, LONGEST_PERIOD
        )
        stretch.last = now
        if now - stretch.since < settings.headway:
            return ""
        came = _distance(here, stretch.here) if self._driving else abs(wrap(float(here[2] - stretch.here[2])))
        asked = stretch.commanded
        self._stretch = None
        if came >= settings.got_on * asked or asked < FAR:
            return ""
        unit = "m" if self._driving else "rad"
        return (
            f"base: expected to come {asked:.2f} {unit} in {settings.headway:g} s, came {came:.2f}; is something that "
            "is not on the map in the way?"
        )

    @property
    def _current(self) -> Leg | None:
        return self._path.legs[self._leg] if self._leg < len(self._path.legs) else None

    def _error(self, here: Array) -> float:
        """Return how far the base has to turn to face as the path does, where it is on it [rad]."""
        return wrap((self._current.heading if self._current else float(self._path.goal[2])) - float(here[2]))

    def _wish(self, here: Array) -> tuple[float, float]:
        """Return the velocities that the path asks for, going on to its next part where one is done."""
        leg, error = self._current, self._error(here)
        if self._driving and leg:
            left = float((leg.end - leg.start) @ (leg.end - here[:2])) / leg.length
            there = abs(left) <= self._settings.reached and abs(self._velocity[0]) <= SLOW
            if not there and abs(error) <= self._settings.turn_again:
                return self._drive(leg, here, left, error)
            if there:
                self._leg += 1
            self._driving = False
            return 0.0, 0.0
        if abs(self._velocity[0]) > STILL:  # stop first, then turn
            return 0.0, 0.0
        if abs(error) > self._settings.aligned or abs(self._velocity[1]) > SLOW:
            return 0.0, math.copysign(self._ending(abs(error), turning=True), error)
        if leg:
            self._driving = True
            return 0.0, 0.0
        self._arrive(here)
        return 0.0, 0.0

    def _drive(self, leg: Leg, here: Array, left: float, error: float) -> tuple[float, float]:
        """Return velocities that come back to the leg's line over a given length, critically damped.

        An end that was run past, as late poses make it, is gone back to.
        """
        ahead = np.array([math.cos(leg.heading), math.sin(leg.heading)])
        x, y = here[:2] - leg.start
        beside = ahead[0] * y - ahead[1] * x  # to the left of the line, as the base faces
        speed = self._ending(abs(left), turning=False) * max(math.cos(error), 0.0)
        v = min(math.copysign(speed, -left if leg.reverse else left), self._limits.forward_speed)
        speed = abs(v)
        k = 1.0 / self._settings.recovery
        omega = 2.0 * k * speed * error - k**2 * v * beside
        most = self._limits.yaw_rate
        if abs(omega) > most:  # slow down rather than leave the line
            v, omega = v * most / abs(omega), math.copysign(most, omega)
        return v, omega

    def _ending(self, left: float, *, turning: bool) -> float:
        """Return the speed from which the base can stop within what is left [m or rad]."""
        limits = self._limits
        most, rate = (limits.yaw_rate, limits.yaw_acceleration) if turning else (limits.speed, limits.acceleration)
        return min(most, math.sqrt(2.0 * BRAKE_SHARE * rate * left), APPROACH_RATE * left)

    def _blocked(self, here: Array, v: float, omega: float) -> str:
        """Return what the base would run into before it could stop, in words; empty where it is free."""
        if self._checker is None:
            return ""
        speed = abs(self._velocity[0]) if abs(self._velocity[0]) > abs(v) else abs(v)
        if self._driving and self._current:
            stop = speed**2 / (2.0 * self._limits.acceleration) + self._settings.look_ahead
            left = float(np.hypot(*(self._current.end - here[:2])))
            way = math.copysign(min(stop, left), v) * np.array([math.cos(here[2]), math.sin(here[2])])
            return self._checker.drive_fault(here[:2], here[:2] + way, float(here[2]))
        if omega == 0.0:
            return ""
        stop = omega**2 / (2.0 * self._limits.yaw_acceleration) + self._settings.look_ahead
        turn = math.copysign(min(stop, abs(self._error(here))), omega)  # in a narrow gap there is no room past it
        return self._checker.pose_fault(here + np.array([0.0, 0.0, turn]))

    def _arrive(self, here: Array) -> None:
        """End, well or badly, when the base stands at the end of the path."""
        if np.abs(self._velocity).max() > STILL:
            return
        off, yaw = _distance(here, self._path.goal), abs(wrap(self._path.goal[2] - here[2]))
        settings = self._settings
        if off <= settings.position_tolerance and yaw <= settings.yaw_tolerance:
            self._ended = (TrackStatus.ARRIVED, "")
        else:
            self._ended = (
                TrackStatus.FAILED,
                f"goal: expected within {settings.position_tolerance} m and {settings.yaw_tolerance:.4f} rad of it, "
                f"stands {off:.3f} m and {yaw:.4f} rad away",
            )


def _distance(a: Array, b: Array) -> float:
    return float(np.hypot(*(a[:2] - b[:2])))


def _distance_from(leg: Leg, point: Array) -> float:
    """Return the distance of a point (2,) from a leg [m]."""
    way = leg.end - leg.start
    share = float(np.clip(way @ (point - leg.start) / (way @ way), 0.0, 1.0))
    return float(np.hypot(*(leg.start + share * way - point)))
