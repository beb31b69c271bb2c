"""The parameters of one body (thesis equation 22, table 2): named fields, columns, units, model classes.

The kernel sees rows of numbers in the order of `KERNEL_COLUMNS`; people see names. This module is the
only place that knows how the two belong together.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

KERNEL_COLUMNS = (
    "mass",
    "wheel_x",
    "wheel_y",
    "wheel_theta",
    "mu_x",
    "mu_y",
    "hinge_x",
    "hinge_y",
    "hinge_radius",
    "anchor_x",
    "anchor_y",
    "mu_ground",
)
UNITS: Mapping[str, str] = MappingProxyType(
    {
        "mass": "kg",
        "wheel_x": "m",
        "wheel_y": "m",
        "wheel_theta": "rad",
        "mu_x": "1",
        "mu_y": "1",
        "hinge_x": "m",
        "hinge_y": "m",
        "hinge_radius": "m",
        "anchor_x": "m",
        "anchor_y": "m",
        "mu_ground": "1",
    }
)
ANGLES = frozenset({"wheel_theta"})
POSITIVE = frozenset({"mass", "mu_x", "mu_y", "mu_ground", "hinge_radius"})
"""Columns of a posterior that are above zero."""

WHEEL_COLUMNS = ("wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")
HINGE_COLUMNS = ("hinge_x", "hinge_y", "hinge_radius")
MODEL_CLASSES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "free": ("mass",),
        "wheel": ("mass", *WHEEL_COLUMNS),
        "wheel+ground": ("mass", *WHEEL_COLUMNS, "mu_ground"),
        # The anchor stays where it is told to be (a door's handle): its offset and the hinge are not
        # told apart by one pull. Friction acts at the wheel point, which is the frame's origin.
        "hinge": ("mass", "mu_x", "mu_y", *HINGE_COLUMNS),
    }
)
"""Columns that are learned, by model class; the others keep the values of the base parameters."""


@dataclass(frozen=True)
class BodyParameters:
    """The physics of one body with at most one wheel and one distance joint to the world.

    Attributes:
        mass: [kg].
        wheel_x: place of the wheel in the body's frame [m].
        wheel_y: as `wheel_x`.
        wheel_theta: turn of the wheel's x axis in the body's frame [rad].
        mu_x: friction coefficient along the wheel's x axis; the force is at most mu_x * mass * g.
        mu_y: as `mu_x`, along the wheel's y axis. Both zero: no wheel.
        hinge_x: place of the hinge in world [m].
        hinge_y: as `hinge_x`.
        hinge_radius: distance that is kept from hinge to anchor [m]; 0: a pivot; NaN: no hinge.
        anchor_x: the point of the body that is kept at that distance, in the body's frame [m].
        anchor_y: as `anchor_x`.
        mu_ground: friction of the whole body on the floor: feet that slide, or the rolling resistance of casters.
    """

    mass: float
    wheel_x: float = 0.0
    wheel_y: float = 0.0
    wheel_theta: float = 0.0
    mu_x: float = 0.0
    mu_y: float = 0.0
    hinge_x: float = 0.0
    hinge_y: float = 0.0
    hinge_radius: float = float("nan")
    anchor_x: float = 0.0
    anchor_y: float = 0.0
    mu_ground: float = 0.0

    @property
    def has_wheel(self) -> bool:
        """Tell whether friction acts at all."""
        return self.mu_x > 0.0 or self.mu_y > 0.0

    @property
    def has_hinge(self) -> bool:
        """Tell whether a distance joint to the world acts."""
        return not np.isnan(self.hinge_radius)

    def to_vector(self) -> Array:
        """Return the (12,) row of `KERNEL_COLUMNS`."""
        return np.array([getattr(self, name) for name in KERNEL_COLUMNS], dtype=float)

    @classmethod
    def from_vector(cls, vector: Array) -> BodyParameters:
        """Make parameters from a (12,) row of `KERNEL_COLUMNS`."""
        values = np.asarray(vector, dtype=float)
        if values.shape != (len(KERNEL_COLUMNS),):
            raise ModelError(f"parameters: expected a row of {len(KERNEL_COLUMNS)} columns, got shape {values.shape}")
        return cls(**dict(zip(KERNEL_COLUMNS, values.tolist(), strict=True)))


if tuple(field.name for field in fields(BodyParameters)) != KERNEL_COLUMNS:
    raise AssertionError("BodyParameters and KERNEL_COLUMNS name the same things in the same order")


def free_columns(model_class: str) -> tuple[str, ...]:
    """Return the names that a model class learns, in the order of its vector.

    Raises:
        ModelError: the class is unknown.
    """
    try:
        return MODEL_CLASSES[model_class]
    except KeyError:
        hint = nearest(model_class, MODEL_CLASSES)
        known = ", ".join(MODEL_CLASSES)
        raise ModelError(f"model class: expected one of {known}, got {model_class!r}{hint}") from None


def expand(free: Array, names: Sequence[str], base: BodyParameters) -> Array:
    """Put learned columns into whole kernel rows.

    Args:
        free: (n, K) or (K,) values of the learned parameters.
        names: K names, one for each column of `free`.
        base: values of everything that is not learned.

    Returns:
        (n, 12) rows in the order of `KERNEL_COLUMNS`, C-contiguous.

    Raises:
        ModelError: a name is unknown or the shapes do not fit.
    """
    values = np.atleast_2d(np.asarray(free, dtype=float))
    if values.ndim != 2 or values.shape[1] != len(names):
        raise ModelError(f"parameters: expected {len(names)} columns ({', '.join(names)}), got shape {values.shape}")
    rows = np.tile(base.to_vector(), (values.shape[0], 1))
    rows[:, column_indices(names)] = values
    return rows


def column_indices(names: Sequence[str]) -> list[int]:
    """Return where each name stands in `KERNEL_COLUMNS`.

    Raises:
        ModelError: a name is unknown.
    """
    for name in names:
        if name not in KERNEL_COLUMNS:
            hint = nearest(name, KERNEL_COLUMNS)
            raise ModelError(f"parameters: expected names among {', '.join(KERNEL_COLUMNS)}, got {name!r}{hint}")
    return [KERNEL_COLUMNS.index(name) for name in names]


def nearest(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    """Return "; did you mean 'x'?" for the known name closest to a misspelt one, or nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""
