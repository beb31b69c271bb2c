"""Limits, gains, distances and patience of the cart's local controller."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pbrl_control.planar import Array
from pbrl_control.settings import NotNegative, Positive, Range, Section


class CartLimits(Section):
    """What base and arms do at most.

    Attributes:
        speed: of the base in any direction [m/s].
        yaw_rate: of it [rad/s].
        articulation_rate: of the cart about the grip [rad/s].
        acceleration: with which speed grows [m/s^2].
        yaw_acceleration: the same of turning [rad/s^2].
        articulation_acceleration: the same of articulation [rad/s^2].
        braking: with which a speed goes down when it has to [m/s^2]; at least the acceleration.
        yaw_braking: the same of turning [rad/s^2].
        articulation_braking: the same of articulation [rad/s^2].
        articulation: least and greatest [rad].
    """

    speed: Positive = 0.35
    yaw_rate: Positive = 0.35
    articulation_rate: Positive = 0.3
    acceleration: Positive = 0.8
    yaw_acceleration: Positive = 0.8
    articulation_acceleration: Positive = 0.8
    braking: Positive = 2.0
    yaw_braking: Positive = 2.0
    articulation_braking: Positive = 2.0
    articulation: Range = (-0.8, 0.8)

    @model_validator(mode="after")
    def _brakes(self) -> Self:
        if (self.brakings < self.accelerations).any():
            raise ValueError(
                f"expected braking at least as strong as acceleration, got {self.brakings} and {self.accelerations}"
            )
        return self

    @property
    def speeds(self) -> Array:
        """(3,) of translation, yaw and articulation."""
        return np.array([self.speed, self.yaw_rate, self.articulation_rate])

    @property
    def accelerations(self) -> Array:
        """(3,) of translation, yaw and articulation."""
        return np.array([self.acceleration, self.yaw_acceleration, self.articulation_acceleration])

    @property
    def brakings(self) -> Array:
        """(3,) of translation, yaw and articulation."""
        return np.array([self.braking, self.yaw_braking, self.articulation_braking])


class ArmLawSettings(Section):
    """How the cart's motion becomes joint rates.

    Attributes:
        law: damped pseudo-inverse of the grasp Jacobian, or its transpose as in (14).
        threshold: smallest singular value below which damping sets in.
        damping: at a singularity.
        gain: of the transpose; none: the one with which as much as can be of the wished twist is done.
        margin: kept from the joints' stops [rad].
        acceleration: with which a joint can brake before its stop [rad/s^2].
    """

    law: Literal["pseudo-inverse", "transpose"] = "pseudo-inverse"
    threshold: Positive = 0.05
    damping: Positive = 0.08
    gain: Positive | None = None
    margin: NotNegative = 0.03
    acceleration: Positive = 3.0


class CartSettings(Section):
    """Everything the controller can be told.

    Attributes:
        period: of a tick [s]; thesis: 20 Hz.
        delay: from a command to its motion [s].
        frequency: at which errors die away, critically damped [rad/s].
        share: of the accelerations that the plan is timed with; the rest is for errors.
        slow_error: position error from which the goal goes slower along the plan [m].
        slow_angle: the same of heading and articulation [rad]. At three times either it waits.
        off_path: position error at which the plan is given up [m].
        off_angle: the same of heading and articulation [rad].
        near: distance to something lethal below which the robot goes slower [m].
        near_share: of its speed that is left where something is almost touched.
        margin: distance that counts as touching [m]; not more than what the planner keeps, or its plans are refused.
        look_ahead: [s] of the plan that has to be free.
        keep: [m] kept from what is in the way: so far some corner would still go before something is touched. Whoever
            stands there needs room to turn round.
        unknown_blocks: whether cells that nobody saw are not to be entered, those outside of the costmap among them.
        stop_within: time after the last message of a stream in which the robot stands, whatever its speed [s].
        scan_age: of the last scan at which the robot waits [s].
        pose_age: of the base's pose [s].
        articulation_age: of the cart's pose in the robot's frame [s].
        joints_age: of the joints' positions, by which the arms are led [s].
        misfit: by which the hands' distance may differ from that of what they hold [m].
        grip_gain: of bringing the cart back to the grip's place, K of (13) [1/s].
        grip_off: distance from there at which the cart is not where it is held [m].
        patience: [s] of waiting before the plan is given up.
        tolerance: at the goal [m].
        angle_tolerance: of heading and articulation at the goal [rad].
    """

    limits: CartLimits = CartLimits()
    arms: ArmLawSettings = ArmLawSettings()
    period: Annotated[Positive, Field(le=0.1)] = 0.05
    delay: Annotated[NotNegative, Field(le=0.5)] = 0.02
    frequency: Annotated[Positive, Field(le=10.0)] = 3.5
    share: Annotated[float, Field(ge=0.1, le=0.9)] = 0.5
    slow_error: Positive = 0.02
    slow_angle: Positive = 0.025
    off_path: Positive = 0.20
    off_angle: Positive = 0.35
    near: Annotated[NotNegative, Field(le=0.5)] = 0.15
    near_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    margin: Annotated[NotNegative, Field(le=0.3)] = 0.0
    look_ahead: Annotated[Positive, Field(le=5.0)] = 1.0
    keep: Annotated[NotNegative, Field(le=1.0)] = 0.12
    unknown_blocks: bool = False
    stop_within: Positive = 0.3
    scan_age: Positive = 0.15
    pose_age: Positive = 0.15
    articulation_age: Positive = 0.3
    joints_age: Positive = 0.15
    misfit: Positive = 0.03
    grip_gain: NotNegative = 1.0
    grip_off: Positive = 0.08
    patience: Positive = 5.0
    tolerance: Positive = 0.02
    angle_tolerance: Positive = 0.025

    @model_validator(mode="after")
    def _stops(self) -> Self:
        if self.stop_within <= self.period + self.delay:
            raise ValueError(
                f"expected stop_within above period and delay together, got {self.stop_within} s and "
                f"{self.period + self.delay:g} s; nobody can stop before a command arrives"
            )
        if self.near < self.margin:
            raise ValueError(f"expected near at least margin, got {self.near} and {self.margin} m")
        return self
