"""Things that leave no room to stand before another: what could be moved where no opening leads on.

An opening needs a place from which its obstacle can be grasped. Such a place may be taken by something that separates
no regions and so is in no opening, a cabinet beside the table in the door. Before a region is given up as cut off, this
is worth a move: it opens nothing by itself, but afterwards there is an opening that was not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from pbrl_control.navigation.footprint import reaching_arms
from pbrl_control.planar import Array
from pbrl_namo.regions.cells import Cells, cut_floor
from pbrl_namo.regions.free_space import FreeSpace, free_space, grow, shrink
from pbrl_namo.regions.grasps import Stands, sample_stands, swept_from
from pbrl_namo.regions.openings import Opening, fewest_in_the_way, reached_from
from pbrl_namo.regions.roadmap import Roadmap
from pbrl_namo.regions.settings import RegionSettings
from pbrl_namo.scene import NamoScene

MOST = 2
"""Things that may have to go to make room for one stand."""


@dataclass(frozen=True)
class StandingRoom:
    """A place before a thing that would be free if others went.

    Attributes:
        region: of those reached, from which the first of `blockers` can be moved, and then the place be driven to.
        object: what could then be grasped, to open a path to somewhere that nothing leads to now.
        blockers: what would have to go.
        stand: (3,) of the base in `world` [m, rad].
    """

    region: int
    object: str
    blockers: tuple[str, ...]
    stand: Array


def standing_room(
    scene: NamoScene,
    free: FreeSpace,
    roadmap: Roadmap,
    found: Sequence[Opening],
    start: int,
    rng: np.random.Generator,
    settings: RegionSettings | None = None,
) -> tuple[StandingRoom, ...]:
    """Find what could be moved to make room before things that close what is cut off; fewest things first.

    Args:
        scene: things where they stand.
        free: its free space.
        roadmap: over it.
        found: its openings.
        start: region that the robot is in.
        rng: draws the stands.
        settings: of grippers and arms.
    """
    settings = settings or RegionSettings()
    reached = reached_from(found, start)
    stands = sample_stands(scene, rng, settings, only=_closing(cut_floor(scene, free), reached), fine=True)
    middles = [shapely.get_coordinates(region.point_on_surface())[0] for region in free.regions]
    movable = {name for name in scene.movable if roadmap.grasp_regions(name) & reached}
    without: dict[frozenset[str], FreeSpace] = {}
    rooms: dict[tuple[int, tuple[str, ...], int, str], StandingRoom] = {}
    for row, blockers in enumerate(_blockers(stands, scene, free, settings)):
        if blockers is None or not 0 < len(blockers) <= MOST or not blockers & movable:
            continue
        if blockers not in without:
            without[blockers] = free_space(scene, free.radius, leave_out=blockers)
        name, after = stands.objects[stands.thing[row]], without[blockers]
        there = after.index(stands.poses[row])
        for region in sorted(reached) if there is not None else ():
            order = tuple(sorted(blockers, key=lambda other: (region not in roadmap.grasp_regions(other), other)))
            key = (len(order), order, region, name)
            within = region in roadmap.grasp_regions(order[0]) and after.index(middles[region]) == there
            if within and key not in rooms:
                rooms[key] = StandingRoom(region, name, order, stands.poses[row])
    return tuple(rooms[key] for key in sorted(rooms))


def _closing(cells: Cells, reached: set[int]) -> set[str]:
    """Return the things that could be the first to go, from some region that is reached, to open one that is not."""
    found: set[str] = set()
    for region in reached:
        beside = 0
        for cell, number in enumerate(cells.regions):
            for other in cells.neighbours[cell] if number == region else ():
                beside |= cells.masks[other]
        for bit, name in enumerate(cells.names):
            if name not in found and beside >> bit & 1 and set(fewest_in_the_way(cells, region, 1 << bit)) - reached:
                found.add(name)
    return found


def _blockers(
    stands: Stands, scene: NamoScene, free: FreeSpace, settings: RegionSettings
) -> list[frozenset[str] | None]:
    """Return of each stand the movable things that are in the way there; None where something else is as well.

    What is in the way of disc, robot and arms is asked one by one, and is together what `free_stands` asks at once.
    """
    grasp, names = settings.grasp, list(scene.movable)
    things = np.array([scene.outlines[name] for name in names], dtype=object)
    onward = grasp.standoff + grasp.depth
    middles = shapely.points(stands.poses[:, :2])
    body = swept_from(scene.robot, stands.poses, onward)
    arms = swept_from(reaching_arms(grasp.home[1]), stands.poses, onward)
    fixed = shapely.union_all(list(scene.fixed.values()))
    empty = shrink(scene.room, free.radius).difference(shapely.union_all(grow(list(scene.fixed.values()), free.radius)))
    bare = scene.room.difference(fixed)
    kept = (
        shapely.covers(empty, middles)
        & shapely.covers(bare.buffer(-grasp.clearance), body)
        & shapely.covers(bare, arms)
    )
    found: list[set[int]] = [set() for _ in range(len(stands.thing))]
    tree = shapely.STRtree(things)
    for shapes, distance, past_own in (
        (middles, free.radius, False),
        (body, grasp.clearance, False),
        (arms, 0.0, True),
    ):
        for row, thing in tree.query(shapes, predicate="dwithin", distance=distance).T.tolist():
            if not (past_own and thing == stands.thing[row]):
                found[row].add(thing)
    own = [int(thing) for thing in stands.thing]
    return [
        frozenset(names[thing] for thing in blocking) if kept[row] and own[row] not in blocking else None
        for row, blocking in enumerate(found)
    ]
