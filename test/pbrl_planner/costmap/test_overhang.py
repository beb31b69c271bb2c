"""What a nodding laser sees over the floor: a slab on a wall, seen from above; what skims it, what goes under it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely import affinity, box, contains_xy

from pbrl_control.planar import Array, on_floor, placed
from pbrl_planner.costmap import Costmap, CostmapSettings, OverhangSettings, RangeScan
from pbrl_planner.costmap.rolling import roll
from pbrl_planner.errors import PlannerError

HEIGHT, SLAB, NEAR, FAR, WALL = 1.26, (0.70, 0.74), 1.5, 2.2, 4.0
"""Of the laser, of a slab from `NEAR` to `FAR`, 1.4 m wide, and of the wall behind it [m]."""
ANGLES = -0.82 + 0.02 * np.arange(83)
STILL = np.zeros(3)


def laser(time: float, robot: Array = STILL) -> Array:
    """Pose (4, 4) of a laser that nods once in 4 s between 0.4 rad up and 1.05 rad down."""
    down = 1.05 - 1.45 * abs((time / 2.0) % 2.0 - 1.0)
    pose = on_floor(robot)
    pose[2, 3] = HEIGHT
    c, s = math.cos(down), math.sin(down)
    pose[:3, :3] = pose[:3, :3] @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return pose


def scan(time: float, slab: bool, rng: np.random.Generator) -> RangeScan:
    """What it sees of floor, wall and slab from the origin, with noise of 1 cm."""
    pose = laser(time)
    rays = np.column_stack((np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES))) @ pose[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.where(rays[:, 2] < 0.0, -HEIGHT / rays[:, 2], np.inf)
        ranges = np.minimum(ranges, np.where(rays[:, 0] > 0.0, WALL / rays[:, 0], np.inf))
        for far, axis, span in (((SLAB[1] - HEIGHT) / rays[:, 2], 0, (NEAR, FAR)), (NEAR / rays[:, 0], 2, SLAB)):
            ends = [0.0, 0.0, HEIGHT] + far[:, None] * rays
            on = (far > 0.0) & (ends[:, axis] > span[0]) & (ends[:, axis] < span[1]) & (np.abs(ends[:, 1]) < 0.7)
            ranges = np.where(on & slab, np.minimum(ranges, far), ranges)
    return RangeScan(time, float(ANGLES[0]), 0.02, (0.1, 30.0), ranges + rng.normal(0.0, 0.01, len(ranges)))


def taken(costmap: Costmap, now: float) -> Array:
    """Centres (n, 2) of lethal cells [m]."""
    field = costmap.field(now)
    rows, columns = np.nonzero(field.cells == 254)
    return np.column_stack((columns, rows)) * field.resolution + field.resolution / 2 + field.origin


def watched(costmap: Costmap, times: Array, slab: bool, rng: np.random.Generator) -> None:
    for time in times:
        costmap.observe_nodding(scan(float(time), slab, rng), laser(float(time)))


def of_slab(points: Array) -> Array:
    return contains_xy(box(NEAR - 0.05, -0.75, FAR + 0.05, 0.75), *points.T)


def test_a_slab_is_marked_where_it_is_stays_as_long_as_it_is_there_and_goes_when_it_is_gone(
    rng: np.random.Generator,
) -> None:
    costmap = Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0))
    watched(costmap, np.arange(0.0, 8.0, 0.05), True, rng)
    early = taken(costmap, 8.0)
    assert of_slab(early).sum() > 50, "seen from above"
    assert (of_slab(early) | (early[:, 0] > WALL - 0.1)).all(), "and nothing but slab and wall, not the floor either"
    watched(costmap, np.arange(8.0, 60.0, 0.05), True, rng)
    late = taken(costmap, 60.0)
    assert {tuple(each) for each in early[of_slab(early)].round(3)} <= {tuple(each) for each in late.round(3)}, (
        "beams that skim it on the way to another place of it say nothing against it"
    )
    watched(costmap, np.arange(60.0, 90.0, 0.05), False, rng)
    assert not of_slab(taken(costmap, 90.0)).any(), "beams go through where it was"


def test_it_is_the_same_from_any_side(rng: np.random.Generator) -> None:
    scans = [(t, scan(t, True, rng)) for t in np.arange(0.0, 4.0, 0.05).tolist()]
    counts = []
    for robot in (STILL, np.array([3.0, -2.0, 2.1])):
        costmap = Costmap(CostmapSettings(resolution=0.05, width=14.0, height=14.0), centre=(robot[0], robot[1]))
        for time, each in scans:
            costmap.observe_nodding(each, laser(time, robot))
        points = taken(costmap, 4.0)
        corners = affinity.affine_transform(
            box(NEAR - 0.05, -0.75, FAR + 0.05, 0.75),
            [*on_floor(robot)[:2, :2].ravel(), *robot[:2]],
        )
        wall = placed(np.array([[WALL, 0.0]]), robot)[0]
        ahead = (points - wall) @ on_floor(robot)[:2, 0] > -0.1
        assert (contains_xy(corners, *points.T) | ahead).all()
        counts.append(int(contains_xy(corners, *points.T).sum()))
    assert counts[1] == pytest.approx(counts[0], rel=0.15)


def test_what_is_under_it_is_not_the_level_lasers_to_free(rng: np.random.Generator) -> None:
    costmap = Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0))
    watched(costmap, np.arange(0.0, 8.0, 0.05), True, rng)
    before = of_slab(taken(costmap, 8.0)).sum()
    for k in range(40):
        costmap.observe(RangeScan(8.0 + 0.05 * k, -1.0, 0.02, (0.1, 30.0), np.full(101, 3.9)), (0.0, 0.0, 0.0))
    assert of_slab(taken(costmap, 8.0)).sum() == before and costmap.time == pytest.approx(9.95)


def test_it_does_not_keep_a_costmap_fresh(rng: np.random.Generator) -> None:
    costmap = Costmap(CostmapSettings())
    watched(costmap, np.arange(0.0, 1.0, 0.05), True, rng)
    assert costmap.time == -math.inf


def test_robot_and_cart_are_left_out_and_recoveries_take_out_what_they_say(rng: np.random.Generator) -> None:
    own = [np.array([[NEAR - 0.1, -0.8], [FAR + 0.1, -0.8], [FAR + 0.1, 0.8], [NEAR - 0.1, 0.8]])]
    costmap = Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0))
    report = [costmap.observe_nodding(scan(t, True, rng), laser(t), own).own for t in (0.8, 0.85, 0.9, 0.95, 1.0)]
    assert sum(report) > 20 and not of_slab(taken(costmap, 1.0)).any()
    watched(costmap, np.arange(1.0, 9.5, 0.05), True, rng)
    marked = int(of_slab(taken(costmap, 9.5)).sum())
    cleared = costmap.clear_inside(own)
    assert len(cleared.places) >= marked and not of_slab(taken(costmap, 9.5)).any()
    watched(costmap, np.arange(9.5, 17.5, 0.05), True, rng)
    costmap.clear_unconfirmed()
    assert of_slab(taken(costmap, 17.5)).sum() > 0.8 * marked, "it has stayed where it is"
    assert len(costmap.clear_unseen(17.5, 100.0).places) == 0
    assert len(costmap.clear_unseen(30.0, 5.0).places) > 0 and not of_slab(taken(costmap, 30.0)).any()


def test_what_nobody_sees_is_forgotten_in_time(rng: np.random.Generator) -> None:
    costmap = Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0))
    watched(costmap, np.arange(0.0, 16.0, 0.05), True, rng)
    remembered = of_slab(taken(costmap, 16.0)).sum()
    sure = of_slab(taken(costmap, 40.0)).sum()
    assert 0 < sure <= remembered, "what was seen often is remembered for a minute"
    assert not of_slab(taken(costmap, 80.0)).any()


def test_columns_keep_their_place_when_the_window_rolls(rng: np.random.Generator) -> None:
    costmap = Costmap(CostmapSettings(resolution=0.05, width=8.0, height=8.0))
    watched(costmap, np.arange(0.0, 4.0, 0.05), True, rng)
    before = {tuple(each) for each in taken(costmap, 4.0).round(3) if of_slab(each[None]).all()}
    costmap.recentre(0.73, -0.4)
    after = {tuple(each) for each in taken(costmap, 4.0).round(3) if of_slab(each[None]).all()}
    assert before == after
    costmap.recentre(100.0, 0.0)
    assert len(taken(costmap, 4.0)) == 0


def test_a_layer_of_columns_rolls_as_its_cells_do(rng: np.random.Generator) -> None:
    layer = rng.integers(0, 9, (6, 5, 3))
    moved = layer.copy()
    roll(moved, 2, -1, 0)
    assert np.array_equal(moved[:4, 1:], layer[2:, :4]) and not moved[4:].any() and not moved[:, :1].any()
    roll(moved, 7, 0, 0)
    assert not moved.any()


@pytest.mark.parametrize("fault", [math.nan, math.inf, 1e9])
def test_a_pose_of_nowhere_is_refused(fault: float) -> None:
    pose = laser(0.0)
    pose[0, 3] = fault
    with pytest.raises(PlannerError, match=r"pose \(4, 4\)"):
        Costmap().observe_nodding(RangeScan(0.0, 0.0, 0.1, (0.1, 30.0), np.ones(3)), pose)


def test_readings_that_mean_nothing_change_nothing() -> None:
    costmap = Costmap()
    ranges = np.array([math.nan, 0.01, -1.0, math.inf, 1e300])
    report = costmap.observe_nodding(RangeScan(0.0, 0.0, 0.1, (0.1, 30.0), ranges), laser(0.0))
    assert (report.occupied, report.freed, report.own) == (0, 0, 0) and len(taken(costmap, 0.0)) == 0


def test_who_passes_leaves_nothing_behind_and_who_stays_does() -> None:
    costmap, level = Costmap(CostmapSettings(resolution=0.05, width=10.0, height=10.0)), laser(0.0)
    level[:3, :3] = np.eye(3)
    for k in range(100):  # somebody walks by at 1 m/s, 2 m ahead, somebody else stands there
        time, aside = 0.05 * k, -2.0 + 0.05 * k
        ranges = np.full(83, math.inf)
        for place in (aside, 1.2):
            bearing = np.abs(ANGLES - math.atan2(place, 2.0)) < 0.1
            ranges[bearing] = math.hypot(2.0, place)
        blind = RangeScan(time, float(ANGLES[0]), 0.02, (0.1, 30.0), np.where(np.isinf(ranges), math.nan, ranges))
        costmap.observe_nodding(blind, level)  # where it sees nobody it sees nothing: none is freed by looking
    walked = [(2.0, y) for y in (-1.0, -0.5, 0.0, 0.5)]
    soon, late = taken(costmap, 5.0), taken(costmap, 12.0)
    near = [np.hypot(*(soon - place).T).min() < 0.1 for place in walked]
    assert all(near), "not forgotten at once"
    assert len(late) and np.hypot(*(late - [2.0, 1.2]).T).max() < 0.4, "he who stands is remembered, and nobody else"


@pytest.mark.parametrize(
    ("told", "word"),
    [
        ({"lowest": 1.0, "highest": 0.5}, "levels"),
        ({"level": 0.02, "highest": 5.0}, "levels"),
        ({"hit": 9}, "hit"),
        ({"settled": 9.0}, "settled"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(told: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        OverhangSettings(**told)
