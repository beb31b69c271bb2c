"""What a learned model says of a rigid body that stands on points of the floor, with how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_bringup.errors import BringupError
from pbrl_model.geometry import check_polygon
from pbrl_model.model_file import LearnedParameter, SavedModel
from pbrl_model.symmetry import THETA_PERIOD, circular_mean, circular_sd

Array = NDArray[np.float64]

ANGLES = ("wheel_theta", "wheel2_theta")
SHOWN = ("ground_friction", "second_wheel", "com_offset")
"""Effects that a rigid body on points of the floor can show."""


@dataclass(frozen=True)
class Wheel:
    """A point that holds: place (2,) [m] and turn [rad] in the body's frame, coefficients of the whole weight."""

    name: str
    place: tuple[float, float]
    theta: float
    mu_x: float
    mu_y: float


@dataclass(frozen=True)
class RigidBody:
    """A prism on points of the floor.

    Attributes:
        name: of the body.
        mass: [kg].
        com: (3,) [m], body's frame, whose origin is on the floor.
        inertia: (3,) about the axes of the body's frame through the centre of mass [kg m^2].
        product: of inertia, xy [kg m^2].
        footprint: (k, 2) [m], counter-clockwise.
        height: [m].
        feet: (F, 2) points that carry the load [m].
        mu_ground: friction of the whole body.
        wheels: points that hold.
        told: lines on where the numbers are from, how sure they are and what is missing.
    """

    name: str
    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float]
    product: float
    footprint: Array
    height: float
    feet: Array
    mu_ground: float
    wheels: tuple[Wheel, ...]
    told: tuple[str, ...]

    @property
    def contacts(self) -> int:
        """Return on how many points it stands."""
        return len(self.feet) + len(self.wheels)

    @property
    def foot_mu(self) -> float:
        """Return the coefficient at each foot that gives the whole body its friction, the load shared alike."""
        return self.mu_ground * self.contacts / len(self.feet)


def rigid_body(model: SavedModel, height: float) -> RigidBody:
    """Return the posterior mean of a model as a rigid body.

    The moment of inertia about the vertical is what was learned; those about the horizontal axes, of which a motion in
    the plane says nothing, are of a prism of uniform density.

    Args:
        model: of the object.
        height: of the prism [m].

    Raises:
        BringupError: the object hangs on a hinge.
    """
    if "hinge_x" in model.all_parameters():
        raise BringupError(
            f"export: expected a body that stands on the floor, got {model.object!r} on a hinge; take json or netcdf"
        )
    means = {name: _mean(name, each) for name, each in model.all_parameters().items()} | model.all_fixed()
    mass, outline = means["mass"], check_polygon(model.shape.footprint)
    com = (model.shape.com[0] + means.get("com_x", 0.0), model.shape.com[1] + means.get("com_y", 0.0))
    factor = means.get("inertia_factor", 1.0)
    xx, yy, xy = _second_moments(outline)
    scale = factor * model.shape.inertia_per_mass / (xx + yy)
    upright = height * height / 12.0
    return RigidBody(
        name=model.object,
        mass=mass,
        com=(*com, 0.5 * height),
        inertia=(
            mass * (scale * yy + upright),
            mass * (scale * xx + upright),
            mass * factor * model.shape.inertia_per_mass,
        ),
        product=-mass * scale * xy,
        footprint=outline,
        height=height,
        feet=np.array(model.shape.feet),
        mu_ground=means.get("mu_ground", 0.0) + means.get("slide_mu", 0.0),
        wheels=_wheels(means),
        told=_told(model, height),
    )


def _mean(name: str, parameter: LearnedParameter) -> float:
    return circular_mean(np.array(parameter.draws), THETA_PERIOD) if name in ANGLES else parameter.mean


def _sd(name: str, parameter: LearnedParameter) -> float:
    return circular_sd(np.array(parameter.draws), THETA_PERIOD) if name in ANGLES else parameter.sd


def _wheels(means: dict[str, float]) -> tuple[Wheel, ...]:
    found = []
    for name, start in (("wheel", ""), ("second_wheel", "wheel2_")):
        place, mu = (start or "wheel_"), f"{start}mu_"
        along = means.get(f"{mu}x", 0.0)
        across = means.get(f"{mu}y", -1.0)
        across = along if across < 0.0 else across  # below zero: the same as along
        if max(along, across) > 0.0:
            x, y = means.get(f"{place}x", 0.0), means.get(f"{place}y", 0.0)
            found.append(Wheel(name, (x, y), means.get(f"{place}theta", 0.0), along, across))
    return tuple(found)


def _second_moments(outline: Array) -> tuple[float, float, float]:
    """Return the second moments xx, yy, xy of a polygon about its centroid, over its area [m^2]."""
    centroid = np.array(shapely.Polygon(outline).centroid.coords[0])
    here = outline - centroid
    there = np.roll(here, -1, axis=0)
    cross = here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]
    area = 0.5 * cross.sum()
    both = here + there

    def moment(i: int, j: int) -> float:
        terms = here[:, i] * here[:, j] + there[:, i] * there[:, j] + both[:, i] * both[:, j]
        return float((cross * terms).sum() / (24.0 * area))

    return moment(0, 0), moment(1, 1), moment(0, 1)


def _told(model: SavedModel, height: float) -> tuple[str, ...]:
    lines = [f"{model.object}: posterior mean of a learned model, with one standard deviation:"]
    for name, each in model.all_parameters().items():
        lines.append(f"  {name} = {_mean(name, each):.6g} +/- {_sd(name, each):.3g} {each.unit}")
    lines += [
        f"  {name} = {value:.6g}, not learned" for name, value in model.all_fixed().items() if math.isfinite(value)
    ]
    lines.append(f"Height ({height:g} m), and inertia about x and y, are not learned: a prism of uniform density.")
    lines.append("Learned coefficients are of the whole weight; here each contact has its share, so that they are")
    lines.append("multiplied by the number of contacts (feet: shared among them).")
    missing = [name for name in model.names if name not in SHOWN]
    if missing:
        lines.append(f"Learned, but nothing that this format has a word for: {', '.join(missing)}.")
    return (*lines, *(f"Note: {note}" for note in model.notes))
