"""Push plans: what to grasp, how to come near, which twists to give it. YAML in `config/params/pushes/`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.installed import load_named
from pbrl_control.settings import Planar, Positive, Section


class Segment(Section):
    """A twist, held for a time.

    Attributes:
        twist: vx, vy [m/s], omega [rad/s].
        duration: [s], ramps included.
        frame: "object": of the object's origin, in its axes; "gripper": of the first grip's contact, in that
            gripper's axes: x along the gripper, y left.
    """

    twist: Planar
    duration: Positive
    frame: Literal["object", "gripper"] = "gripper"


class PushPlan(GraspPlan):
    """One push from drive-up to release.

    Attributes:
        acceleration: [m/s^2] with which twists change; yaw rates with `yaw_acceleration` [rad/s^2].
        segments: one after the other.
    """

    acceleration: Annotated[float, Field(gt=0.0, le=1.0)] = 0.25
    yaw_acceleration: Annotated[float, Field(gt=0.0, le=2.0)] = 0.5
    segments: Annotated[tuple[Segment, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _no_faster_than_furniture_goes(self) -> Self:
        for segment in self.segments:
            if max(abs(segment.twist[0]), abs(segment.twist[1])) > 0.5 or abs(segment.twist[2]) > 1.0:
                raise ValueError("segments: expected at most 0.5 m/s and 1.0 rad/s")
        return self

    @property
    def push_time(self) -> float:
        """Sum of the segments' durations [s]."""
        return sum(segment.duration for segment in self.segments)


def load_plan(name_or_path: str | Path) -> PushPlan:
    """Read a plan: a path, or the name of a file in `config/params/pushes/` of the installed workspace.

    Raises:
        ControlError: there is no such plan, or it is not as it should be.
    """
    return load_named(name_or_path, "pushes", PushPlan, "push plan")
