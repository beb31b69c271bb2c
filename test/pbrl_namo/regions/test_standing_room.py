"""Room to stand: what is in the way of a grasp, where no opening leads on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from region_cases import corridor, office, table

from pbrl_namo.regions import FreeSpace, build_roadmap, cut_off, free_space, openings, standing_room
from pbrl_namo.regions.standing_room import MOST, StandingRoom
from pbrl_namo.scene import NamoScene


def looked_for(scene: NamoScene) -> tuple[FreeSpace, tuple[int, ...], tuple[StandingRoom, ...]]:
    """Return the free space, what is cut off from the start, and what could be moved to change that."""
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(1))
    found = openings(scene, free, roadmap)
    start = free.index(scene.start)
    assert start is not None
    away = cut_off(free, found, start)
    return free, away, standing_room(scene, free, roadmap, found, start, np.random.default_rng(2))


def door_with_a_cabinet() -> NamoScene:
    """A table beyond a door; who would grasp it through the door stands where a cabinet is now."""
    walls = {"low": shapely.box(6.0, 0.0, 6.1, 1.6), "high": shapely.box(6.0, 3.4, 6.1, 5.0)}
    scene = replace(corridor(), room=shapely.box(0.0, 0.0, 12.0, 5.0), fixed=walls)
    things = {"table": table(0.75, 1.5), "cabinet": table(0.45, 0.8)}
    poses = {"table": np.array([6.55, 2.5, 0.0]), "cabinet": np.array([4.7, 2.5, 0.0])}
    return replace(scene, movable=things, poses=poses, start=np.array([1.0, 1.0, 0.0]), goal=np.array([11.0, 2.5, 0.0]))


def test_a_cabinet_before_the_table_in_the_door_is_what_to_move_first() -> None:
    scene = door_with_a_cabinet()
    free, away, rooms = looked_for(scene)
    assert away == (free.index(scene.goal),)
    assert {(room.object, room.blockers) for room in rooms} == {("table", ("cabinet",))}
    moved = scene.moved({"cabinet": np.array([1.0, 4.2, 0.0])})
    assert looked_for(moved)[1:] == ((), ())


def test_nothing_is_told_where_nothing_is_cut_off() -> None:
    assert looked_for(corridor(6.0))[1:] == ((), ())
    assert looked_for(corridor())[1:] == ((), ())


def test_nothing_is_told_where_only_fixed_things_are_in_the_way() -> None:
    walled = corridor(6.0, fixed={"wall": np.array([[7.0, 0.0], [7.1, 0.0], [7.1, 2.6], [7.0, 2.6]])})
    assert looked_for(walled)[1:] == ((1,), ())
    low = corridor(6.0, height=0.3)
    assert looked_for(low)[1:] == ((1,), ())


@pytest.mark.parametrize(("count", "seed"), [(5, 31), (10, 4), (20, 7), (40, 19)])
def test_a_place_is_free_and_leads_to_a_grasp_as_soon_as_its_blockers_are_gone(count: int, seed: int) -> None:
    scene = office(count, seed)
    free, away, rooms = looked_for(scene)
    assert away and rooms
    roadmap = build_roadmap(scene, np.random.default_rng(1))
    for room in rooms:
        assert room.region not in away and 0 < len(room.blockers) <= MOST and room.object not in room.blockers
        assert room.region in roadmap.grasp_regions(room.blockers[0])
        kept = {name: thing for name, thing in scene.movable.items() if name not in room.blockers}
        bare = replace(scene, movable=kept, poses={name: scene.poses[name] for name in kept})
        covered = shapely.Polygon(scene.robot.at(room.stand))
        assert bare.floor().free.covers(covered) and not scene.floor().free.covers(covered.buffer(0.6))
        after = free_space(bare)
        middle = free.regions[room.region].point_on_surface()
        assert after.index(room.stand) == after.index(np.array([middle.x, middle.y]))
