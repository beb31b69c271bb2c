"""The free space: what is in it the disc can stand on, what is not it cannot."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from region_cases import box, corridor, office, table

from pbrl_control.navigation.footprint import KRANG_STOWED, Footprint
from pbrl_namo.errors import NamoError
from pbrl_namo.regions import drive_radius, free_space
from pbrl_namo.scene import NamoScene

ROUNDING = 1e-3  # [m] the arcs about corners are chords


@pytest.mark.parametrize("seed", range(3))
def test_a_disc_stands_free_in_a_region_and_touches_something_outside_of_all(seed: int) -> None:
    scene = office(15, seed)
    free = free_space(scene)
    points = np.random.default_rng(seed).uniform(*np.reshape(scene.room.bounds, (2, 2)), (600, 2))
    region = free.indices(points)
    things = shapely.union_all([*scene.fixed.values(), *scene.outlines.values()])
    away = np.minimum(
        shapely.distance(things, shapely.points(points)), shapely.distance(scene.room.exterior, shapely.points(points))
    )
    assert (region >= 0).any() and (region < 0).any()
    assert away[region >= 0].min() >= free.radius - ROUNDING
    assert away[region < 0].max() <= free.radius + ROUNDING


@pytest.mark.parametrize(("gap", "regions"), [(1.038, 2), (1.042, 1)])
def test_the_disc_passes_a_gap_as_wide_as_itself_and_no_narrower(gap: float, regions: int) -> None:
    walls = {"low": box(3.9, 0.0, 4.1, 1.3 - gap / 2), "high": box(3.9, 1.3 + gap / 2, 4.1, 2.6)}
    assert len(free_space(corridor(fixed=walls)).regions) == regions


def test_the_default_radius_is_half_the_robots_width_and_a_margin() -> None:
    assert drive_radius(KRANG_STOWED) == pytest.approx(0.52)
    assert free_space(corridor(6.0)).radius == pytest.approx(0.52)
    assert drive_radius(Footprint.circle(0.2), 0.05) == pytest.approx(0.25, abs=2e-3)


def test_leaving_things_out_only_adds_and_leaving_all_out_leaves_what_is_fixed() -> None:
    scene = office(10, 4)
    free = shapely.union_all(free_space(scene).regions)
    for name in scene.movable:
        more = shapely.union_all(free_space(scene, leave_out=name).regions)
        assert free.difference(more).area < 1e-5
    empty = free_space(scene, leave_out=set(scene.movable))
    bare = NamoScene(scene.room, scene.fixed, {}, {}, scene.start, scene.goal)
    assert [r.wkb for r in empty.regions] == [r.wkb for r in free_space(bare).regions]


def test_regions_are_largest_first_and_every_run_gives_the_same_bytes() -> None:
    one, two = free_space(office(20, 5)), free_space(office(20, 5))
    areas = [region.area for region in one.regions]
    assert areas == sorted(areas, reverse=True)
    assert [region.wkb for region in one.regions] == [region.wkb for region in two.regions]


def test_regions_of_one_size_are_ordered_by_place() -> None:
    free = free_space(corridor(6.0))
    assert [round(region.centroid.x) for region in free.regions] == [3, 9]


def test_one_point_and_many_points_get_one_answer() -> None:
    scene = office(12, 6)
    free = free_space(scene)
    points = np.random.default_rng(0).uniform(-1.0, 12.0, (300, 2))
    alone = [free.index(point) for point in points]
    assert free.indices(points).tolist() == [-1 if index is None else index for index in alone]
    assert free.indices(np.zeros((0, 2))).shape == (0,)


def test_a_room_too_small_for_the_robot_has_no_region() -> None:
    small = NamoScene.of(box(0, 0, 1, 1), {}, {}, {}, np.array([0.5, 0.5, 0]), np.array([0.5, 0.5, 0]))
    free = free_space(small)
    assert free.regions == () and free.index(np.array([0.5, 0.5])) is None
    assert free.indices(np.array([[0.5, 0.5]])).tolist() == [-1]


def test_things_that_overlap_or_reach_out_of_the_room_count_as_what_they_cover_together() -> None:
    twice = corridor(6.0, 6.0)
    assert [r.area for r in free_space(twice).regions] == pytest.approx(
        [r.area for r in free_space(corridor(6.0)).regions]
    )
    out = corridor(6.0).moved({"table_1": np.array([0.0, 0.0, 0.3])})
    assert len(free_space(out).regions) == 1


@pytest.mark.parametrize("radius", [0.0, -0.5, np.nan, np.inf])
def test_a_radius_that_cannot_be_is_refused(radius: float) -> None:
    with pytest.raises(NamoError, match="positive radius"):
        free_space(corridor(6.0), radius)


@pytest.mark.parametrize("names", ["chair", ["table_1", "chair"]])
def test_leaving_out_what_is_not_there_is_refused(names: str | list[str]) -> None:
    with pytest.raises(NamoError, match="expected one of table_1, got 'chair'"):
        free_space(corridor(6.0), leave_out=names)


def test_a_point_that_is_no_number_is_in_no_region() -> None:
    assert free_space(corridor()).index(np.array([np.nan, 1.0])) is None


def test_a_table_with_corners_the_other_way_round_is_the_same_table() -> None:
    scene = corridor(6.0)
    turned = NamoScene.of(
        np.asarray(scene.room.exterior.coords)[:-1],
        {},
        {"table_1": type(table())(table().footprint[::-1], 0.7775)},
        dict(scene.poses),
        scene.start,
        scene.goal,
    )
    assert [r.area for r in free_space(turned).regions] == pytest.approx([r.area for r in free_space(scene).regions])
