"""A closed grip is put to the test before anything is done with it: a slight pull and back, then the course.

What is held resists, by its wheels' friction if by nothing else, and comes along. Hands that hold nothing feel
nothing but their own inertia, which is the same both ways; hands that slip feel friction, and the object stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.course import Course, CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.fetching.settings import GripTestSettings
from pbrl_control.percept import Percept, gripper_tag, object_planar, plates_planar
from pbrl_control.planar import Array, compose, inverse
from pbrl_control.types import Hold, PlanarTwist

LATE = 0.15  # [s] by which a camera's pictures may be late; those of before are left out
FEWEST = 3  # pictures that a place on the edge is averaged over, readings of a wrist each way


@dataclass
class _Mean:
    """A mean that is added to."""

    total: Array = field(default_factory=lambda: np.zeros(2))
    count: float = 0.0

    def add(self, value: Array, weight: float = 1.0) -> None:
        self.total = self.total + weight * value
        self.count += weight

    @property
    def value(self) -> Array:
        return self.total / self.count


@dataclass
class GripReading:
    """What the test has found of one grip.

    Attributes:
        force: [N] standard deviation of the horizontal force over the pull and the way back: of a force that turns
            round with the motion it is the size, and two hands that strain against each other are felt too.
        slip: [m] that the plates have moved on the edge along the pull.
    """

    force: float
    slip: float


class _Watched:
    """One grip during the test: forces there and back, places on the edge before the pull and at its end."""

    def __init__(self) -> None:
        self.forces, self.squares = _Mean(), _Mean()
        self.felt = {"pull": 0, "back": 0}  # readings
        self.places = {"before": _Mean(), "far": _Mean()}
        self._last = -math.inf

    def feel(self, way: str, wrench: Array, weight: float) -> None:
        """Take in a wrist reading (6,), in proportion to the speed at which it was taken."""
        if np.isfinite(wrench).all():
            force = np.asarray(wrench[:2], dtype=float)
            self.forces.add(force, weight)
            self.squares.add(force**2, weight)
            self.felt[way] += 1

    def see(self, stop: str, time: float, place: Array) -> None:
        """Take in a place (2,) on the edge that was seen at `time` [s], once."""
        if time > self._last:
            self._last = time
            self.places[stop].add(place)

    def reading(self, pull: Array) -> GripReading | None:
        """Return what was found by a pull along a unit vector (2,); None where a sensor said too little."""
        if min(self.felt.values()) < FEWEST:
            return None
        if any(mean.count < FEWEST for mean in self.places.values()):
            return None
        variance = float(np.sum(self.squares.value - self.forces.value**2))
        way = self.places["far"].value - self.places["before"].value
        return GripReading(math.sqrt(max(variance, 0.0)), float(way @ pull))


class ConfirmedCourse:
    """Tests the grips, then follows a course and goes on watching for slip.

    Args:
        name: of the object.
        settings: of the test.
        course: what comes after it; None: nothing.

    Attributes:
        confirmed: whether the grips have passed.
        readings: by gripper, once measured.
    """

    def __init__(self, name: str, settings: GripTestSettings, course: Course | None = None) -> None:
        self.confirmed = False
        self.readings: dict[str, GripReading] = {}
        self._name, self._settings, self._course = name, settings, course
        self._begun: float | None = None
        self._pull = np.zeros(2)  # unit vector, object axes
        self._watched: dict[str, _Watched] = {}
        self._places: dict[str, Array] = {}  # smoothed place (2,) of each grip on the edge during the course
        self._homes: dict[str, Array] = {}
        self._slips: float | None = None

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        """See `Course.step`."""
        if self.confirmed:
            if self._course is None:
                return CourseStep(PlanarTwist(), "held", finished=True)
            self._check_slip(now, dt, percept)
            return self._course.step(now, dt, percept, hold, forces)
        if self._begun is None:
            self._begun = now
            self._pull = -np.array([math.cos(hold.yaw), -math.sin(hold.yaw)])  # against the approach
            self._watched = {side: _Watched() for side in percept.grips}
        return self._test(now, percept)

    def _test(self, now: float, percept: Percept) -> CourseStep:
        """Stand, pull, stand, go back; each a stretch of time."""
        assert self._begun is not None
        still, duration = self._settings.still, self._settings.duration
        t = now - self._begun
        if t < still:
            self._look("before", self._begun - LATE, percept)
            return CourseStep(PlanarTwist(), "about to pull slightly")
        if t < still + duration:
            return self._move("pull", 1.0, (t - still) / duration, percept)
        if t < 2.0 * still + duration + LATE:
            self._look("far", self._begun + still + duration, percept)
            return CourseStep(PlanarTwist(), "pulled slightly")
        if t < 2.0 * still + 2.0 * duration + LATE:
            return self._move("back", -1.0, (t - 2.0 * still - duration - LATE) / duration, percept)
        self._judge()
        self.confirmed = True
        felt = ", ".join(f"{side} {reading.force:.1f} N" for side, reading in self.readings.items())
        return CourseStep(PlanarTwist(), f"the grip holds: {felt}")

    def _move(self, way: str, sign: float, share: float, percept: Percept) -> CourseStep:
        """Go along the pull, at a speed that rises and falls smoothly: its acceleration averages out."""
        weight = math.sin(math.pi * share) ** 2
        speed = sign * 2.0 * self._settings.distance / self._settings.duration * weight
        for side, watched in self._watched.items():
            if side in percept.wrenches:
                watched.feel(way, percept.wrenches[side], weight)
        vx, vy = map(float, speed * self._pull)
        return CourseStep(PlanarTwist(vx, vy), "pulling slightly" if sign > 0.0 else "going back")

    def _look(self, stop: str, since: float, percept: Percept) -> None:
        for side, watched in self._watched.items():
            seen = self._place(side, percept)
            if seen is not None and seen[0] >= since:
                watched.see(stop, *seen)

    def _place(self, side: str, percept: Percept) -> tuple[float, Array] | None:
        """Return when both tags were seen [s], and where the plates are in the object's frame (2,) [m]."""
        tag, own = percept.tags.get(self._name), percept.tags.get(gripper_tag(side))
        if tag is None or own is None or not (tag.finite() and own.finite()):
            return None
        plates, _ = plates_planar(side, own)
        return min(tag.time, own.time), compose(inverse(object_planar(tag)), plates)[:2]

    def _judge(self) -> None:
        """Raise ControlError where a grip does not hold."""
        settings = self._settings
        for side, watched in self._watched.items():
            reading = watched.reading(self._pull)
            if reading is None:
                raise ControlError(
                    f"grip test: expected forces at the {side} wrist and tags of {self._name!r} and of the {side} "
                    f"gripper during a pull, got too few; are sensor and camera on?"
                )
            self.readings[side] = reading
            pull = 1e3 * settings.distance
            if reading.force < settings.least_force:
                raise ControlError(
                    f"grip test: expected at least {settings.least_force:.1f} N at the {side} gripper as it pulls "
                    f"{self._name!r} by {pull:.0f} mm, got {reading.force:.2f} N: it holds nothing; look at its plates"
                )
            if reading.slip > settings.most_slip * settings.distance:
                raise ControlError(
                    f"grip test: expected {self._name!r} to come along as the {side} gripper pulls by {pull:.0f} mm, "
                    f"but the plates moved {1e3 * reading.slip:.0f} mm on the edge: they slip; clean or tighten them"
                )

    def _check_slip(self, now: float, dt: float, percept: Percept) -> None:
        """Raise ControlError where a grip has moved on the edge since the test."""
        share = 1.0 - math.exp(-dt / self._settings.slip_time)
        worst, most = "", 0.0
        for side in self._watched:
            seen = self._place(side, percept)
            if seen is None:
                continue
            home = self._homes.setdefault(side, self._watched[side].places["before"].value)
            place = self._places.get(side, home)
            self._places[side] = place = place + share * (seen[1] - place)
            if (way := float(np.hypot(*(place - home)))) > most:
                worst, most = side, way
        if most <= self._settings.course_slip:
            self._slips = None
        elif self._slips is None:
            self._slips = now
        elif now - self._slips > self._settings.slip_time:
            raise ControlError(
                f"{worst} grip on {self._name!r}: expected it to stay within {self._settings.course_slip:.3f} m of "
                f"where it closed, but it moved {most:.3f} m on the edge: it slips; go slower or grasp elsewhere"
            )
