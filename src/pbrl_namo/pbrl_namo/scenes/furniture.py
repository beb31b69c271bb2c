"""What stands in offices and can be moved: real sizes and masses, by make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable


@dataclass(frozen=True)
class Make:
    """One make of furniture.

    Attributes:
        size: along its own x and y [m].
        height: of the edge that is gripped [m].
        mass: empty, as a catalogue has it [kg].
        body: kind of body in a simulator's scene.
        share: how common it is, relative to the others.
    """

    size: tuple[float, float]
    height: float
    mass: float
    body: str
    share: float


MAKES = {
    "desk": Make((0.75, 1.50), 0.7775, 33.0, "office_table", 0.25),
    "table": Make((0.80, 1.80), 0.7775, 38.0, "office_table", 0.12),
    "square_table": Make((0.90, 0.90), 0.7775, 28.0, "office_table", 0.15),
    "chair": Make((0.56, 0.58), 0.85, 14.0, "office_table", 0.23),
    "cabinet": Make((0.45, 0.80), 0.74, 35.0, "office_table", 0.13),
    "cart": Make((0.90, 0.60), 0.9115, 30.0, "utility_cart", 0.12),
}
"""Furniture on casters, by name: desks and tables raised to what grippers reach, conference chairs gripped by their
backs, mobile cabinets by their tops, and steel carts by the rims of their upper shelves."""


@dataclass(frozen=True)
class Furniture(Movable):
    """A movable thing of a known make.

    Attributes:
        make: a name of `MAKES`.
    """

    make: str = "desk"


def of_make(make: str) -> Furniture:
    """Return a piece of furniture of a make, its frame in its middle.

    Raises:
        NamoError: there is no such make.
    """
    if make not in MAKES:
        raise NamoError(f"furniture: expected one of {', '.join(MAKES)}, got {make!r}")
    told = MAKES[make]
    half_x, half_y = told.size[0] / 2.0, told.size[1] / 2.0
    corners = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    return Furniture(corners, told.height, told.mass, make)
