"""Objectives: how untidy a layout is, as a weighted sum of terms (thesis equations 1 to 3 and 6), or any function.

A term takes layouts (m, n, 3) and gives values (m,), so that many are looked at in one call. Smaller is tidier.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_control.settings import Finite, Section, load_section, parse_section
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.desk import Desk

Cost = Callable[[Array], Array]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


class Apart(Section):
    """Items far from each other: minus the sum of distances over all ordered pairs (1) [m]."""

    term: Literal["apart"]
    items: Annotated[tuple[str, ...], Field(min_length=2)]
    weight: Finite = 1.0

    def cost(self, desk: Desk) -> Cost:
        """Return the term for a desk."""
        which = _indices(desk, self.items)

        def value(layouts: Array) -> Array:
            points = layouts[:, which, :2]
            away = points[:, :, None] - points[:, None, :]
            return -np.sqrt((away * away).sum(axis=-1)).sum(axis=(1, 2))

        return value


class Near(Section):
    """Items near a point: the sum of their distances to it (2) [m]; without a point it is the middle of the table."""

    term: Literal["near"]
    items: Names
    point: tuple[Finite, Finite] | None = None
    weight: Finite = 1.0

    def cost(self, desk: Desk) -> Cost:
        """Return the term for a desk."""
        which, point = _indices(desk, self.items), np.array(self.point or desk.table.centre)

        def value(layouts: Array) -> Array:
            away = layouts[:, which, :2] - point
            return np.sqrt((away * away).sum(axis=-1)).sum(axis=1)

        return value


class Aligned(Section):
    """Items parallel to the table: the sum of their angles to the nearest side of it (3) [rad].

    Equation (3) is printed as the remainder of a division by a right angle, which jumps where an item is just not
    parallel; here it is how far the angle is from the nearest multiple of a right angle.
    """

    term: Literal["aligned"]
    items: Names
    weight: Finite = 1.0

    def cost(self, desk: Desk) -> Cost:
        """Return the term for a desk."""
        which, right = _indices(desk, self.items), math.pi / 2.0

        def value(layouts: Array) -> Array:
            yaw = layouts[:, which, 2]
            return np.abs(yaw - right * np.round(yaw / right)).sum(axis=1)

        return value


class Facing(Section):
    """Items at an angle: the sum of their angles to it [rad]; a box that is turned half round looks the same."""

    term: Literal["facing"]
    items: Names
    angle: Finite
    weight: Finite = 1.0

    def cost(self, desk: Desk) -> Cost:
        """Return the term for a desk."""
        which = _indices(desk, self.items)

        def value(layouts: Array) -> Array:
            off = layouts[:, which, 2] - self.angle
            return np.abs(off - math.pi * np.round(off / math.pi)).sum(axis=1)

        return value


Term = Annotated[Apart | Near | Aligned | Facing, Field(discriminator="term")]


class ObjectiveFile(Section):
    """What a YAML file of an objective holds: `terms`, each with its name, its items and its weight."""

    terms: Annotated[tuple[Term, ...], Field(min_length=1)]


@dataclass(frozen=True)
class Objective:
    """How untidy layouts of one desk are.

    Attributes:
        desk: whose layouts.
        cost: of layouts (m, n, 3): (m,).
        name: in words.
    """

    desk: Desk
    cost: Cost
    name: str = "objective"

    @classmethod
    def of(cls, desk: Desk, terms: Sequence[Apart | Near | Aligned | Facing], name: str = "objective") -> Objective:
        """Make the weighted sum (6) of terms.

        Raises:
            PlannerError: a term speaks of an item that is not there.
        """
        parts = [(term.weight, term.cost(desk)) for term in terms]

        def value(layouts: Array) -> Array:
            return np.sum([weight * part(layouts) for weight, part in parts], axis=0)

        return cls(desk, value, name)

    @classmethod
    def from_text(cls, desk: Desk, text: str, where: str = "objective") -> Objective:
        """Read one from YAML.

        Raises:
            PlannerError: a key, a term or an item is not known, or a number is not finite.
        """
        try:
            read = parse_section(text, ObjectiveFile, where)
        except ControlError as error:
            raise PlannerError(str(error)) from error
        return cls.of(desk, read.terms, where)

    @classmethod
    def from_file(cls, desk: Desk, path: Path) -> Objective:
        """Read one from a YAML file.

        Raises:
            PlannerError: the file cannot be read, or see `from_text`.
        """
        try:
            read = load_section(path, ObjectiveFile, "objective")
        except ControlError as error:
            raise PlannerError(str(error)) from error
        return cls.of(desk, read.terms, path.stem)

    @classmethod
    def from_function(cls, desk: Desk, function: Callable[[Mapping[str, Array]], float]) -> Objective:
        """Make one from a function of the poses by name, (3,) each [m, rad]; slower than terms.

        Raises:
            PlannerError: it is not a function of one argument.
        """
        if not callable(function) or len(inspect.signature(function).parameters) != 1:
            raise PlannerError(f"objective: expected a function of one argument, the poses by name, got {function!r}")

        def value(layouts: Array) -> Array:
            return np.array([float(function(dict(zip(desk.names, layout, strict=True)))) for layout in layouts])

        return cls(desk, value, getattr(function, "__name__", "objective"))

    def __call__(self, layout: Array) -> float:
        """Return the value of one layout (n, 3).

        Raises:
            PlannerError: it is not finite.
        """
        return float(self.many(np.asarray(layout)[None])[0])

    def many(self, layouts: Array) -> Array:
        """Return the values (m,) of layouts (m, n, 3).

        Raises:
            PlannerError: there is not one finite value for each; the layout that has none is told.
        """
        values: Any = np.asarray(self.cost(layouts), dtype=float)
        if values.shape != (len(layouts),):
            raise PlannerError(f"{self.name}: expected {len(layouts)} values, got shape {values.shape}")
        if not np.isfinite(values).all():
            first = int(np.argmin(np.isfinite(values)))
            raise PlannerError(
                f"{self.name}: expected a finite value, got {values[first]} for the layout {layouts[first].tolist()}"
            )
        return np.asarray(values)


def _indices(desk: Desk, names: Sequence[str]) -> list[int]:
    return [desk.index(name) for name in names]
