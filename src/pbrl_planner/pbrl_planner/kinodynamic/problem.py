"""What is asked: an object of known physics, held at a point, pushed with a limited wrench until a goal is met."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.planar import Array, rotation, wrap
from pbrl_model.kernel import GRAVITY
from pbrl_planner.collision import MovingOutlines
from pbrl_planner.errors import PlannerError

HINGE_SLACK = 0.02  # [m] that a start may be off what its hinge allows; tags are good to millimetres
GRIP_TORQUE = 50.0  # [N m] two grips 0.32 m apart that push and pull with 150 N each


@dataclass(frozen=True)
class WrenchLimits:
    """What the robot may exert where it holds the object: each component within plus and minus its limit.

    Attributes:
        force_x, force_y: along the object's axes [N]; 0: none.
        torque: about the held point [N m]; 0: none.
    """

    force_x: float
    force_y: float
    torque: float

    def __post_init__(self) -> None:
        values = self.array
        if not np.isfinite(values).all() or (values < 0.0).any() or not values.any():
            raise PlannerError(f"limits: expected finite forces and torque, not all zero, got {values.tolist()}")

    @property
    def array(self) -> Array:
        """The three limits [N, N, N m]."""
        return np.array([self.force_x, self.force_y, self.torque], dtype=float)

    @classmethod
    def to_move(
        cls, model: ObjectModel, *, acceleration: float = 0.5, most: float = 300.0, torque: float = GRIP_TORQUE
    ) -> Self:
        """Choose limits that overcome an object's friction and then accelerate it, within what grips give.

        Controls drawn out of far wider limits would all but always end at the speed limit at once.

        Args:
            model: the object's physics.
            acceleration: [m/s^2] of the centre of mass, and of the rim of its radius of gyration.
            most: force that the grips give, together [N].
            torque: that they give [N m].

        Raises:
            PlannerError: a number is not above zero.
        """
        for name, value in (("acceleration", acceleration), ("most", most), ("torque", torque)):
            if not (math.isfinite(value) and value > 0.0):
                raise PlannerError(f"limits: expected {name} above zero, got {value}")
        parameters, gyration = model.parameters, math.sqrt(model.inertia_per_mass)
        wheel = math.hypot(parameters.mu_x, parameters.mu_y)
        lever = float(np.hypot(*(model.wheel - model.com)))
        force = model.mass * (acceleration + GRAVITY * (wheel + parameters.mu_ground))
        moment = model.mass * (gyration * (acceleration + GRAVITY * parameters.mu_ground) + lever * GRAVITY * wheel)
        return cls(min(force, most), min(force, most), min(moment, torque))


@dataclass(frozen=True)
class Goal:
    """When the object is where it should be.

    Attributes:
        reached: says of a pose (3,) of the object's frame in `world` [m, rad] whether it will do, for instance
            whether an opening exists with the object there. Yaw is in [-pi, pi].
        pose: (3,) towards which the search is drawn; None: it spreads evenly.
    """

    reached: Callable[[Array], bool]
    pose: Array | None = None

    @classmethod
    def near(cls, pose: Array, distance: float = 0.1, angle: float = 0.2) -> Self:
        """Ask for a pose (3,), give or take a distance [m] and an angle [rad]; math.inf: any.

        Raises:
            PlannerError: the pose is not finite, or a tolerance is not above zero.
        """
        target = np.asarray(pose, dtype=float)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise PlannerError(f"goal: expected a finite pose (x, y, theta), got {pose}")
        if not (distance > 0.0 and angle > 0.0):
            raise PlannerError(f"goal: expected tolerances above zero, got {distance} m and {angle} rad")

        def reached(at: Array) -> bool:
            away = at - target
            return math.hypot(away[0], away[1]) <= distance and abs(wrap(float(away[2]))) <= angle

        return cls(reached, target)


@dataclass(frozen=True)
class PushProblem:
    """One object on the floor, held rigidly at a point.

    The robot is its wrench and what it covers of the floor: whether its base can drive as the object goes is not asked
    (thesis 6.2.1: an arm that moves in the plane by itself).

    Attributes:
        model: the object's physics and outline.
        start: (3,) where its frame is in `world` [m, rad].
        contact: (2,) where it is held, in its frame [m].
        limits: of the wrench there, in the object's axes, which turn with it.
        floor: room and all that stands in it, without the object.
        goal: what is wanted.
        holder: (k, 2) outline of what holds it and moves with it, in the object's frame [m], such as `Footprint.at` of
            the base's pose there; None: nothing that matters.
        twist: (3,) of the object's centre of mass at the start, axes of `world` [m/s, rad/s].
    """

    model: ObjectModel
    start: Array
    contact: Array
    limits: WrenchLimits
    floor: FloorMap
    goal: Goal
    holder: Array | None = None
    twist: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        sizes = {"start": (3, "x, y, theta"), "contact": (2, "x, y"), "twist": (3, "vx, vy, omega")}
        for name, (length, what) in sizes.items():
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != (length,) or not np.isfinite(values).all():
                raise PlannerError(f"{name}: expected finite ({what}), got {getattr(self, name)}")
            object.__setattr__(self, name, values)
        if self.goal.pose is not None and not (np.shape(self.goal.pose) == (3,) and np.isfinite(self.goal.pose).all()):
            raise PlannerError(f"goal: expected a finite pose (x, y, theta) or None, got {self.goal.pose}")
        self._check_hinge()
        fault = self.outlines.fault(self.start)
        if fault:
            raise PlannerError(f"start: expected it free of collision, but {fault}; move it or leave that out")

    @cached_property
    def outlines(self) -> MovingOutlines:
        """The object and what holds it, against the floor."""
        parts = {"the object": self.model.footprint}
        if self.holder is not None:
            parts["the robot"] = self.holder
        return MovingOutlines(parts, self.floor)

    def _check_hinge(self) -> None:
        parameters = self.model.parameters
        if not parameters.has_hinge:
            return
        anchor = self.start[:2] + rotation(float(self.start[2])) @ [parameters.anchor_x, parameters.anchor_y]
        length = math.hypot(anchor[0] - parameters.hinge_x, anchor[1] - parameters.hinge_y)
        if abs(length - parameters.hinge_radius) > HINGE_SLACK:
            raise PlannerError(
                f"start: expected the anchor {parameters.hinge_radius:.3f} m from its hinge, got {length:.3f} m"
            )
