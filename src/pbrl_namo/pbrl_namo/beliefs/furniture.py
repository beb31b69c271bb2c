"""Draws of what a piece of furniture on casters may be like: which casters are locked, what it carries.

A locked caster is a wheel that holds along both axes, with the coefficient of its tread times its share of the weight.
Several locked ones together resist like one wheel in their middle for a translation, and a turn about that middle is
resisted by each with its lever: in the world model by the friction of the whole body, whose moment is
mu_ground m g sqrt(I / m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import Array
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters
from pbrl_namo.beliefs.settings import BeliefSettings
from pbrl_namo.errors import NamoError

CORNERS = 4
COLUMN = {name: index for index, name in enumerate(KERNEL_COLUMNS)}


def furniture_rows(footprint: Array, mass: float, rng: np.random.Generator, settings: BeliefSettings) -> Array:
    """Draw rows (n, 12) of parameters, the kinds one after the other in the order of the settings' weights.

    How many rows a kind has is no matter of chance: its share of all, rounded.

    Args:
        footprint: (k, 2) outline in the thing's frame [m].
        mass: what a person would guess [kg]; NaN where nobody does.
        rng: of every draw.
        settings: what furniture is like.

    Raises:
        NamoError: no kind has a weight, or the mass is not above zero.
        ControlError: the footprint is no polygon.
    """
    counts = kind_counts(settings)
    if not (math.isnan(mass) or (math.isfinite(mass) and mass > 0.0)):
        raise NamoError(f"nominal mass: expected a finite number above zero, or NaN where nobody knows, got {mass} kg")
    shape = ObjectModel.uniform(BodyParameters(mass=1.0), footprint)
    corners = Corners.of(shape.footprint)
    count = sum(counts)
    rows = np.tile(BodyParameters(mass=1.0).to_vector(), (count, 1))
    median, sigma = (
        (settings.unknown_median, settings.unknown_sigma) if math.isnan(mass) else (mass, settings.mass_sigma)
    )
    rows[:, COLUMN["mass"]] = median * np.exp(sigma * rng.standard_normal(count))
    rows[:, COLUMN["mu_ground"]] = settings.rolling * np.exp(settings.rolling_sigma * rng.standard_normal(count))
    ends = np.cumsum(counts)
    for row in rows[ends[0] : ends[1]]:
        _lock(row, 1, corners, shape.inertia_per_mass, rng, settings)
    for row in rows[ends[1] : ends[2]]:
        _lock(row, int(rng.integers(2, CORNERS + 1)), corners, shape.inertia_per_mass, rng, settings)
    rows[ends[2] :, COLUMN["mass"]] *= rng.uniform(1.0, settings.load, counts[3])
    return rows


def kind_counts(settings: BeliefSettings) -> tuple[int, ...]:
    """Return how many draws each kind has; the largest remainders are rounded up.

    Raises:
        NamoError: no kind has a weight.
    """
    weights = np.array(settings.weights)
    if not weights.sum() > 0.0:
        raise NamoError("prior: expected a weight above zero among free, one_locked, blocked and loaded, got none")
    shares = settings.draws * weights / weights.sum()
    counts = np.floor(shares).astype(int)
    for index in np.argsort(counts - shares, kind="stable")[: settings.draws - counts.sum()]:
        counts[index] += 1
    return tuple(int(count) for count in counts)


@dataclass(frozen=True)
class Corners:
    """Corners of the smallest rectangle around a footprint.

    Attributes:
        middle: (2,) of it [m].
        units: (2, 2) rows along its sides.
        local: (4, 2) the corners along those, from the middle [m].
    """

    middle: Array
    units: Array
    local: Array

    @classmethod
    def of(cls, footprint: Array) -> Self:
        """Find them for an outline (k, 2) [m]."""
        box = shapely.minimum_rotated_rectangle(shapely.multipoints(footprint))
        corners = np.asarray(box.exterior.coords)[:-1]
        sides = np.array([corners[1] - corners[0], corners[3] - corners[0]])
        units = sides / np.hypot(*sides.T)[:, None]
        middle = corners.mean(axis=0)
        return cls(middle, units, (corners - middle) @ units.T)

    def inwards(self, inset: float) -> Array:
        """Return the places (4, 2) that are an inset [m] inwards along both sides, at most in the middle."""
        moved = np.sign(self.local) * np.maximum(np.abs(self.local) - inset, 0.0)
        places: Array = self.middle + moved @ self.units
        return places


def _lock(
    row: Array,
    locked: int,
    corners: Corners,
    inertia_per_mass: float,
    rng: np.random.Generator,
    settings: BeliefSettings,
) -> None:
    """Write into a row what so many locked casters, drawn at random, do."""
    inset = max(settings.inset + settings.inset_sigma * float(rng.standard_normal()), 0.0)
    places = corners.inwards(inset)[np.sort(rng.permutation(CORNERS)[:locked])]
    middle = places.mean(axis=0)
    tread = settings.caster_friction * math.exp(settings.caster_sigma * float(rng.standard_normal()))
    friction = tread * locked / CORNERS
    levers = np.hypot(*(places - middle).T)
    gyration = math.sqrt(inertia_per_mass)
    row[[COLUMN["wheel_x"], COLUMN["wheel_y"]]] = middle
    row[COLUMN["wheel_theta"]] = rng.uniform(-math.pi / 2.0, math.pi / 2.0)
    row[[COLUMN["mu_x"], COLUMN["mu_y"]]] = friction
    row[COLUMN["mu_ground"]] += friction * float(levers.mean()) / gyration
