"""Reference ways: free all along, and there exactly where there is one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from manipulation_rooms import box, two_tables

from pbrl_namo.manipulation.reference_kernel import in_sight
from pbrl_namo.manipulation.rollout import reference_ways
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions import Opening, free_space
from pbrl_namo.scene import Movable, NamoScene

CELL = 0.025


@pytest.mark.parametrize("name", ["square", "long"])
@pytest.mark.parametrize("radius", [0.3, 0.52])
def test_ways_keep_the_discs_distance_from_all_but_what_is_taken_out(name: str, radius: float) -> None:
    scene = two_tables()
    yard = Yard.of(scene, radius, CELL)
    target, starts = np.array([5.2, 2.0]), [np.array([0.9, 2.0]), np.array([0.6, 3.4]), np.array([1.5, 0.7])]
    blocked = shapely.union_all([o for n, o in scene.outlines.items() if n != name])
    ways = reference_ways(yard, Opening(0, 1, name), target, starts)
    for start, way in zip(starts, ways, strict=True):
        assert way is not None
        assert way[0] == pytest.approx(start)
        assert way[-1] == pytest.approx(target)
        line = shapely.LineString(way)
        assert min(line.distance(blocked), line.distance(scene.room.exterior)) >= radius - 1e-6
        assert len(way) < 30  # straightened


def test_without_a_way_there_is_none() -> None:
    scene = two_tables()
    walled = NamoScene(
        scene.room,
        {"wall": shapely.Polygon(box(0.1, 5.0, (2.2, 2.0)))},
        scene.movable,
        scene.poses,
        scene.start,
        scene.goal,
    )
    yard = Yard.of(walled, 0.52, CELL)
    assert reference_ways(yard, Opening(0, 1, "long"), np.array([5.2, 2.0]), [np.array([0.9, 2.0])]) == [None]


@pytest.mark.parametrize("slack", [0.001, 0.02, 0.1])
def test_a_narrow_passage_is_found(slack: float) -> None:
    """A gap that is hardly wider than the disc: too narrow for the grid, not for the exact free space."""
    radius = 0.52
    gap = 2.0 * radius + slack
    room = box(6.0, 4.0, (3.0, 2.0))
    fixed = {
        "low": np.array([[2.5, 0.0], [2.7, 0.0], [2.7, 1.0], [2.5, 1.0]]),
        "high": np.array([[2.5, 1.0 + gap], [2.7, 1.0 + gap], [2.7, 4.0], [2.5, 4.0]]),
    }
    thing = Movable(box(0.5, 0.5))
    scene = NamoScene.of(room, fixed, {"thing": thing}, {"thing": np.array([2.6, 1.5, 0.0])}, np.ones(3), np.ones(3))
    (way,) = reference_ways(
        Yard.of(scene, radius, CELL), Opening(0, 1, "thing"), np.array([5.0, 2.0]), [np.array([1.0, 2.0])]
    )
    assert way is not None
    without = free_space(scene, radius, leave_out="thing")
    assert without.regions[0].buffer(1e-9).covers(shapely.LineString(way))


def test_several_things_can_be_taken_out() -> None:
    yard = Yard.of(two_tables(), 0.52, CELL)
    both = Opening(0, 1, "long", ("square",))
    (way,) = reference_ways(yard, both, np.array([5.2, 2.0]), [np.array([0.9, 2.0])])
    assert way is not None
    assert shapely.LineString(way).length == pytest.approx(4.3, abs=0.1)  # straight through where both stood
    assert np.array_equal(yard.owned(("long", "square")), yard.owned(("long",)) | yard.owned(("square",)))


def test_grids_marks_are_taken_off_again() -> None:
    grid = Yard.of(two_tables(), 0.52, CELL).grid
    owners = grid.pieces.owners
    parts = [grid.marks_of(owners == owner) for owner in np.unique(owners)]
    assert np.array_equal(sum(parts), grid.counts)
    assert not grid.marks_of(np.zeros(len(owners), dtype=bool)).any()


@pytest.mark.parametrize("seed", range(30))
def test_sight_is_free_only_where_every_touched_cell_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts, own = (rng.random((12, 15)) < 0.08).astype(np.int16), np.zeros((12, 15), dtype=np.int16)
    (i, j), (k, m) = rng.integers([0, 0], [12, 15], (2, 2))
    counts[i, j] = counts[k, m] = 0
    line = shapely.LineString([(j + 0.5, i + 0.5), (m + 0.5, k + 0.5)])
    touched = [
        (y, x) for y, x in zip(*np.nonzero(counts), strict=True) if line.intersects(shapely.box(x, y, x + 1, y + 1))
    ]
    inside = [(y, x) for y, x in touched if line.intersection(shapely.box(x, y, x + 1, y + 1)).length > 1e-9]
    seen = in_sight(counts, own, int(i * 15 + j), int(k * 15 + m))
    assert not (seen and inside)
    assert seen or touched
