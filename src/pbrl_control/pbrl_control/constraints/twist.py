"""The wanted motion of an object, brought to what its constraints allow, so that a wheel is never fought."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_control.types import PlanarTwist

REFUSED_SPEED = 1e-3  # [m/s] below which nobody need hear of it


@dataclass(frozen=True)
class AchievableTwist:
    """What is left of a wanted twist.

    Attributes:
        twist: of the object's origin in its axes, within the constraints.
        refused: the wanted one less this.
        model_class: of the object.
        refused_speed: sqrt(2 E / m) with E the kinetic energy of the refused part [m/s].
        status: a sentence where something worth saying was refused; else empty.
    """

    twist: PlanarTwist
    refused: PlanarTwist
    model_class: ModelClass
    refused_speed: float
    status: str


def achievable_twist(
    model: ObjectModel,
    wanted: PlanarTwist,
    pose: Array | None = None,
    settings: ConstraintSettings = DEFAULTS,
) -> AchievableTwist:
    """Project a wanted twist onto what the object's constraints allow (thesis 6.3.2, figure 40).

    The metric is the kinetic energy: of all twists V that the constraints allow, the one with the least energy of
    the difference, (V - wanted).M.(V - wanted) / 2, M being the mass matrix. That is Gauss's principle of least
    constraint. What is refused is M^-1 times an impulse that wheel or hinge would have given, so it is exactly what
    would have been fought for, and what is left is how an object set going as wanted would go on by itself once its
    wheel has bitten: the push forward of a table whose corner is locked becomes a turn about that corner. Being
    an energy, the metric adds metres and radians without a made-up length and knows no frame; being over the mass,
    it does not depend on it. Least grip work would depend on the grips, could not be had before they are chosen,
    and is a cone, not a projection: friction makes it jump with the twist's sign.

    The map is linear for a given model and pose, hence continuous; it is idempotent; and it does not depend on the
    frame in which object and twist are described.

    Args:
        model: the object's physics.
        wanted: of the object's origin in its axes; a lift goes through.
        pose: (3,) of the object in `world` [m, rad]; needed where it hangs on a hinge at a distance.
        settings: what counts as a constraint.

    Raises:
        ControlError: the twist is not finite, or a pose is needed and there is none.
    """
    if not wanted.finite():
        raise ControlError(f"wanted twist: expected finite numbers, got {wanted.array().tolist()}")
    freedom = Freedom.of(model, pose, settings)
    allowed = projection(model, freedom) @ wanted.array()
    refused = wanted.array() - allowed
    speed = math.sqrt(max(float(refused @ model.inertia_shape @ refused), 0.0))
    vz = 0.0 if freedom.model_class == ModelClass.STATIC else wanted.vz
    return AchievableTwist(
        _planar(allowed, vz),
        _planar(refused, wanted.vz - vz),
        freedom.model_class,
        speed,
        _status(freedom, wanted.array(), refused) if speed > REFUSED_SPEED else "",
    )


def projection(model: ObjectModel, freedom: Freedom) -> Array:
    """Return the (3, 3) map from wanted to allowed twists of the object's origin in its axes.

    `I - M^-1 A' (A M^-1 A')^-1 A` with the constraints' rows A and the mass matrix M.
    """
    if freedom.model_class == ModelClass.STATIC:
        return np.zeros((3, 3))
    rows = freedom.rows
    yielding = np.linalg.solve(model.inertia_shape, rows.T)
    return np.eye(3) - yielding @ np.linalg.solve(rows @ yielding, rows)


def _planar(twist: Array, vz: float) -> PlanarTwist:
    return PlanarTwist(float(twist[0]), float(twist[1]), float(twist[2]), vz)


def _status(freedom: Freedom, wanted: Array, refused: Array) -> str:
    share = "all" if np.allclose(refused, wanted, atol=1e-9) else "part"
    vx, vy, omega = refused
    size = f"({vx:.2f}, {vy:.2f}) m/s, {omega:.2f} rad/s"
    return f"{freedom.model_class} object: {share} of the wanted twist refused, {size}; {freedom.reason}"
