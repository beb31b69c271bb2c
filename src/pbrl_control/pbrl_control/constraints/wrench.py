"""The wrench that each grip has to apply along the way, computed from the object's model (thesis 6.4).

Newton and Euler in the object's axes, with friction as the world model has it (`pbrl_model.kernel`): a wheel's
axis that slips resists with mu m g, one that does not takes up to that; the feet resist with mu m g along
M V / sqrt(V.M.V / m); a distance joint takes anything along its line. What joint and wheel may take is not
determined by the motion: they are taken to do as much for the grips as they can, so that the wrench is the
least one that makes the motion. Applied in the kernel at steps of 1 ms it does make it: over half a second of steady
motion all speeds stay within 0.1 mm/s and 0.1 mrad/s (tests).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, hinge_centre
from pbrl_control.constraints.object_model import ObjectModel, direction_row
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, shift
from pbrl_model.kernel import GRAVITY

REST_SPEED = 1e-4  # [m/s] slower than this nothing slips
REST_RATE = 1e-4  # [m/s^2] and below this it is not about to


class Reactions(NamedTuple):
    """What the surroundings can do for the grips: rows (k, 3) of unit forces about the centre of mass, and limits."""

    rows: Array
    limits: Array


def expected_grip_wrench(
    model: ObjectModel,
    pose: Array | None,
    twist: Array,
    rate: Array,
    contacts: Array,
    settings: ConstraintSettings = DEFAULTS,
    *,
    across: bool = False,
) -> Array:
    """Return the wrench (n, 3) that each grip applies to the object: fx, fy [N], tau [N m] at its contact, object axes.

    Grips share the whole by least norm, sum of f^2 + (tau / torque_arm)^2: as equal elastic grips do, which store the
    least energy; no grip works against another.

    Args:
        model: the object's physics.
        pose: (3,) of the object in `world` [m, rad]; needed where it hangs on a hinge at a distance.
        twist: (3,) of the object's origin in its axes [m/s, rad/s]; one that its constraints allow.
        rate: (3,) how the components of that twist change [m/s^2, rad/s^2]; zero on a steady arc.
        contacts: (n, 2) where the grips hold it, in the object's frame [m].
        settings: for the torque arm.
        across: as if all casters that are known stood across their motion and had to swing round: the most they resist.

    Raises:
        ControlError: an input has another shape or is not finite, or a pose is needed and there is none.
    """
    points = _checked("contacts", contacts, (-1, 2))
    velocity = shift(_checked("twist", twist, (3,)), model.com)
    change = shift(_checked("rate", rate, (3,)), model.com)
    levers = points - model.com
    transfer = _transfer(levers)
    weights = np.tile([1.0, 1.0, 1.0 / settings.torque_arm**2], len(points))
    shared = np.linalg.inv((transfer / weights) @ transfer.T)
    needed, reactions = _needed(model, pose, velocity, change)
    if across:
        needed = needed + _swinging(model, velocity, change)
    total = _least_total(needed, reactions, np.linalg.cholesky(shared).T)
    return ((transfer.T @ (shared @ total)) / weights).reshape(-1, 3)


def total_wrench(contacts: Array, wrenches: Array, point: Array) -> Array:
    """Return the wrench (3,) about `point` (2,) of grips' wrenches (n, 3) at contacts (n, 2), all in object axes."""
    return _transfer(np.asarray(contacts) - point) @ np.ravel(wrenches)


def _transfer(levers: Array) -> Array:
    """Return the (3, 3n) map from wrenches at the ends of levers (n, 2) to the wrench at their common foot."""
    blocks = [np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-y, x, 1.0]]) for x, y in levers]
    return np.hstack(blocks)


def _least_total(needed: Array, reactions: Reactions, root: Array) -> Array:
    """Return the wrench (3,) at the centre of mass with the least norm |root @ wrench| that makes the motion."""
    if not len(reactions.rows):
        return needed
    bounds = (-reactions.limits, reactions.limits)
    taken = lsq_linear(root @ reactions.rows.T, root @ needed, bounds, method="bvls").x
    return needed - reactions.rows.T @ taken


def _needed(model: ObjectModel, pose: Array | None, velocity: Array, change: Array) -> tuple[Array, Reactions]:
    """Return the wrench (3,) for inertia and what slips, and what may be taken off it; at the centre of mass."""
    spread = np.array([1.0, 1.0, model.inertia_per_mass])
    turning = np.array([-velocity[2] * velocity[1], velocity[2] * velocity[0], 0.0])  # axes turn with the object
    needed = model.mass * spread * (change + turning) + _feet(model, velocity, change, spread)
    rows, limits = _joint(model, pose)
    for mu, axis in zip((model.parameters.mu_x, model.parameters.mu_y), model.wheel_axes, strict=True):
        limit = mu * model.mass * GRAVITY
        row = direction_row(model.wheel - model.com, axis)
        way = _slipping(float(row @ velocity), float(row @ change))
        if way:
            needed = needed + way * limit * row
        elif limit > 0.0:
            rows.append(row)
            limits.append(limit)
    return needed, Reactions(np.array(rows).reshape(-1, 3), np.array(limits))


def _feet(model: ObjectModel, velocity: Array, change: Array, spread: Array) -> Array:
    """Return the wrench (3,) against the friction of the feet; none while the object rests."""
    for motion, rest in ((velocity, REST_SPEED), (change, REST_RATE)):
        size = float(np.sqrt(spread @ motion**2))
        if size > rest:
            return model.parameters.mu_ground * model.mass * GRAVITY * spread * motion / size
    return np.zeros(3)


def _swinging(model: ObjectModel, velocity: Array, change: Array) -> Array:
    """Return the wrench (3,) at the centre of mass against casters that stand across; none where none are known."""
    total = np.zeros(3)
    if model.casters is None:
        return total
    limit = model.casters.friction * model.casters.share * model.mass * GRAVITY
    for place in model.casters.places - model.com:
        for motion, rest in ((velocity, REST_SPEED), (change, REST_RATE)):
            moved = motion[:2] + motion[2] * np.array([-place[1], place[0]])
            size = float(np.hypot(*moved))
            if size > rest:
                total += direction_row(place, moved) * (limit / size)
                break
    return total


def _slipping(speed: float, rate: float) -> float:
    """Return the sign of the slip there is or is about to be, or zero."""
    if abs(speed) > REST_SPEED:
        return float(np.sign(speed))
    return float(np.sign(rate)) if abs(rate) > REST_RATE else 0.0


def _joint(model: ObjectModel, pose: Array | None) -> tuple[list[Array], list[float]]:
    """Return rows and limits of the distance joint: two where it is a pivot, one along its line else."""
    parameters = model.parameters
    if not parameters.has_hinge:
        return [], []
    anchor = np.array([parameters.anchor_x, parameters.anchor_y])
    lever = anchor - model.com
    if parameters.hinge_radius == 0.0:
        return [direction_row(lever, axis) for axis in np.eye(2)], [np.inf, np.inf]
    line = (hinge_centre(model, pose) - anchor) / parameters.hinge_radius
    return [direction_row(lever, line)], [np.inf]


def _checked(name: str, value: Array, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value, dtype=float)
    fits = array.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, array.shape, strict=True))
    if not fits or not array.size or not np.isfinite(array).all():
        form = "(n, 2)" if shape[0] == -1 else str(shape)
        raise ControlError(f"expected wrench: expected finite {name} of shape {form}, got {array.tolist()}")
    return array
