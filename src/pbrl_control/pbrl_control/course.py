"""What an object does while it is held: the part of a manipulation between the closed grip and the release."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from pbrl_control.percept import Percept
from pbrl_control.planar import Array
from pbrl_control.profile import TwistProfile
from pbrl_control.push_plan import PushPlan
from pbrl_control.types import Hold, PlanarTwist


@dataclass(frozen=True)
class CourseStep:
    """What the object is to do now.

    Attributes:
        twist: of the object's origin in its axes.
        status: a sentence.
        finished: whether the course is over.
        expected: wrench (3,) that each grip is expected to apply to the object, by gripper: fx, fy [N], tau [N m] at
            its contact, object axes; empty where nobody knows.
    """

    twist: PlanarTwist
    status: str
    finished: bool = False
    expected: Mapping[str, Array] = field(default_factory=dict)


class Course(Protocol):
    """A way to move what is held."""

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        """Go on.

        Args:
            now: [s].
            dt: time since the last step [s].
            percept: what is seen.
            hold: the first grip's, with the object's yaw in the gripper.
            forces: horizontal force at each grip, bias removed [N].

        Raises:
            ControlError: it cannot go on, and why.
        """
        ...


class SegmentCourse:
    """The segments of a push plan, one after the other; what they do to the object is not looked at.

    Args:
        plan: the push.
    """

    def __init__(self, plan: PushPlan) -> None:
        self._count = len(plan.segments)
        self._profile = TwistProfile(plan)

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        """See `Course.step`."""
        twist = PlanarTwist(*map(float, self._profile.step(dt, hold)))
        status = f"segment {min(self._profile.segment + 1, self._count)} of {self._count}"
        return CourseStep(twist, status, self._profile.finished)
