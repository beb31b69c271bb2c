"""Which of the thesis's four model classes an object belongs to, and what it is then free to do (6.3.2, figure 40).

The thesis calls a wheel's axis constrained where its friction coefficient is above 0.3. That number knows nothing
of weight: a locked caster that carries a quarter of a table has 0.25 * 0.7 = 0.18 and resists with 57 N, a stool's
wheel of 0.5 with 10 N. So friction forces decide beside it: an axis holds where dragging the wheel along it
would take more than `drag_force`, and never where that takes less than `light_force`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Self

import numpy as np

from pbrl_control.constraints.object_model import ObjectModel, direction_row
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, compose, inverse, shift
from pbrl_control.settings import NotNegative, Positive, Section
from pbrl_model.kernel import GRAVITY

NEAR = 1e-9  # [m] nearer to its hinge than this an anchor has no direction to it


class ModelClass(StrEnum):
    """Thesis 6.3.2: what an object's physics lets it do."""

    STATIC = "static"
    UNCONSTRAINED = "unconstrained"
    ANISOTROPIC = "anisotropic"
    FIXED_POINT = "fixed-point"


class ConstraintSettings(Section):
    """What counts as a constraint.

    Attributes:
        friction: coefficient of a wheel's axis above which it holds (thesis 6.3.2).
        drag_force: friction [N] above which an axis holds whatever its coefficient: no push is meant to cost more.
        light_force: friction [N] up to which an axis never holds: it is dragged along unnoticed.
        grip_force: most that the robot exerts on an object, all grips together [N]; an object that needs more for
            each of its motions is static. 300 N is below the 320 N at which the plates' rubber slips on laminate.
        torque_arm: [m] a grip's torque tau counts as a force tau / torque_arm when grips share a wrench: the root of
            torsional over lateral stiffness of the plates' rubber, sqrt(20 N m/rad / 2e4 N/m).
    """

    friction: Positive = 0.3
    drag_force: Positive = 40.0
    light_force: NotNegative = 10.0
    grip_force: Positive = 300.0
    torque_arm: Positive = 0.032


DEFAULTS = ConstraintSettings()


@dataclass(frozen=True)
class Freedom:
    """What an object is free to do.

    Attributes:
        model_class: one of four.
        rows: (k, 3) constraints on the twist of the object's origin in its axes: those with rows @ twist = 0 are free.
        moves: (n, 3) the motions of figure 40 that are left, each in both directions, as such twists; a translation
            is of unit speed, a turn of unit rate. Empty for a static object.
        anchor: (2,) point of rotation in the object's frame [m]: centre of mass, wheel or hinge.
        least_force: force that the easiest of those motions needs [N].
        reason: a sentence; of a static object why, empty of an unconstrained one.
    """

    model_class: ModelClass
    rows: Array
    moves: Array
    anchor: Array
    least_force: float
    reason: str

    @classmethod
    def of(cls, model: ObjectModel, pose: Array | None = None, settings: ConstraintSettings = DEFAULTS) -> Self:
        """Find out what an object is free to do.

        Args:
            model: its physics.
            pose: (3,) of the object in `world` [m, rad]; needed where it hangs on a hinge at a distance.
            settings: what counts as a constraint.

        Raises:
            ControlError: a pose is needed and there is none, or it is not finite.
        """
        model_class, rows, moves, anchor, reason = _constraint(model, pose, settings)
        least = min(least_force(model, move, anchor) for move in moves)
        if least <= settings.grip_force:
            return cls(model_class, rows, moves, anchor, least, reason)
        why = f"moving it takes {least:.0f} N at least, the grips give {settings.grip_force:.0f} N"
        return cls(ModelClass.STATIC, np.eye(3), np.zeros((0, 3)), anchor, least, why)


def classify(model: ObjectModel, pose: Array | None = None, settings: ConstraintSettings = DEFAULTS) -> ModelClass:
    """Return the model class of an object; see `Freedom.of`.

    Raises:
        ControlError: as of `Freedom.of`.
    """
    return Freedom.of(model, pose, settings).model_class


def least_force(model: ObjectModel, move: Array, anchor: Array) -> float:
    """Return the force that keeps a motion going against friction, where it is applied best [N].

    By virtual power: what friction dissipates in the motion (3,) at the object's origin, over the speed of the point
    that is pushed: any for a translation, the corner of the footprint farthest from `anchor` (2,) for a turn.
    """
    corners = model.footprint - anchor
    reach = float(np.hypot(*corners.T).max())
    speed = reach * abs(move[2]) if move[2] else float(np.hypot(*move[:2]))
    return dissipation(model, move) / speed


def dissipation(model: ObjectModel, twist: Array) -> float:
    """Return the power that wheel and feet take out of a motion (3,) of the object's origin in its axes [W].

    The feet's friction is that of the world model: mu m g sqrt(v^2 + omega^2 I / m) of the centre of mass.
    """
    parameters, weight = model.parameters, model.mass * GRAVITY
    slip = model.wheel_axes @ shift(twist, model.wheel)[:2]
    centre = shift(twist, model.com)
    sliding = np.sqrt(centre[0] ** 2 + centre[1] ** 2 + model.inertia_per_mass * centre[2] ** 2)
    wheel = parameters.mu_x * abs(slip[0]) + parameters.mu_y * abs(slip[1])
    return float(weight * (wheel + parameters.mu_ground * sliding))


def held_axes(model: ObjectModel, settings: ConstraintSettings = DEFAULTS) -> tuple[bool, bool]:
    """Say which of the wheel's axes, x and y, hold."""
    held = []
    for mu in (model.parameters.mu_x, model.parameters.mu_y):
        force = mu * model.mass * GRAVITY
        held.append(force > settings.light_force and (mu > settings.friction or force > settings.drag_force))
    return held[0], held[1]


def hinge_centre(model: ObjectModel, pose: Array | None) -> Array:
    """Return the point (2,) in the object's frame about which its distance joint lets it turn [m].

    A pivot's is the anchor itself. A joint of some length is a rigid bar from hinge to anchor: its direction comes
    from the pose, its length is the learned one, so that noise of the pose does not stretch it.

    Raises:
        ControlError: the joint has a length and there is no finite pose, or the anchor is at the hinge.
    """
    parameters = model.parameters
    anchor = np.array([parameters.anchor_x, parameters.anchor_y])
    if parameters.hinge_radius == 0.0:
        return anchor
    if pose is None or not np.isfinite(pose).all():
        raise ControlError(f"hinge: expected a finite pose of the object to find it from, got {pose}")
    hinge = compose(inverse(pose), np.array([parameters.hinge_x, parameters.hinge_y, 0.0]))[:2]
    away = hinge - anchor
    distance = float(np.hypot(*away))
    if distance < NEAR:
        raise ControlError(f"hinge: expected it {parameters.hinge_radius:.3f} m from its anchor, got both in one place")
    return anchor + away * (parameters.hinge_radius / distance)


Constraint = tuple[ModelClass, Array, Array, Array, str]


def _constraint(model: ObjectModel, pose: Array | None, settings: ConstraintSettings) -> Constraint:
    """Return class, rows, moves, point of rotation and reason, whatever force it takes."""
    if model.parameters.has_hinge:
        return _pivot(hinge_centre(model, pose), "a hinge lets it turn alone")
    held_x, held_y = held_axes(model, settings)
    if held_x and held_y:
        return _pivot(model.wheel, "a wheel that rolls no way lets it turn alone")
    if not (held_x or held_y):
        moves = np.vstack((np.eye(3)[:2], _turn_about(model.com)))
        return ModelClass.UNCONSTRAINED, np.zeros((0, 3)), moves, model.com, ""
    across, along = model.wheel_axes if held_x else model.wheel_axes[::-1]
    rows = direction_row(model.wheel, across)[None]
    moves = np.vstack((np.append(along, 0.0), _turn_about(model.wheel)))
    heading = np.degrees(np.arctan2(along[1], along[0])) % 180.0
    return ModelClass.ANISOTROPIC, rows, moves, model.wheel, f"a wheel rolls along {heading:.0f} deg and about itself"


def _pivot(centre: Array, reason: str) -> Constraint:
    rows = np.array([direction_row(centre, axis) for axis in np.eye(2)])
    place = f"{reason}, about ({centre[0]:.2f}, {centre[1]:.2f}) m"
    return ModelClass.FIXED_POINT, rows, _turn_about(centre)[None], centre, place


def _turn_about(point: Array) -> Array:
    """Return the twist (3,) of the origin when the object turns about `point` at unit rate."""
    return shift(np.array([0.0, 0.0, 1.0]), -point)
