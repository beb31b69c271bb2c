"""Push plans: what to grasp, how to come near, which twists to give it. YAML in `config/params/pushes/`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from pydantic import Field, model_validator

from pbrl_control.errors import ControlError
from pbrl_control.settings import Finite, NotNegative, Planar, Positive, Section, load_section

Point = tuple[Finite, Finite]
Side = Literal["left", "right"]


class Grip(Section):
    """Where one gripper closes.

    Attributes:
        gripper: "left" or "right".
        point: on the object's edge, in the object's frame; the nearest point of its outline is taken [m].
    """

    gripper: Side
    point: Point


class Approach(Section):
    """How the grippers come to the edge.

    Attributes:
        speed: [m/s] at most.
        depth: how far past the edge the middle of the plates goes [m].
        edge_below_top: middle of the edge below the top of the body [m]: half of a table top's thickness.
        timeout: [s].
    """

    speed: Annotated[float, Field(gt=0.0, le=0.3)] = 0.12
    depth: Annotated[float, Field(ge=0.0, le=0.04)] = 0.02
    edge_below_top: NotNegative = 0.0125
    timeout: Positive = 20.0


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


class PushLimits(Section):
    """What ends a push.

    Attributes:
        force: [N] horizontal, at any gripper, for longer than `force_time`.
        force_time: [s].
        tag_age: [s] without a tag of object or gripper.
        grasp_attempts: grasps tried before giving up.
    """

    force: Positive = 150.0
    force_time: Positive = 0.2
    tag_age: Positive = 1.0
    grasp_attempts: Annotated[int, Field(ge=1, le=10)] = 3


class PushPlan(Section):
    """One push from drive-up to release.

    Attributes:
        name: of the plan.
        object: name of a body in the scene.
        grips: one or two.
        approach: how to come near.
        still: [s] at rest before the grippers close: sensor biases are taken then.
        settle: [s] at rest between closing and the first segment, and after the last.
        acceleration: [m/s^2] with which twists change; yaw rates with `yaw_acceleration` [rad/s^2].
        segments: one after the other.
        limits: what ends it early.
        retreat: how far the grippers back off after the release [m].
    """

    name: str
    object: str
    grips: Annotated[tuple[Grip, ...], Field(min_length=1, max_length=2)]
    approach: Approach = Approach()
    still: Positive = 0.5
    settle: Positive = 0.8
    acceleration: Annotated[float, Field(gt=0.0, le=1.0)] = 0.25
    yaw_acceleration: Annotated[float, Field(gt=0.0, le=2.0)] = 0.5
    segments: Annotated[tuple[Segment, ...], Field(min_length=1)]
    limits: PushLimits = PushLimits()
    retreat: NotNegative = 0.10

    @model_validator(mode="after")
    def _one_grip_a_gripper(self) -> Self:
        sides = [grip.gripper for grip in self.grips]
        if len(set(sides)) != len(sides):
            raise ValueError(f"expected each gripper once in grips, got {', '.join(sides)}")
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
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = _installed_pushes() / f"{name_or_path}.yaml"
        if not path.exists():
            known = ", ".join(sorted(file.stem for file in path.parent.glob("*.yaml"))) or "none"
            raise ControlError(f"push plan: expected a path or one of {known}, got {str(name_or_path)!r}")
    return load_section(path, PushPlan, "push plan")


def _installed_pushes() -> Path:
    try:
        return Path(get_package_share_directory("pbrl_config")) / "params" / "pushes"
    except PackageNotFoundError as error:
        raise ControlError("push plan: expected package pbrl_config to be installed; run ./pbrl once") from error
