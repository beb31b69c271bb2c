"""The physics of one object as control needs it: its learned parameters, and what its footprint says of its mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon, mass_properties
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters

MAY_BE_NAN = "hinge_radius"  # NaN: no hinge
NOT_NEGATIVE = ("mu_x", "mu_y", "mu_ground", "hinge_radius")


@dataclass(frozen=True)
class SwivelCasters:
    """Casters that swing round, where they are known: they resist most while they stand across the motion.

    A caster that stands across rolls round its own contact until it trails. Its bearing's torque and its tread's scrub
    are then overcome at the lever of its trail: several times the rolling resistance.

    Attributes:
        places: (n, 2) of the swivel axes in the object's frame [m].
        friction: force across its heading that swings one, over what it carries:
            (bearing torque / load + scrub torque / load) / trail.
        share: of the object's weight that each carries.

    Raises:
        ControlError: the places are not (n, 2) and finite, or a number is not above zero.
    """

    places: Array
    friction: float
    share: float

    def __post_init__(self) -> None:
        if np.ndim(self.places) != 2 or np.shape(self.places)[1] != 2 or not np.isfinite(self.places).all():
            raise ControlError(f"casters: expected finite places of shape (n, 2), got {np.shape(self.places)}")
        for name, value in (("friction", self.friction), ("share", self.share)):
            if not (np.isfinite(value) and value > 0.0):
                raise ControlError(f"casters: expected {name} above zero, got {value}")


@dataclass(frozen=True)
class ObjectModel:
    """One object: the learned parameters of `pbrl_model` and its mass distribution.

    Attributes:
        parameters: mass, one wheel, friction of the feet, a distance joint to the world (thesis, table 2).
        footprint: (k, 2) outline in the object's frame [m].
        com: (2,) centre of mass in the object's frame [m].
        inertia_per_mass: moment of inertia about the centre of mass over the mass [m^2].
        casters: that swing round, where they are known beside what was learned.
    """

    parameters: BodyParameters
    footprint: Array
    com: Array
    inertia_per_mass: float
    casters: SwivelCasters | None = None

    def __post_init__(self) -> None:
        check_parameters(self.parameters)
        if not (np.isfinite(self.inertia_per_mass) and self.inertia_per_mass > 0.0):
            raise ControlError(f"object model: expected inertia_per_mass above zero [m^2], got {self.inertia_per_mass}")
        if np.shape(self.com) != (2,) or not np.isfinite(self.com).all():
            raise ControlError(f"object model: expected com as two finite numbers [m], got {self.com}")

    @classmethod
    def uniform(cls, parameters: BodyParameters, footprint: ArrayLike, casters: SwivelCasters | None = None) -> Self:
        """Make the model of a body of uniform density over its footprint (k, 2) [m] (thesis 5.3.1).

        Raises:
            ControlError: the footprint is no polygon, or a parameter is not physical.
        """
        try:
            outline = check_polygon(footprint)
            mass = mass_properties(outline)
        except ModelError as error:
            raise ControlError(f"object model: {error}") from error
        return cls(parameters, outline, mass.com, mass.inertia_per_mass, casters)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.parameters.mass

    @property
    def wheel(self) -> Array:
        """Place (2,) of the wheel in the object's frame [m]."""
        return np.array([self.parameters.wheel_x, self.parameters.wheel_y])

    @property
    def wheel_axes(self) -> Array:
        """Rows (2, 2): the directions of the wheel's x and y axis, object axes."""
        c, s = np.cos(self.parameters.wheel_theta), np.sin(self.parameters.wheel_theta)
        return np.array([[c, s], [-s, c]])

    @property
    def inertia(self) -> Array:
        """Mass matrix (3, 3) of twists at the object's origin in its axes: the kinetic energy is V.M.V / 2."""
        return self.mass * self.inertia_shape

    @property
    def inertia_shape(self) -> Array:
        """The mass matrix (3, 3) over the mass: with it, what a mass does not change does not depend on it."""
        x, y = self.com
        polar = self.inertia_per_mass + x * x + y * y
        return np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [-y, x, polar]])


def check_parameters(parameters: BodyParameters) -> None:
    """Refuse parameters that no body has.

    Raises:
        ControlError: the mass is not above zero, a coefficient is negative, or a value is NaN or infinite.
    """
    if not parameters.mass > 0.0:
        raise ControlError(f"object model: expected a mass above zero, got {parameters.mass} kg; learn it again")
    for name in KERNEL_COLUMNS:
        value = float(getattr(parameters, name))
        if np.isnan(value) and name == MAY_BE_NAN:
            continue
        if not np.isfinite(value) or (name in NOT_NEGATIVE and value < 0.0):
            bound = "a number not below zero" if name in NOT_NEGATIVE else "a finite number"
            raise ControlError(f"object model: expected {bound} as {name}, got {value}; learn it again")


def direction_row(point: Array, direction: Array) -> Array:
    """Return the (3,) row that takes the twist at the origin to the velocity of `point` (2,) along `direction` (2,).

    Its transpose takes a force along that direction at that point to the wrench about the origin.
    """
    return np.array([direction[0], direction[1], direction[1] * point[0] - direction[0] * point[1]])
