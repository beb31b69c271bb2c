"""The floor cut up by who is in the way: an arrangement of everything movable, grown by the robot's radius.

Every cell has one answer to "which things would have to go before the disc's middle can be here": none in a region of
the free space, one next to an obstacle, several where obstacles stand close to each other. Two cells that share a piece
of border can be driven between once the things of both are gone. So whether taking something away joins two regions,
and what has to go where one thing is not enough, are questions to a graph of some hundred cells, with exact answers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_namo.regions.borders import shared_borders
from pbrl_namo.regions.free_space import SMALLEST, FreeSpace, grow, shrink
from pbrl_namo.scene import NamoScene


@dataclass(frozen=True)
class Cells:
    """Cells of the floor that nothing fixed blocks.

    Attributes:
        names: of the movable things.
        masks: of each cell: bit k is set where thing k of `names` is in the way.
        regions: of each cell, its index in the free space; -1 where something is in the way.
        neighbours: of each cell, those with which it shares a piece of border.
    """

    names: tuple[str, ...]
    masks: tuple[int, ...]
    regions: tuple[int, ...]
    neighbours: tuple[tuple[int, ...], ...]

    def things(self, mask: int) -> tuple[str, ...]:
        """Return the names of a mask."""
        return tuple(name for bit, name in enumerate(self.names) if mask >> bit & 1)

    def joined(self, allowed: int) -> list[set[int]]:
        """Return the sets of regions that are one as soon as the things of a mask are gone, two or more in each.

        This is what `free_space` with those things left out would tell, without building it.
        """
        groups: list[set[int]] = []
        seen: set[int] = set()
        for first, mask in enumerate(self.masks):
            if mask == 0 or mask & ~allowed or first in seen:
                continue
            found: set[int] = set()
            stack = [first]
            seen.add(first)
            while stack:
                cell = stack.pop()
                if self.regions[cell] >= 0:
                    found.add(self.regions[cell])
                for other in self.neighbours[cell]:
                    if other not in seen and not self.masks[other] & ~allowed:
                        seen.add(other)
                        stack.append(other)
            if len(found) > 1:
                groups.append(found)
        return groups


def cut_floor(scene: NamoScene, free: FreeSpace) -> Cells:
    """Cut up the floor of a scene into cells.

    Args:
        scene: things where they stand.
        free: its free space, nothing left out.
    """
    names = tuple(scene.movable)
    floor = shrink(scene.room, free.radius).difference(shapely.union_all(grow(list(scene.fixed.values()), free.radius)))
    grown = grow([scene.outlines[name] for name in names], free.radius)
    lines = shapely.union_all(shapely.boundary(np.append(grown, floor)))  # whole: a line cut off first would not close
    faces = np.array([face for face in shapely.get_parts(shapely.polygonize([lines])) if face.area > SMALLEST])
    inside = shapely.point_on_surface(faces)
    kept = shapely.intersects(floor, inside)
    faces, inside = faces[kept], inside[kept]
    if len(faces) == 0:
        return Cells(names, (), (), ())
    masks = [0] * len(faces)
    for face, thing in shapely.STRtree(grown).query(inside, predicate="intersects").T if len(names) else ():
        masks[face] |= 1 << int(thing)
    regions = np.where(np.array(masks, dtype=object) == 0, free.indices(shapely.get_coordinates(inside)), -1)
    return Cells(names, tuple(masks), tuple(int(region) for region in regions), _neighbours(faces))


def _neighbours(faces: NDArray[np.object_]) -> tuple[tuple[int, ...], ...]:
    """Return of each face those with which it shares a piece of border."""
    found: list[set[int]] = [set() for _ in faces]
    for a, b in shared_borders(faces)[0].tolist():
        found[a].add(b)
        found[b].add(a)
    return tuple(tuple(sorted(others)) for others in found)
