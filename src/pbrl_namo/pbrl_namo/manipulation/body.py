"""A movable thing as the rollout kernel sees it: convex parts, and how they hang together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_model.geometry import convex_parts
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.errors import NamoError

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Body:
    """The outline of a thing in its own frame.

    Attributes:
        points: (n, 2) corners of its convex parts, one after the other, counter-clockwise [m].
        starts: (q + 1,) where each begins.
        hubs: (q, 2) a point inside each part.
        doors: (q, 2) a point that each part shares with its parent; its hub where it has none.
        parents: (q,) the part, of a lower number, that each hangs on; -1 of the first.
        circle: (3,) middle and radius of a circle around all of it.
        stops: lines that points of it do not cross.
    """

    points: Array
    starts: Indices
    hubs: Array
    doors: Array
    parents: Indices
    circle: Array
    stops: tuple[Stop, ...] = ()

    @classmethod
    def of(cls, footprint: Array, stops: tuple[Stop, ...] = ()) -> Self:
        """Cut an outline (k, 2) into convex parts.

        Raises:
            NamoError: its parts do not hang together.
        """
        parts = convex_parts(footprint)
        order, parents, doors = _tree(parts)
        parts = [parts[k] for k in order]
        hubs = np.array([part.mean(axis=0) for part in parts])
        doors[0] = hubs[0]
        starts = np.concatenate(([0], np.cumsum([len(part) for part in parts]))).astype(np.int64)
        points = np.ascontiguousarray(np.vstack(parts), dtype=float)
        return cls(points, starts, hubs, doors, parents, circle_around(points), stops)


def circle_around(points: Array) -> Array:
    """Return middle and radius (3,) of a circle around points (n, 2): about the middle of their box."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return np.array([*middle, float(np.hypot(*(points - middle).T).max())])


def _tree(parts: list[Array]) -> tuple[list[int], Indices, Array]:
    """Return the parts in an order in which each touches one before it, which one, and where."""
    shapes = [shapely.polygons(part) for part in parts]
    order, parents, doors = [0], [-1], [np.zeros(2)]
    for at, here in enumerate(order):
        for other in range(len(parts)):
            shared = shapely.intersection(shapes[here], shapes[other]) if other not in order else None
            if shared is not None and shapely.length(shared) > 0.0:
                order.append(other)  # the loop goes on over it
                parents.append(at)
                doors.append(shapely.get_coordinates(shapely.line_interpolate_point(shared, 0.5, normalized=True))[0])
    if len(order) < len(parts):
        raise NamoError(f"outline: expected convex parts that hang together, got {len(parts)} of which some do not")
    return order, np.array(parents, dtype=np.int64), np.array(doors)
