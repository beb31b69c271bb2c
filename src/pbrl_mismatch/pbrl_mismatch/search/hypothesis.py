"""A hypothesis: the baseline with some effects on; which columns are free, and what is believed of them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_model.parameters import KERNEL_COLUMNS

Array = NDArray[np.float64]

FURTHEST = 3.5
"""An effect's parameter is no further from its prior's centre than so many of its standard deviations."""
OF_THE_BODY = frozenset({*KERNEL_COLUMNS, "inertia_factor", "delay"})
"""Columns of a baseline."""
BELIEVED = frozenset({"mass", "inertia_factor", "delay", "sensor_turn", "com_x", "com_y"})
"""Columns of a baseline of which something is known beforehand."""
OF_FRICTION = ("mu_x", "mu_y")
"""Columns of a wheel's friction along its axes, over the body's weight."""
BENT = BELIEVED | set(OF_FRICTION)
"""Columns of a ground that bend to what it lacks: half of the starts have them as they were believed to be."""
HOLDS = 1.5
"""A wheel that holds a body has a friction at most so many deviations above the prior's mean."""
SHARE = 1e-2
"""Of a prior's spread: friction is solved for only so exactly, and a finite difference must be well above that."""
OF_A_WHEEL = 0.03, 2.0
"""Friction along an axis of a wheel over the body's weight, and the spread of its logarithm: from 0.0005, a good
bearing under a quarter of the load, to 0.5, rubber that slides under most of it."""
FELT = 0.1, 1.0
"""Friction along an axis of a wheel over the body's weight that is climbed from, and the spread of its logarithm."""
SMALL = {"m": 0.005, "s": 0.02, "rad": 0.01}
"""Finite differences at most: borders, edges in time and axes are no softer."""


@dataclass(frozen=True)
class Hypothesis:
    """What is free, in coordinates u (K,): a column's value, or its logarithm, with a Gaussian prior.

    Attributes:
        effects: names of the effects that are on; empty: the baseline.
        variant: which sub-model, for people: the baseline's kind and those of the effects.
        parameters: free columns.
        base: (WIDTH,) values of all others.
        told: effects that the baseline has from a model that was told; they are no mismatch.
    """

    effects: tuple[str, ...]
    variant: str
    parameters: tuple[Parameter, ...]
    base: Array
    told: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Return the names of the free columns."""
        return tuple(parameter.column for parameter in self.parameters)

    @property
    def mean(self) -> Array:
        """Return (K,) the prior's mean."""
        return np.array([parameter.mean for parameter in self.parameters])

    @property
    def spread(self) -> Array:
        """Return (K,) the prior's standard deviation."""
        return np.array([parameter.spread for parameter in self.parameters])

    def rows(self, coordinates: Array) -> Array:
        """Return (P, WIDTH) parameter rows of coordinates (P, K)."""
        rows = np.tile(self.base, (len(coordinates), 1))
        for k, parameter in enumerate(self.parameters):
            value = coordinates[:, k]
            rows[:, COLUMN[parameter.column]] = np.exp(np.clip(value, -30.0, 30.0)) if parameter.positive else value
        return rows

    def coordinates(self, rows: Array) -> Array:
        """Return (P, K) coordinates of parameter rows (P, WIDTH)."""
        columns = []
        for parameter in self.parameters:
            value = rows[:, COLUMN[parameter.column]]
            columns.append(np.log(np.maximum(value, 1e-12)) if parameter.positive else value)
        return np.column_stack(columns)

    def laid_on(self, other: Hypothesis, coordinates: Array, own: Array) -> Array:
        """Return coordinates (n, K) of its own with every column that another has, too, as that one has it (k,)."""
        laid = own.copy()
        for column, value in zip(other.columns, coordinates, strict=True):
            if column in self.columns:
                laid[:, self.columns.index(column)] = value
        return laid

    def believable(self, coordinates: Array) -> Array:
        """Return coordinates (P, K) with those of effects brought back to where their priors are.

        Where no law is right, a wrong one would else buy what it explains with a force sensor that is off fivefold. The
        body's own are left as they are: how far off they have to be is itself a sign of a mismatch.
        """
        reach = np.array([math.inf if column in OF_THE_BODY else FURTHEST for column in self.columns]) * self.spread
        reach = np.minimum(reach, [parameter.furthest for parameter in self.parameters])
        return np.clip(coordinates, self.mean - reach, self.mean + reach)

    def as_believed(self, coordinates: Array) -> Array:
        """Return coordinates (K,) with what bends to an effect that is lacking as it was believed to be before.

        A wheel's friction is a force that is told over the weight: with a mass that is believed again it stays the
        force that it was. What of a body that was taken for many times as heavy kept the wheel from going sideways
        would else hold nothing.
        """
        found = np.where(np.isin(self.columns, list(BENT)), self.mean, coordinates)
        if {"mass", *OF_FRICTION} <= set(self.columns):
            mass, *axes = (self.columns.index(column) for column in ("mass", *OF_FRICTION))
            force = coordinates[axes] + coordinates[mass] - self.mean[mass]
            found[axes] = np.minimum(force, self.mean[axes] + HOLDS * self.spread[axes])
        return found

    def fixed(self, columns: Collection[str]) -> Hypothesis:
        """Return this with some columns no longer free, at the centre of their priors."""
        base = self.rows(self.mean[None])[0]
        return replace(self, parameters=tuple(p for p in self.parameters if p.column not in columns), base=base)

    def sample_prior(self, rng: np.random.Generator, count: int) -> Array:
        """Draw (count, K) coordinates."""
        return self.mean + self.spread * rng.standard_normal((count, len(self.parameters)))

    def sample_felt(self, rng: np.random.Generator, count: int) -> Array:
        """Draw (count, K) coordinates to climb from: the body as believed, a wheel's friction so that it is felt."""
        draws = self.sample_prior(rng, count)
        for k, column in enumerate(self.columns):
            if column in BELIEVED:
                draws[:, k] = self.mean[k]
            if column in OF_FRICTION:
                # From friction that is too little to be felt nothing leads back.
                draws[:, k] = math.log(FELT[0]) + FELT[1] * (draws[:, k] - self.mean[k]) / self.spread[k]
        return draws

    def with_effect(self, effect: Effect, scene: Scene, variant: int) -> Hypothesis:
        """Return this with one effect more; a column that both have is taken as the effect has it."""
        added = effect.chosen(scene, variant)
        names = {parameter.column for parameter in added}
        base = self.base.copy()
        for column, value in effect.given(variant).items():
            base[COLUMN[column]] = value
        kept = tuple(parameter for parameter in self.parameters if parameter.column not in names)
        return replace(
            self,
            effects=(*self.effects, effect.name),
            variant=f"{self.variant} + {effect.name}/{variant}",
            parameters=(*kept, *added),
            base=base,
        )


@dataclass(frozen=True)
class BaselineOptions:
    """What is believed of a body before any effect.

    Attributes:
        mass: [kg].
        mass_spread: standard deviation of its logarithm.
        inertia_spread: standard deviation of the logarithm of inertia over its nominal value.
        delay_spread: standard deviation of the poses' delay that nobody would call a fault [s].
        grasp_spread: of the wrench's direction [rad]; 0: known exactly.
        outline_spread: of each side of the footprint [m]; 0: known exactly.
    """

    mass: float
    mass_spread: float
    inertia_spread: float
    delay_spread: float
    grasp_spread: float = 0.0
    outline_spread: float = 0.0


def baselines(
    options: BaselineOptions, kinds: Sequence[str], centroid: Array, half: Array, hinge: Mapping[str, float] | None
) -> list[Hypothesis]:
    """Return the baseline's kinds: "free", "caster" (one that is locked), "wheel", "ground", "hinge".

    Args:
        options: what is believed of mass, inertia and delay.
        kinds: wanted; joined by "+" a kind has both.
        centroid: (2,) of the footprint [m].
        half: (2,) half the sides of its bounding box [m].
        hinge: first guess of hinge_x, hinge_y, hinge_radius, where a kind has a hinge.
    """
    found = []
    for kind in kinds:
        base = neutral_row()
        base[COLUMN["mass"]] = options.mass
        parameters = [
            Parameter("mass", options.mass, options.mass_spread, positive=True),
            Parameter("inertia_factor", 1.0, options.inertia_spread, positive=True),
            Parameter("delay", 0.0, options.delay_spread),
        ]
        if options.grasp_spread > 0.0:
            parameters.append(Parameter("sensor_turn", 0.0, options.grasp_spread))
        if options.outline_spread > 0.0:
            # The middle of two sides, each off by itself.
            off = options.outline_spread / math.sqrt(2.0)
            parameters += [Parameter("com_x", 0.0, off), Parameter("com_y", 0.0, off)]
        parts = kind.split("+")
        if "caster" in parts or "wheel" in parts:
            base[COLUMN["cone"]], base[COLUMN["mu_y"]] = 1.0, -1.0
            parameters += [
                Parameter("wheel_x", float(centroid[0]), 0.8 * float(half[0])),
                Parameter("wheel_y", float(centroid[1]), 0.8 * float(half[1])),
            ]
        if "wheel" in parts:
            # Which of its two axes is the one that it rolls along is not known beforehand.
            parameters += [
                Parameter("mu_x", *OF_A_WHEEL, positive=True),
                Parameter("wheel_theta", 0.0, 1.0),
                Parameter("mu_y", *OF_A_WHEEL, positive=True),
            ]
        elif "caster" in parts:
            parameters.append(Parameter("mu_x", 0.1, 1.0, positive=True))
        if "ground" in parts:
            parameters.append(Parameter("mu_ground", 0.03, 1.0, positive=True))
        if "hinge" in parts and hinge is not None:
            # A handle's friction acts at its own point; where nothing turns, inertia cannot be told.
            parameters = [p for p in parameters if p.column != "inertia_factor"]
            parameters += [
                Parameter("hinge_x", hinge["hinge_x"], 0.3),
                Parameter("hinge_y", hinge["hinge_y"], 0.3),
                Parameter("hinge_radius", hinge["hinge_radius"], 0.5, positive=True),
                Parameter("mu_ground", 0.1, 1.5, positive=True),
            ]
            base[COLUMN["hinge_radius"]] = 1.0
        found.append(Hypothesis((), kind, tuple(parameters), base))
    return found


def step_sizes(hypothesis: Hypothesis) -> Array:
    """Return (K,) finite differences: a share of each prior's spread, at most what is small for its unit."""
    most = [math.inf if p.positive else SMALL.get(p.unit, math.inf) for p in hypothesis.parameters]
    return np.clip(SHARE * hypothesis.spread, 1e-5, most)
