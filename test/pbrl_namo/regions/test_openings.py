"""Openings are what free spaces with things left out say, and what the roadmap says can be grasped."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from region_cases import box, corridor, office, table

from pbrl_namo.errors import NamoError
from pbrl_namo.regions import FreeSpace, Opening, RegionSettings, Roadmap, build_roadmap, cut_off, free_space, openings
from pbrl_namo.regions.cells import cut_floor
from pbrl_namo.scene import NamoScene


def worked_out(scene: NamoScene, seed: int = 0) -> tuple[FreeSpace, Roadmap, tuple[Opening, ...]]:
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(seed))
    return free, roadmap, openings(scene, free, roadmap)


def joined_without(scene: NamoScene, free: FreeSpace, names: set[str]) -> set[frozenset[int]]:
    """Regions that are one without some things, by building that free space."""
    more = free_space(scene, free.radius, leave_out=names)
    where: dict[int, set[int]] = {}
    for number, region in enumerate(free.regions):
        middle = region.point_on_surface()
        where.setdefault(int(more.indices(np.array([[middle.x, middle.y]]))[0]), set()).add(number)
    assert -1 not in where
    return {frozenset(group) for group in where.values() if len(group) > 1}


@pytest.mark.parametrize("seed", range(4))
def test_cells_tell_what_free_spaces_with_things_left_out_tell(seed: int) -> None:
    scene = office(14, seed)
    free = free_space(scene)
    cells = cut_floor(scene, free)
    sets = [{name} for name in scene.movable]
    rng = np.random.default_rng(seed)
    sets += [set(rng.choice(list(scene.movable), size, replace=False)) for size in (2, 3, 5, 8) for _ in range(4)]
    for names in [*sets, set(scene.movable)]:
        mask = sum(1 << cells.names.index(name) for name in names)
        assert {frozenset(group) for group in cells.joined(mask)} == joined_without(scene, free, names)


@pytest.mark.parametrize("seed", range(3))
def test_every_opening_can_help_and_be_done_and_none_is_missing(seed: int) -> None:
    scene = office(16, 10 + seed)
    free, roadmap, found = worked_out(scene)
    expected = {
        Opening(start, end, name)
        for name in scene.movable
        for group in joined_without(scene, free, {name})
        for start, end in permutations(group, 2)
        if start in roadmap.grasp_regions(name)
    }
    assert {opening for opening in found if not opening.then} == expected
    for opening in found:
        assert opening.start in roadmap.grasp_regions(opening.object)
        groups = joined_without(scene, free, {opening.object, *opening.then})
        assert any({opening.start, opening.end} <= group for group in groups)
    assert list(found) == sorted(set(found))


def test_one_table_across_a_corridor_is_an_opening_each_way() -> None:
    free, _, found = worked_out(corridor(6.0))
    assert found == (Opening(0, 1, "table_1"), Opening(1, 0, "table_1"))
    assert cut_off(free, found, 0) == cut_off(free, found, 1) == ()


def test_tables_far_apart_are_opened_one_after_the_other() -> None:
    free, _, found = worked_out(corridor(4.0, 8.0))
    assert len(free.regions) == 3
    assert {(o.start, o.end, o.object) for o in found} == {
        (a, b, name)
        for name in ("table_1", "table_2")
        for a, b in permutations(range(3), 2)
        if not_across(free, a, b, name)
    }
    assert not any(opening.then for opening in found)
    assert cut_off(free, found, 0) == ()


def not_across(free: FreeSpace, a: int, b: int, name: str) -> bool:
    x = {"table_1": 4.0, "table_2": 8.0}[name]
    sides = sorted(free.regions[region].centroid.x for region in (a, b))
    return sides[0] < x < sides[1] and sides[1] - sides[0] < 6.0


@pytest.mark.parametrize("count", [2, 3])
def test_tables_in_a_row_are_opened_by_one_with_the_others_behind_it(count: int) -> None:
    names = [f"table_{number + 1}" for number in range(count)]
    free, _, found = worked_out(corridor(*(5.0 + 0.9 * number for number in range(count))))
    assert len(free.regions) == 2
    left = int(np.argmin([region.centroid.x for region in free.regions]))
    assert found == tuple(
        sorted(
            (
                Opening(left, 1 - left, names[0], tuple(names[1:])),
                Opening(1 - left, left, names[-1], tuple(names[:-1])),
            )
        )
    )
    assert cut_off(free, found, 0) == ()


def test_a_table_that_nothing_can_grip_opens_nothing_and_cuts_off() -> None:
    free, roadmap, found = worked_out(corridor(6.0, height=0.4))
    assert len(free.regions) == 2 and roadmap.grasps == {"table_1": ()}
    assert found == () and cut_off(free, found, 0) == (1,)


def test_a_table_beside_a_wall_that_closes_opens_nothing() -> None:
    scene = corridor(6.0, fixed={"wall": box(7.0, 0.0, 7.1, 2.6)})
    free, roadmap, found = worked_out(scene)
    assert roadmap.grasps["table_1"] and found == ()
    assert cut_off(free, found, 0) == (1,)


def test_grasps_on_both_sides_make_no_opening_where_the_gap_is_too_narrow_anyway() -> None:
    """The thesis's rule alone would take the first table for an opening: it can be gripped from both regions."""
    gap = table(0.75, 0.9)
    scene = NamoScene.of(
        box(0.0, 0.0, 12.0, 5.0),
        {"low": box(5.95, 0.0, 6.05, 1.0), "post": box(5.95, 1.95, 6.05, 3.2)},
        {"table_1": gap, "table_2": gap},
        {"table_1": np.array([6.0, 1.475, 0.0]), "table_2": np.array([6.0, 4.1, 0.0])},
        np.array([1.0, 1.3, 0.0]),
        np.array([11.0, 1.3, 0.0]),
    )
    _, roadmap, found = worked_out(scene)
    assert roadmap.grasp_regions("table_1") == {0, 1}
    assert found == (Opening(0, 1, "table_2"), Opening(1, 0, "table_2"))


def test_an_opening_is_there_though_the_thing_can_be_gripped_from_one_side_only() -> None:
    """The thesis's rule alone would miss it: beyond the table there is room for the disc, not for a grasp."""
    half = 0.5225
    posts = {"low": box(7.0, 0.0, 7.3, 1.3 - half), "high": box(7.0, 1.3 + half, 7.3, 2.6)}
    free, roadmap, found = worked_out(corridor(6.0, fixed=posts))
    left, right = np.argsort([region.centroid.x for region in free.regions]).tolist()
    assert roadmap.grasp_regions("table_1") == {left}
    assert found == (Opening(left, right, "table_1"),)
    assert cut_off(free, found, left) == () and cut_off(free, found, right) == (left,)


def test_a_room_without_furniture_has_one_region_and_no_openings() -> None:
    free, _, found = worked_out(corridor())
    assert len(free.regions) == 1 and found == () and cut_off(free, found, 0) == ()


def test_a_room_too_small_for_the_robot_has_no_openings() -> None:
    scene = NamoScene.of(
        box(0, 0, 1, 1), {}, {"t": table(0.3, 0.3)}, {"t": np.array([0.5, 0.5, 0])}, *np.full((2, 3), 0.5)
    )
    assert worked_out(scene)[2] == ()


def test_two_things_in_the_same_place_have_to_go_both() -> None:
    _, _, found = worked_out(corridor(6.0, 6.0))
    assert {(o.object, o.then) for o in found} <= {("table_1", ("table_2",)), ("table_2", ("table_1",))}


def test_openings_need_a_roadmap_of_the_same_radius_and_room() -> None:
    scene = corridor(6.0)
    free = free_space(scene)
    with pytest.raises(NamoError, match="expected one radius"):
        openings(scene, free, build_roadmap(scene, np.random.default_rng(0), RegionSettings(radius=0.4)))
    with pytest.raises(NamoError, match="got one of another"):
        openings(scene, free, build_roadmap(corridor(4.0), np.random.default_rng(0)))
    with pytest.raises(NamoError, match="got one without"):
        openings(
            scene,
            free,
            build_roadmap(replace(scene, movable={}, poses={}, fixed=scene.outlines), np.random.default_rng(0)),
        )


@pytest.mark.parametrize("start", [-1, 2])
def test_what_is_cut_off_from_no_region_is_refused(start: int) -> None:
    free, _, found = worked_out(corridor(6.0))
    with pytest.raises(NamoError, match="expected a region from 0 to 1"):
        cut_off(free, found, start)


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_reached_that_fixed_things_cut_off(seed: int) -> None:
    scene = office(20, 20 + seed)
    free, _, found = worked_out(scene)
    together = joined_without(scene, free, set(scene.movable))
    for start in range(len(free.regions)):
        reached = set(range(len(free.regions))) - set(cut_off(free, found, start))
        assert reached == {start} or any(reached <= group for group in together)
