"""Joint priors over the parameters of a body (thesis section 5.3.2, table 2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.distributions import Distribution, LogNormal, TruncatedNormal, VonMises
from pbrl_model.errors import ModelError
from pbrl_model.geometry import bounding_box
from pbrl_model.parameters import UNITS, free_columns
from pbrl_model.prior_options import PriorOptions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Independent distributions with names.

    Attributes:
        parts: distribution by parameter, in the order of the vector theta (K,).
    """

    parts: Mapping[str, Distribution]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(self.parts)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters, in order."""
        return tuple(UNITS[name] for name in self.parts)

    @property
    def bounds(self) -> Array:
        """Lower and upper ends of the support, (2, K)."""
        return np.array([part.bounds for part in self.parts.values()]).T

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which parameters live on a circle, (K,); their densities take angles beyond the bounds."""
        return np.array([isinstance(part, VonMises) for part in self.parts.values()])

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, K) parameter vectors."""
        return np.column_stack([part.sample(rng, n) for part in self.parts.values()])

    def log_prob(self, theta: ArrayLike) -> Array:
        """Return the log density [nat] (n,) of vectors (n, K); -inf outside the support and for NaN.

        Raises:
            ModelError: the number of columns is wrong.
        """
        rows = np.asarray(theta, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != len(self.parts):
            raise ModelError(
                f"prior: expected (n, {len(self.parts)}) columns {', '.join(self.parts)}, got {rows.shape}"
            )
        total = np.zeros(rows.shape[0])
        for column, part in zip(rows.T, self.parts.values(), strict=True):
            total += part.log_prob(column)
        return total


def table2_prior(
    geometry: BodyGeometry,
    model_class: str = "wheel",
    options: PriorOptions | None = None,
    around: ArrayLike | None = None,
) -> Prior:
    """Make the prior of table 2 for one body.

    Mass is log-normal around the nominal mass, wide where nobody says; friction coefficients are truncated normals on
    [0, 1]; the wheel's place is a truncated normal over the footprint's bounding box and its turn von Mises; the
    hinge's place is a truncated normal around the body, its radius log-normal.

    Args:
        geometry: footprint, nominal mass, pose in the scene.
        model_class: "free", "wheel", "wheel+ground" or "hinge".
        options: None: the defaults.
        around: (2,) where the hinge is sought, world [m]; None: the body's pose in the scene.

    Returns:
        The prior over `free_columns(model_class)`.

    Raises:
        ModelError: the class is unknown, or the footprint or an option is not usable.
    """
    settings = options or PriorOptions()
    names = free_columns(model_class)
    centre = np.asarray(geometry.pose[:2] if around is None else around, dtype=float)
    parts = _mass_and_friction(geometry, settings) | _wheel(geometry, settings)
    if model_class == "hinge":
        parts |= _hinge(centre, settings)
    parts |= {name: spec.build() for name, spec in settings.parameters.items()}
    return Prior({name: parts[name] for name in names})


def _mass_and_friction(geometry: BodyGeometry, settings: PriorOptions) -> dict[str, Distribution]:
    nominal = geometry.nominal_mass
    if math.isnan(nominal):
        mass = LogNormal(settings.mass.unknown_median, settings.mass.unknown_sigma)
    else:
        mass = LogNormal(nominal, settings.mass.sigma)
    friction = TruncatedNormal(settings.friction.mean, settings.friction.sd, 0.0, 1.0)
    ground = TruncatedNormal(settings.ground.mean, settings.ground.sd, 0.0, 1.0)
    return {"mass": mass, "mu_x": friction, "mu_y": friction, "mu_ground": ground}


def _wheel(geometry: BodyGeometry, settings: PriorOptions) -> dict[str, Distribution]:
    lower, upper = bounding_box(geometry.footprint)
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    margin = settings.wheel.margin
    parts: dict[str, Distribution] = {
        name: TruncatedNormal(
            float(middle[k]),
            settings.wheel.spread * float(half[k]),
            float(lower[k]) - margin,
            float(upper[k]) + margin,
        )
        for k, name in enumerate(("wheel_x", "wheel_y"))
    }
    return parts | {"wheel_theta": VonMises(settings.wheel.theta_mean, settings.wheel.theta_kappa)}


def _hinge(centre: Array, settings: PriorOptions) -> dict[str, Distribution]:
    if centre.shape != (2,) or not np.isfinite(centre).all():
        raise ModelError(f"prior: expected the hinge's neighbourhood as 2 finite numbers [m], got {centre.tolist()}")
    sd, reach = settings.hinge.sd, settings.hinge.reach
    parts: dict[str, Distribution] = {
        name: TruncatedNormal(float(place), sd, float(place) - reach, float(place) + reach)
        for name, place in zip(("hinge_x", "hinge_y"), centre, strict=True)
    }
    return parts | {"hinge_radius": LogNormal(settings.hinge.radius_median, settings.hinge.radius_sigma)}
