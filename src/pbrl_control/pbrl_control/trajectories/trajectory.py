"""Object trajectories: timed planar poses of an object in `world`, made of pieces of constant direction.

A piece goes from rest to rest along a screw: its twist in the object's axes keeps its direction, so that it is a
straight line, an arc or a turn about any point, and only its speed changes, by trapezoidal timing. Between
waypoints that is the shortest path of the plane's motions; about a locked caster it is the one the table can do.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import pinocchio

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, compose, inverse
from pbrl_control.settings import Positive, Section
from pbrl_control.trajectories.timing import Trapezoid

PLANE = pinocchio.liegroups.SE2()
STAND = 1e-9  # [m] and [rad] shorter than this a piece goes nowhere


class MotionLimits(Section):
    """How fast an object may be moved; speed is that of its origin.

    Attributes:
        speed: [m/s].
        yaw_rate: [rad/s].
        acceleration: [m/s^2] along the path.
        yaw_acceleration: [rad/s^2].
    """

    speed: Positive = 0.15
    yaw_rate: Positive = 0.2
    acceleration: Positive = 0.15
    yaw_acceleration: Positive = 0.2


@dataclass(frozen=True)
class Setpoint:
    """Where an object is to be at one moment.

    Attributes:
        pose: (3,) in `world` [m, rad].
        twist: (3,) of its origin in its axes [m/s, rad/s].
        rate: (3,) how the components of the twist change [m/s^2, rad/s^2].
    """

    pose: Array
    twist: Array
    rate: Array


class Trajectory(Protocol):
    """Anything that says where an object is to be when."""

    @property
    def duration(self) -> float:
        """Time from the start to the end [s]."""
        ...

    def at(self, time: float) -> Setpoint:
        """Return the setpoint at a time since the start [s]; at rest before the start and after the end."""
        ...


@dataclass(frozen=True)
class Piece:
    """One screw motion from rest to rest.

    Attributes:
        start: (3,) pose in `world` [m, rad].
        way: (3,) constant twist times time: (dx, dy) [m] and turn [rad] in the object's axes.
        timing: over the share of the way that is done, 0..1.
    """

    start: Array
    way: Array
    timing: Trapezoid

    def at(self, time: float) -> Setpoint:
        """Return the setpoint at a time since the piece's start [s]."""
        share, speed, change = self.timing.at(time)
        return Setpoint(move(self.start, share * self.way), speed * self.way, change * self.way)


class ObjectTrajectory:
    """Pieces one after the other.

    Args:
        start: (3,) pose in `world` [m, rad].
        ways: (n, 3) of the pieces, see `Piece.way`.
        limits: on the motion.
        ceilings: (n, 3) most that each component of the twist may be in each piece, beside the limits; None: no more.

    Raises:
        ControlError: a number is not finite, or there is nothing to do.
    """

    def __init__(self, start: Array, ways: Array, limits: MotionLimits, ceilings: Array | None = None) -> None:
        steps = np.asarray(ways, dtype=float).reshape(-1, 3)
        pose = np.array(start, dtype=float)
        if pose.shape != (3,) or not np.isfinite(pose).all() or not np.isfinite(steps).all():
            raise ControlError(f"trajectory: expected finite poses, got start {pose.tolist()} and {steps.tolist()}")
        if not len(steps):
            raise ControlError("trajectory: expected at least one waypoint or segment, got none")
        tops = np.full(steps.shape, np.inf) if ceilings is None else np.abs(ceilings)
        pieces = []
        for way, top in zip(steps, tops, strict=True):
            pieces.append(Piece(pose, way, _timing(way, limits, top)))
            pose = move(pose, way)
        self.pieces = tuple(pieces)
        self._ends = np.cumsum([piece.timing.duration for piece in pieces])

    @classmethod
    def through(cls, start: Array, waypoints: Sequence[Array], limits: MotionLimits) -> Self:
        """Make one that starts at a pose (3,) and stops at each waypoint (3,), all in `world` [m, rad].

        From one to the next it turns the short way round.

        Raises:
            ControlError: a number is not finite, or there is nothing to do.
        """
        poses = np.array([start, *waypoints], dtype=float)
        if poses.shape[1:] != (3,) or not np.isfinite(poses).all():
            raise ControlError(f"trajectory: expected finite poses (x, y, theta), got {poses.tolist()}")
        ways = [between(a, b) for a, b in itertools.pairwise(poses)]
        return cls(poses[0], np.array(ways), limits)

    @classmethod
    def of_twists(cls, start: Array, twists: Array, durations: Array, limits: MotionLimits) -> Self:
        """Make one of constant twists, each held for a duration; ramps come on top, and cover no more ground.

        Args:
            start: (3,) pose in `world` [m, rad].
            twists: (n, 3) of the object's origin in its axes, none above the limits [m/s, rad/s].
            durations: (n,) [s], above zero.
            limits: on the motion.

        Raises:
            ControlError: a twist is zero or above the limits, a number is not finite, or there is nothing to do.
        """
        rows, times = np.asarray(twists, dtype=float).reshape(-1, 3), np.asarray(durations, dtype=float)
        if not np.abs(rows).max(axis=1, initial=0.0).all() or not (times > 0.0).all():
            raise ControlError("trajectory: expected twists that move, for durations above zero, got one that does not")
        fastest = float(np.hypot(rows[:, 0], rows[:, 1]).max(initial=0.0))
        quickest = float(np.abs(rows[:, 2]).max(initial=0.0))
        if fastest > limits.speed + STAND or quickest > limits.yaw_rate + STAND:
            raise ControlError(
                f"trajectory: expected twists of at most {limits.speed} m/s and {limits.yaw_rate} rad/s, got "
                f"{fastest:.3f} m/s and {quickest:.3f} rad/s; slow down or raise the limits"
            )
        return cls(start, rows * times[:, None], limits, rows)

    @property
    def duration(self) -> float:
        """Time from the start to the end [s]."""
        return float(self._ends[-1])

    @property
    def start(self) -> Array:
        """First pose (3,) in `world`."""
        return self.pieces[0].start

    @property
    def end(self) -> Array:
        """Last pose (3,) in `world`."""
        return self.at(self.duration).pose

    def at(self, time: float) -> Setpoint:
        """Return the setpoint at a time since the start [s]; at rest before the start and after the end."""
        index = min(int(np.searchsorted(self._ends, time, side="left")), len(self.pieces) - 1)
        before = self._ends[index - 1] if index else 0.0
        return self.pieces[index].at(time - float(before))


class SampledTrajectory:
    """A trajectory given by its twist at even times; between them the twist changes evenly.

    Args:
        start: (3,) pose in `world` [m, rad].
        twists: (n, 3) of the object's origin in its axes, n >= 2 [m/s, rad/s].
        step: between samples [s].
    """

    def __init__(self, start: Array, twists: Array, step: float) -> None:
        self.step = step
        self.twists = np.asarray(twists, dtype=float)
        self.poses = np.empty_like(self.twists)
        self.poses[0] = start
        for k, middle in enumerate((self.twists[1:] + self.twists[:-1]) / 2.0):
            self.poses[k + 1] = move(self.poses[k], middle * step)

    @property
    def duration(self) -> float:
        """Time from the start to the end [s]."""
        return self.step * (len(self.twists) - 1)

    def at(self, time: float) -> Setpoint:
        """Return the setpoint at a time since the start [s]; at rest before the start and after the end."""
        if time <= 0.0 or time >= self.duration:
            return Setpoint(self.poses[0 if time <= 0.0 else -1].copy(), np.zeros(3), np.zeros(3))
        index = min(int(time / self.step), len(self.twists) - 2)
        rest = time - index * self.step
        rate = (self.twists[index + 1] - self.twists[index]) / self.step
        way = (self.twists[index] + 0.5 * rate * rest) * rest
        return Setpoint(move(self.poses[index], way), self.twists[index] + rate * rest, rate)


def move(pose: Array, way: Array) -> Array:
    """Return the pose (3,) after a screw motion `way` (3,) in the axes of `pose` [m, rad]."""
    x, y, c, s = PLANE.integrate(np.array([pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])]), way)
    return np.array([x, y, math.atan2(s, c)])


def between(start: Array, end: Array) -> Array:
    """Return the screw motion (3,) that takes the pose `start` to `end`, in the axes of `start`."""
    x, y, theta = compose(inverse(start), end)
    return np.array(PLANE.difference(PLANE.neutral, np.array([x, y, math.cos(theta), math.sin(theta)])))


def _timing(way: Array, limits: MotionLimits, ceiling: Array) -> Trapezoid:
    """Return the timing over 0..1 of a way under the limits; a way that goes nowhere takes no time."""
    length, turn = float(np.hypot(way[0], way[1])), abs(float(way[2]))
    if max(length, turn) < STAND:
        return Trapezoid(0.0, 1.0, 1.0)
    speeds = [limits.speed / max(length, STAND), limits.yaw_rate / max(turn, STAND)]
    speeds += [top / abs(part) for top, part in zip(ceiling, way, strict=True) if abs(part) > STAND]
    changes = [limits.acceleration / max(length, STAND), limits.yaw_acceleration / max(turn, STAND)]
    return Trapezoid(1.0, min(speeds), min(changes))
