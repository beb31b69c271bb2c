"""Which obstacle separates which regions: the actions of the upper level of the NAMO-MDP (thesis 6.2.1).

The thesis takes an obstacle to separate two regions where it has grasp samples in both. That is neither enough nor
needed. Not enough: something else may be in the way as well, so that nothing the robot does with the one obstacle can
open anything. Not needed: on the far side there may be no room for the robot to stand. So both are asked here, each for
what it can tell:

- *can it help?* exactly: the two regions are one in the free space without the obstacle. Where they are not, no place
  that it could be put would make them one, for there it stands in the way of more, not of less;
- *can it be done?* by the roadmap: the obstacle has a grasp sample in the region the robot would come from.

Where obstacles stand in a row, no single one may join two regions though all together would. Then there is no such
action, yet the goal is not out of reach: moving the first gives access to the next. For regions that no sequence of
single openings reaches there are openings with `then`: the obstacles behind the first one that also have to go, few of
them, by a search over the cells of the floor (Hauser's greedy search for a minimum constraint removal, 2014). Such an
opening has done its part when start and end are one in `free_space(scene, leave_out=then)`; after it everything is
planned anew.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

from pbrl_namo.errors import NamoError
from pbrl_namo.regions.cells import Cells, cut_floor
from pbrl_namo.regions.free_space import FreeSpace
from pbrl_namo.regions.roadmap import Roadmap
from pbrl_namo.scene import NamoScene

SAME_RADIUS = 1e-9
"""[m] between the radii of a free space and a roadmap that belong together."""


@dataclass(frozen=True, order=True)
class Opening:
    """Opening a path from one region to another by manipulating an obstacle.

    Attributes:
        start: region of the free space that the robot comes from.
        end: region that it wants to.
        object: obstacle to move; it can be grasped from `start`.
        then: further obstacles that have to go before the path is open; mostly none.
    """

    start: int
    end: int
    object: str
    then: tuple[str, ...] = ()


def openings(scene: NamoScene, free: FreeSpace, roadmap: Roadmap) -> tuple[Opening, ...]:
    """Find the openings of a scene, each way by itself, sorted.

    Args:
        scene: things where they stand.
        free: its free space, nothing left out.
        roadmap: over it.

    Raises:
        NamoError: roadmap and free space are of different scenes or radii.
    """
    _check(free, roadmap)
    cells = cut_floor(scene, free)
    reachable = [roadmap.grasp_regions(name) for name in cells.names]
    found = {
        Opening(start, end, name)
        for bit, name in enumerate(cells.names)
        if reachable[bit]
        for group in cells.joined(1 << bit)
        for start, end in permutations(sorted(group), 2)
        if start in reachable[bit]
    }
    return tuple(sorted(found | _chains(cells, reachable, found, len(free.regions))))


def closers(scene: NamoScene, free: FreeSpace, start: int, goal: int) -> tuple[Opening, ...]:
    """Return what stands between two regions, whether it can be grasped or not: fewest things to go first.

    Args:
        scene: things where they stand.
        free: its free space, nothing left out.
        start: region that the robot is in.
        goal: region that is wanted.
    """
    cells = cut_floor(scene, free)
    found = []
    for bit, name in enumerate(cells.names):
        ends = fewest_in_the_way(cells, start, 1 << bit)
        if goal in ends:
            then = tuple(other for other in cells.things(ends[goal][0]) if other != name)
            found.append(Opening(start, goal, name, then))
    return tuple(sorted(found, key=lambda each: (len(each.then), each)))


def cut_off(free: FreeSpace, found: Sequence[Opening], start: int) -> tuple[int, ...]:
    """Return the regions that no sequence of openings reaches from a region, in order.

    Raises:
        NamoError: there is no region `start`.
    """
    if not 0 <= start < len(free.regions):
        raise NamoError(f"cut off: expected a region from 0 to {len(free.regions) - 1}, got {start}")
    reached = reached_from(found, start)
    return tuple(region for region in range(len(free.regions)) if region not in reached)


def reached_from(found: Sequence[Opening] | set[Opening], start: int) -> set[int]:
    """Return the regions that sequences of openings reach from a region, itself among them."""
    onward: dict[int, list[int]] = {}
    for opening in found:
        onward.setdefault(opening.start, []).append(opening.end)
    reached, waiting = {start}, [start]
    while waiting:
        for end in onward.get(waiting.pop(), ()):
            if end not in reached:
                reached.add(end)
                waiting.append(end)
    return reached


def _check(free: FreeSpace, roadmap: Roadmap) -> None:
    if abs(free.radius - roadmap.radius) > SAME_RADIUS:
        raise NamoError(
            f"openings: expected one radius, got {free.radius} m of the free space and {roadmap.radius} m of the "
            "roadmap; build both with the same settings"
        )
    if (free.indices(roadmap.points) != roadmap.regions[roadmap.component]).any():
        raise NamoError("openings: expected a roadmap of this free space, got one of another; build it anew")


def _chains(cells: Cells, reachable: list[frozenset[int]], single: set[Opening], count: int) -> set[Opening]:
    """Return openings with further obstacles, to regions that sequences of single openings do not reach."""
    found: set[Opening] = set()
    for start in range(count):
        away = set(range(count)) - reached_from(single, start)
        graspable = sum(1 << bit for bit, regions in enumerate(reachable) if start in regions)
        if away and graspable:
            for end, (mask, first) in fewest_in_the_way(cells, start, graspable).items():
                if end in away:
                    name = cells.things(first)[0]
                    found.add(Opening(start, end, name, tuple(other for other in cells.things(mask) if other != name)))
    return found


def fewest_in_the_way(cells: Cells, start: int, graspable: int) -> dict[int, tuple[int, int]]:
    """Return which regions can be gone to through covered cells alone, what would have to go, and what first.

    The first cell has to be covered by something that can be grasped from the start. A cell is left with the smallest
    set of things it was reached with, so what is found is possible, but not always the least.

    Returns:
        By region: mask of everything that has to go, and of what can be moved first.
    """
    seen: set[int] = set()
    ends: dict[int, tuple[int, int]] = {}
    waiting: list[tuple[int, int, int, int]] = []
    for cell, region in enumerate(cells.regions):
        for other in cells.neighbours[cell] if region == start else ():
            mask = cells.masks[other]
            if mask & graspable:
                heapq.heappush(waiting, (mask.bit_count(), mask, other, mask & graspable))
    while waiting:
        _, mask, cell, first = heapq.heappop(waiting)
        if cell in seen:
            continue
        seen.add(cell)
        if cells.masks[cell] == 0:
            if cells.regions[cell] >= 0:
                ends.setdefault(cells.regions[cell], (mask, first))
            continue
        for other in cells.neighbours[cell]:
            if other not in seen and cells.regions[other] != start:
                union = mask | cells.masks[other]
                heapq.heappush(waiting, (union.bit_count(), union, other, first))
    return ends
