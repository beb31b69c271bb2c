"""A body put together from boxes: mass, inertia and shapes of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]
Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class Box:
    """A part of a body: mass [kg], half extents (3,) [m], centre (3,) [m] over the floor, colour."""

    mass: float
    half: Array
    centre: Array
    colour: Colour


def combine(boxes: Sequence[Box]) -> tuple[Array, Array]:
    """Give centre of mass (3,) and the diagonal (3,) of the inertia about it of a set of boxes.

    Casters stand symmetrically about the middle as a rule; where a scene puts them elsewhere, the small offset of
    the legs in x and y is left out, so that the base's axes stay principal axes.
    """
    masses = np.array([box.mass for box in boxes])
    height = float(masses @ [box.centre[2] for box in boxes] / masses.sum())
    centre = np.array([0.0, 0.0, height])
    inertia = np.zeros(3)
    for box in boxes:
        square = (2 * box.half) ** 2 / 12 + (box.centre - centre) ** 2
        inertia += box.mass * (square.sum() - square)
    return centre, inertia


def compound(client: BulletClient, boxes: Sequence[Box], centre: Array, *, visual: bool) -> int:
    """Make one shape of a set of boxes, about `centre`."""
    places = [(box.centre - centre).tolist() for box in boxes]
    arguments: dict[str, object] = {
        "shapeTypes": [bullet.GEOM_BOX] * len(boxes),
        "halfExtents": [box.half.tolist() for box in boxes],
    }
    if visual:
        colours = [box.colour for box in boxes]
        return int(client.api.createVisualShapeArray(**arguments, visualFramePositions=places, rgbaColors=colours))
    return int(client.api.createCollisionShapeArray(**arguments, collisionFramePositions=places))
