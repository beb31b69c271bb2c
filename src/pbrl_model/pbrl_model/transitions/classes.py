"""Classes of a body's model that transitions are explained by: free, with a wheel, turning about a pivot.

Each class is a set of learned columns with priors (thesis table 2) and a way to turn their values into kernel rows. A
revolute body is pinned to the floor at one of its points: learned is which (the distance joint's anchor, radius zero);
where that is in world follows from the states before the transitions, of which the constraint holds. A wheel that never
slipped in any direction holds its point as a pivot does: until a push makes one of them slip, the two classes share the
probability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.distributions import Distribution, TruncatedNormal
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS, WHEEL_COLUMNS, nearest
from pbrl_model.prior_options import PriorOptions
from pbrl_model.priors import Prior, table2_prior
from pbrl_model.symmetry import equivalent_wheels

Array = NDArray[np.float64]

CLASSES = ("free", "wheel", "revolute")
ANCHOR_COLUMNS = ("anchor_x", "anchor_y")
NOISE_COLUMN = "log_sigma"
MASS_COLUMN = "log_mass"
MASS_REACH = 8.0  # prior standard deviations of ln mass at which its support ends


@dataclass(frozen=True)
class NoisePrior:
    """ln sigma ~ Normal(ln median, spread^2), cut to [floor, ceiling]; sigma in metres and metres a second [m, m/s].

    The floor keeps noise-free data from making the likelihood infinite; it is what rounding and the engines' own
    differences leave.
    """

    median: float = 3e-3
    spread: float = 2.0
    floor: float = 1e-5
    ceiling: float = 1.0

    def build(self) -> Distribution:
        """Return the distribution of ln sigma.

        Raises:
            ModelError: floor and ceiling are not 0 < floor < ceiling, or median or spread are not above zero.
        """
        if not (0.0 < self.floor < self.ceiling < math.inf and self.median > 0.0):
            raise ModelError(f"noise prior: expected 0 < floor < ceiling and a median above zero, got {self}")
        return TruncatedNormal(math.log(self.median), self.spread, math.log(self.floor), math.log(self.ceiling))


@dataclass(frozen=True)
class TransitionClass:
    """One class for one body.

    Attributes:
        name: one of `CLASSES`.
        prior: over the learned columns; ln mass first, ln sigma last.
    """

    name: str
    prior: Prior
    _columns: list[int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        physical = ["mass", *self.prior.names[1:-1]]
        object.__setattr__(self, "_columns", [KERNEL_COLUMNS.index(name) for name in physical])

    def rows(self, theta: Array, start: Array, com: Array) -> Array:
        """Return (P, 12) kernel rows of theta (P, D).

        Args:
            theta: values of the prior's columns.
            start: (n, 6) states of the centre of mass before transitions; a pivot is where they put the anchor.
            com: (2,) centre of mass in the body's frame [m].
        """
        rows = np.zeros((len(theta), len(KERNEL_COLUMNS)))
        rows[:, KERNEL_COLUMNS.index("hinge_radius")] = np.nan
        rows[:, self._columns] = theta[:, :-1]
        rows[:, 0] = np.exp(theta[:, 0])
        if self.name == "revolute":
            first = KERNEL_COLUMNS.index("anchor_x")
            hinge = KERNEL_COLUMNS.index("hinge_x")
            rows[:, hinge : hinge + 2] = mean_place(rows[:, first : first + 2] - com, start)
            rows[:, KERNEL_COLUMNS.index("hinge_radius")] = 0.0
        return rows

    def images(self, theta: Array) -> Array:
        """Return (S, P, D) equal descriptions: a wheel has four, see `symmetry`."""
        if self.name != "wheel":
            return theta[None]
        return equivalent_wheels(theta, self.prior.names)


def mean_place(points: Array, start: Array) -> Array:
    """Return (P, 2) where in world points (P, 2) about the centre of mass are on average over states (n, 6)."""
    c, s = np.cos(start[:, 2]).mean(), np.sin(start[:, 2]).mean()
    return start[:, :2].mean(axis=0) + points @ np.array([[c, s], [-s, c]])


def to_pivot(rows: Array, start: Array, com: Array) -> Array:
    """Return (P, n, 6) how states (n, 6) have to be moved for the anchors of kernel rows (P, 12) to be on their hinges.

    Rows without a hinge need no move: zero.
    """
    anchor, hinge = KERNEL_COLUMNS.index("anchor_x"), KERNEL_COLUMNS.index("hinge_x")
    arm = rows[:, anchor : anchor + 2] - com
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    place = start[None, :, :2] + np.stack(
        [np.outer(arm[:, 0], c) - np.outer(arm[:, 1], s), np.outer(arm[:, 0], s) + np.outer(arm[:, 1], c)], axis=2
    )
    moved = np.zeros((len(rows), len(start), 6))
    pinned = ~np.isnan(rows[:, KERNEL_COLUMNS.index("hinge_radius")])
    moved[pinned, :, :2] = rows[pinned, None, hinge : hinge + 2] - place[pinned]
    return moved


def transition_class(
    name: str, geometry: BodyGeometry, priors: PriorOptions, noise: NoisePrior, *, ground: bool
) -> TransitionClass:
    """Make a class for a body.

    Args:
        name: one of `CLASSES`.
        geometry: footprint and nominal mass.
        priors: settings of table 2; a pivot's prior is that of a wheel's place.
        noise: prior of the object's noise.
        ground: whether friction of the whole body on the floor is learned too.

    Raises:
        ModelError: the name is unknown, or the footprint or an option is not usable.
    """
    if name not in CLASSES:
        raise ModelError(f"model class: expected one of {', '.join(CLASSES)}, got {name!r}{nearest(name, CLASSES)}")
    parts: dict[str, Distribution] = {MASS_COLUMN: _log_mass(geometry, priors)}
    table = table2_prior(geometry, "wheel+ground", priors).parts
    if name == "wheel":
        parts |= {column: table[column] for column in WHEEL_COLUMNS}
    if name == "revolute":
        parts |= dict(zip(ANCHOR_COLUMNS, (table["wheel_x"], table["wheel_y"]), strict=True))
    if ground:
        parts["mu_ground"] = table["mu_ground"]
    return TransitionClass(name, Prior(parts | {NOISE_COLUMN: noise.build()}))


def _log_mass(geometry: BodyGeometry, priors: PriorOptions) -> Distribution:
    unknown = math.isnan(geometry.nominal_mass)
    median = priors.mass.unknown_median if unknown else geometry.nominal_mass
    spread = priors.mass.unknown_sigma if unknown else priors.mass.sigma
    if not (median > 0.0 and math.isfinite(median)):
        raise ModelError(f"{geometry.name}: expected a nominal mass above zero or NaN [kg], got {median!r}")
    middle = math.log(median)
    return TruncatedNormal(middle, spread, middle - MASS_REACH * spread, middle + MASS_REACH * spread)
