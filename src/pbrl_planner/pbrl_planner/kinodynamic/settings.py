"""How the kinodynamic search steps, what it may do, how long, and what it calls near."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from pbrl_control.settings import NotNegative, Positive, Section


class KinodynamicSettings(Section):
    """Everything the kinodynamic RRT can be told.

    Attributes:
        dt: [s] step of the world model.
        substeps: of the world model in a control step: the unit in which a control lasts.
        shortest, longest: control steps that a control lasts.
        goal_bias: share of the samples that are the goal's pose, where there is one.
        speed: [m/s] most of the point that is held: the robot has to follow it.
        yaw_rate: [rad/s] most of the object.
        velocity_time: [s] metric: a difference of velocity counts as the way that it makes in this time. How a turn
            counts as a way is the object's own: its radius of gyration.
        come_to_rest: the plan ends with the object at rest, by braking at the goal.
        rest_speed: [m/s] sqrt(2 E / m) with the kinetic energy E, below which it is at rest.
        brake_steps: control steps that braking may take.
        iterations: most that the search begins.
        time_limit: [s] for the search.
    """

    dt: Positive = 0.01
    substeps: Annotated[int, Field(ge=1, le=100)] = 10
    shortest: Annotated[int, Field(ge=1)] = 1
    longest: Annotated[int, Field(ge=1, le=1000)] = 10
    goal_bias: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1
    speed: Positive = 0.35
    yaw_rate: Positive = 0.5
    velocity_time: NotNegative = 0.5
    come_to_rest: bool = True
    rest_speed: Positive = 0.01
    brake_steps: Annotated[int, Field(ge=1, le=1000)] = 20
    iterations: Annotated[int, Field(ge=1)] = 50_000
    time_limit: Positive = 10.0

    @model_validator(mode="after")
    def _lasts(self) -> Self:
        if self.shortest > self.longest:
            raise ValueError(f"expected shortest at most longest, got {self.shortest} and {self.longest}")
        return self

    @property
    def control_step(self) -> float:
        """Length of a control step [s]."""
        return self.dt * self.substeps
