"""What every manipulation has in common: what to grasp and where, how to come near, how to let go."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pbrl_control.settings import Finite, NotNegative, Positive, Section

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


class GraspPlan(Section):
    """From drive-up to the closed grip, and from the release to a step back.

    Attributes:
        name: of the plan.
        object: name of a body in the scene.
        grips: one or two.
        approach: how to come near.
        still: [s] at rest before the grippers close: sensor biases are taken then.
        settle: [s] at rest between closing and the first motion, and after the last.
        limits: what ends it early.
        retreat: how far the grippers back off after the release [m].
    """

    name: str
    object: str
    grips: Annotated[tuple[Grip, ...], Field(min_length=1, max_length=2)]
    approach: Approach = Approach()
    still: Positive = 0.5
    settle: Positive = 0.8
    limits: PushLimits = PushLimits()
    retreat: NotNegative = 0.10

    @model_validator(mode="after")
    def _one_grip_a_gripper(self) -> Self:
        sides = [grip.gripper for grip in self.grips]
        if len(set(sides)) != len(sides):
            raise ValueError(f"expected each gripper once in grips, got {', '.join(sides)}")
        return self
