"""A scene as the kernels see it: convex pieces, between which of them a disc does not pass, a grid of where it can be.

Two pieces nearer to each other than the disc's diameter are a barrier. Pieces that barriers join are a cluster: no disc
gets from one side of it to the other between them. With one thing taken out, clusters are those of the rest.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from pbrl_control.planar import Array
from pbrl_model.geometry import convex_parts
from pbrl_namo.manipulation.pieces import Indices, Pieces
from pbrl_namo.manipulation.reference import ReferenceGrid
from pbrl_namo.scene import NamoScene


@dataclass(frozen=True)
class Yard:
    """A scene, prepared once for all openings.

    Attributes:
        scene: it.
        radius: of the disc that has to pass [m].
        cell: of the grid [m].
        names: of walls, fixed and movable things, in the order of the pieces' owners.
        pieces: of everything.
    """

    scene: NamoScene
    radius: float
    cell: float
    names: tuple[str, ...]
    pieces: Pieces

    @classmethod
    def of(cls, scene: NamoScene, radius: float, cell: float) -> Yard:
        """Prepare a scene for a disc of a radius [m] and a grid of a cell [m]."""
        names, outlines, owners = ["the walls"], list(_edges(scene.room)), []
        owners += [0] * len(outlines)
        things: Mapping[str, Polygon] = {**scene.fixed, **scene.outlines}
        for name, thing in things.items():
            parts = convex_parts(np.asarray(thing.exterior.coords))
            outlines += parts
            owners += [len(names)] * len(parts)
            names.append(name)
        return cls(scene, radius, cell, tuple(names), Pieces.of(outlines, owners))

    def owner(self, name: str) -> int:
        """Return the index under which the pieces of a movable or fixed thing are owned."""
        return self.names.index(name, 1)

    def owned(self, names: Collection[str]) -> NDArray[np.bool_]:
        """Say of each piece (m,) whether it is of one of some things."""
        return np.isin(self.pieces.owners, [self.owner(name) for name in names])

    @cached_property
    def barriers(self) -> Indices:
        """Pairs (k, 2) of pieces between which the disc does not pass."""
        shapes = [_shape(self.pieces.points[a:b]) for a, b in pairwise(self.pieces.starts)]
        tree = shapely.STRtree(shapes)
        pairs = tree.query(shapes, predicate="dwithin", distance=2.0 * self.radius)
        found: Indices = np.asarray(pairs[:, pairs[0] < pairs[1]].T, dtype=np.int64)
        return found

    def clusters(self, leave_out: Collection[str]) -> Indices:
        """Return the cluster (m,) of each piece with some things taken out, whose own pieces are alone."""
        own = self.owned(leave_out)
        kept = self.barriers[~own[self.barriers].any(axis=1)]
        count = len(self.pieces)
        joined = coo_matrix((np.ones(len(kept)), (kept[:, 0], kept[:, 1])), shape=(count, count))
        return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64)

    @cached_property
    def grid(self) -> ReferenceGrid:
        """Where the disc can be, on a grid."""
        return ReferenceGrid.of(self.pieces, self.scene.room.bounds, self.radius, self.cell)


def _edges(room: Polygon) -> list[Array]:
    """Return the walls of a room, holes included, as segments (2, 2)."""
    rings = [np.asarray(ring.coords)[:, :2] for ring in (room.exterior, *room.interiors)]
    return [np.array([a, b]) for ring in rings for a, b in pairwise(ring)]


def _shape(outline: Array) -> shapely.Geometry:
    return shapely.linestrings(outline) if len(outline) == 2 else shapely.polygons(outline)
