"""The costmap: beams against a slow reference, one's own body, frames, forgetting, recovery, staleness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely import LineString, Point, Polygon, box

from pbrl_control.planar import compose, inverse, rotation
from pbrl_planner.costmap import Costmap, CostmapSettings, RangeScan, StaticMap
from pbrl_planner.costmap.ray_kernel import HIT, PASSED, near_ring, trace
from pbrl_planner.errors import PlannerError

SPAN = (0.1, 30.0)
SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])


def scan_of(ranges: list[float] | np.ndarray, *, time: float = 0.0, increment: float = 0.1) -> RangeScan:
    ranges = np.asarray(ranges, dtype=float)
    return RangeScan(time, -increment * (len(ranges) // 2), increment, SPAN, ranges)


def settings_of(**changes: object) -> CostmapSettings:
    return CostmapSettings(**{"resolution": 0.05, "width": 4.0, "height": 4.0, **changes})


def lethal_of(costmap: Costmap, now: float = 0.0) -> np.ndarray:
    return costmap.field(now).cells == 254


def test_beams_touch_the_cells_that_a_slow_reference_finds(rng: np.random.Generator) -> None:
    size, resolution = 40, 0.05
    cells = [[box(j, i, j + 1, i + 1) for j in range(size)] for i in range(size)]
    for _ in range(12):
        pose = np.array([*rng.uniform(0.3, 1.7, 2), rng.uniform(-4, 4)])
        ranges = rng.uniform(0.05, 2.5, 5)
        ranges[rng.integers(5)] = rng.choice([np.inf, np.nan, 40.0])
        touched = np.zeros((size, size), dtype=np.uint8)
        blank = np.zeros((0, 2)), np.zeros(1, dtype=np.int64)
        trace(ranges, -1.0, 0.5, 0.1, 30.0, pose, 1.5, 2.0, *blank, 0.0, resolution, 0.0, 0.0, touched)
        expected = np.zeros_like(touched)
        hits = []
        for k, far in enumerate(ranges):
            if math.isnan(far) or far < 0.1:
                continue
            angle = pose[2] - 1.0 + 0.5 * k
            end = pose[:2] + min(far, 2.0) * np.array([math.cos(angle), math.sin(angle)])
            line = LineString([pose[:2] / resolution, end / resolution])
            last = tuple(np.floor(end / resolution).astype(int)[::-1])
            for i in range(size):
                for j in range(size):
                    if (i, j) != last and cells[i][j].intersects(line) and cells[i][j].intersection(line).length > 1e-9:
                        expected[i, j] = PASSED
            if far <= 1.5 and min(last) >= 0 and max(last) < size:
                hits.append(last)
        for hit in hits:
            expected[hit] = HIT
        assert np.array_equal(touched, expected)


def test_a_reading_marks_and_seeing_through_clears() -> None:
    costmap = Costmap(settings_of())
    costmap.observe(scan_of([1.02]), (0.0, 0.01, 0.0))
    assert costmap.field(0.0).cost(1.03, 0.01) == 254
    assert costmap.field(0.0).cost(0.2, 0.01) == 0
    assert costmap.field(0.0).cost(1.5, 0.5) == 255
    for k in range(2):
        assert costmap.field(0.0).cost(1.03, 0.01) == 254
        costmap.observe(scan_of([1.52], time=0.05 * (k + 1)), (0.0, 0.01, 0.0))
    assert costmap.field(0.1).cost(1.03, 0.01) < 253
    assert lethal_of(costmap, 0.1).sum() == 1, "what stands behind is marked now"


def test_what_is_seen_often_is_believed_longer_but_is_gone_within_evidence_at_most() -> None:
    costmap = Costmap(settings_of())
    for k in range(50):
        costmap.observe(scan_of([1.02], time=0.05 * k), (0.0, 0.01, 0.0))
    cleared = 0
    while costmap.field(3.0).cost(1.03, 0.01) == 254:
        costmap.observe(scan_of([np.inf], time=2.5 + 0.05 * cleared), (0.0, 0.01, 0.0))
        cleared += 1
    assert cleared == costmap.settings.evidence.most


def test_a_single_reading_is_forgotten_and_then_unknown_a_confirmed_one_later() -> None:
    evidence = CostmapSettings().evidence
    single, confirmed = Costmap(settings_of()), Costmap(settings_of())
    single.observe(scan_of([1.02]), (0.0, 0.01, 0.0))
    for _ in range(3):
        confirmed.observe(scan_of([1.02]), (0.0, 0.01, 0.0))
    for costmap, stays in ((single, evidence.fleeting), (confirmed, evidence.memory)):
        assert lethal_of(costmap, stays - 0.01).sum() == 1
        assert lethal_of(costmap, stays + 0.01).sum() == 0
        assert costmap.field(stays + 0.01).cost(1.03, 0.01) == 255


def test_readings_of_robot_and_cart_are_left_out_and_others_are_not(rng: np.random.Generator) -> None:
    cart = compose(np.array([0.3, -0.2, 0.5]), np.array([0.9, 0.1, 0.3]))
    outline = SQUARE @ rotation(cart[2]).T + cart[:2]
    polygon = Polygon(outline)
    ranges = rng.uniform(0.2, 1.8, 63)
    pose = np.array([0.3, -0.2, 0.5])
    scan = scan_of(ranges)
    costmap = Costmap(settings_of(own_margin=0.02))
    report = costmap.observe(scan, pose, [outline])
    angles = pose[2] + scan.angle_min + scan.increment * np.arange(63)
    ends = pose[:2] + ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    own = np.array([polygon.distance(Point(end)) <= 0.02 for end in ends])
    assert report.own == own.sum() > 5
    field = costmap.field(0.0)
    inside = [end for end, mine in zip(ends, own, strict=True) if not mine and np.abs(end).max() < 1.95]
    assert all(field.cost(*end) == 254 for end in inside)
    assert report.occupied == len({tuple(np.floor(end / 0.05).astype(int)) for end in inside})


def test_ring_distance_is_shapelys(rng: np.random.Generator) -> None:
    ring = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.4], [0.0, 1.0]])
    polygon = Polygon(ring)
    for point in rng.uniform(-1, 3, (500, 2)):
        for margin in (0.0, 0.2):
            assert near_ring(*point, ring, margin) == (polygon.distance(Point(point)) <= margin)


@pytest.mark.parametrize("cells", [(7, 3), (-40, 90)])
def test_moving_everything_by_whole_cells_changes_nothing(cells: tuple[int, int], rng: np.random.Generator) -> None:
    move = 0.05 * np.array(cells)
    here, there = Costmap(settings_of()), Costmap(settings_of(), centre=tuple(move), anchor=tuple(move))
    for k in range(4):
        scan = scan_of(rng.uniform(0.2, 4.0, 100), time=0.05 * k, increment=0.06)
        pose = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
        here.observe(scan, pose, [SQUARE])
        there.observe(scan, pose + np.array([*move, 0.0]), [SQUARE + move])
    assert np.array_equal(here.field(0.2).cells, there.field(0.2).cells)


def test_a_quarter_turn_of_everything_turns_the_cells(rng: np.random.Generator) -> None:
    settings = settings_of(width=4.0, height=4.0)
    here, there = Costmap(settings), Costmap(settings)
    quarter = np.array([0.0, 0.0, math.pi / 2])
    for k in range(3):
        scan = scan_of(rng.uniform(0.2, 1.9, 60), time=0.05 * k)
        pose = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3)])
        here.observe(scan, pose)
        there.observe(scan, compose(quarter, pose))
    assert np.array_equal(np.rot90(here.field(0.2).cells[::-1])[::-1], there.field(0.2).cells)


def test_rolling_keeps_each_cell_in_its_place() -> None:
    costmap = Costmap(settings_of())
    costmap.observe(scan_of(np.full(60, 1.33)), (0.0, 0.0, 0.0))
    before = costmap.field(0.0)
    costmap.recentre(0.52, -0.31)
    after = costmap.field(0.0)
    shift = np.round((np.array(after.origin) - before.origin) / 0.05).astype(int)
    assert tuple(shift) == (10, -7)
    rows, columns = before.cells.shape
    known = before.cells[: rows - 7, 10:], after.cells[7:, : columns - 10]
    assert np.array_equal(known[0] == 254, known[1] == 254)
    assert (after.cells[:5, :] >= 253).all(), "what comes in is unknown"
    costmap.recentre(1e5, 0.0)
    assert (costmap.field(0.0).cells == 255).all()


def test_a_cell_inside_the_footprint_is_cleared_by_recovery_which_says_so() -> None:
    costmap = Costmap(settings_of())
    costmap.observe(scan_of([1.02, 1.02, 1.02]), (0.0, 0.01, 0.0))
    outline = SQUARE + np.array([1.0, 0.0])
    recovery = costmap.clear_inside([outline])
    assert len(recovery.places) == 3 and recovery.left == 0
    assert [Polygon(outline).distance(Point(place)) < 0.05 for place in recovery.places] == [True] * 3
    assert recovery.evidence.tolist() == [costmap.settings.evidence.hit] * 3
    assert not lethal_of(costmap).any()
    assert len(costmap.clear_inside([outline]).places) == 0


def test_recovery_everywhere_takes_what_is_doubtful_and_leaves_what_is_confirmed() -> None:
    costmap = Costmap(settings_of())
    for k in range(4):
        costmap.observe(scan_of([1.02], time=0.05 * k), (0.0, 0.01, 0.0))
    costmap.observe(scan_of([0.72], time=0.2), (0.0, 0.01, math.pi))
    assert lethal_of(costmap, 0.2).sum() == 2
    recovery = costmap.clear_unconfirmed()
    assert np.allclose(recovery.places, [[-0.725, 0.025]])
    assert costmap.field(0.2).cost(1.03, 0.01) == 254


def test_recovery_of_what_nobody_sees_leaves_what_was_seen_just_now() -> None:
    costmap = Costmap(settings_of())
    for k in range(4):
        costmap.observe(scan_of([1.02], time=0.05 * k), (0.0, 0.01, 0.0))
    costmap.observe(scan_of([0.72], time=3.0), (0.0, 0.01, math.pi))
    assert len(costmap.clear_unseen(3.0, 5.0).places) == 0
    assert np.allclose(costmap.clear_unseen(3.0, 2.0).places, [[1.025, 0.025]])
    assert costmap.field(3.0).cost(-0.71, 0.01) == 254
    with pytest.raises(PlannerError, match="finite"):
        costmap.clear_unseen(math.nan, 2.0)


def test_recovery_leaves_the_map_and_says_how_much_of_it_is_in_the_way() -> None:
    cells = np.zeros((80, 80), dtype=np.int8)
    cells[40, 42:46] = 100
    costmap = Costmap(settings_of(), StaticMap(cells, 0.05, (-2.0, -2.0)))
    assert lethal_of(costmap).sum() == 4
    recovery = costmap.clear_inside([SQUARE])
    assert recovery.left == 4 and len(recovery.places) == 0
    assert lethal_of(costmap).sum() == 4


def test_the_same_grid_sees_the_map_as_it_is(rng: np.random.Generator) -> None:
    cells = rng.choice([-1, 0, 100], (80, 80)).astype(np.int8)
    found = StaticMap(cells, 0.05, (-2.0, -2.0)).onto((80, 80), 0.05, (-2.0, -2.0))
    assert np.array_equal(found, np.where(cells == 100, 1, cells))


@pytest.mark.parametrize("resolution", [0.013, 0.05, 0.11, 0.5])
@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_no_wall_gets_lost_whatever_the_maps_resolution_and_turn(
    resolution: float, yaw: float, rng: np.random.Generator
) -> None:
    rows, columns = (30, 40) if resolution < 0.2 else (12, 10)
    cells = np.zeros((rows, columns), dtype=np.int8)
    places = rng.integers(0, (rows, columns), (25, 2))
    cells[places[:, 0], places[:, 1]] = 100
    pose, origin = np.array([0.3, -0.4, 0.2]), np.array([-0.5 * resolution * columns, 0.1, yaw])
    static = StaticMap(cells, resolution, tuple(origin))
    found = static.onto((400, 400), 0.05, (-10.0, -10.0), pose)
    world = compose(pose, origin)
    for row, column in places:
        corners = (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) + np.array([column, row])) * resolution
        outline = Polygon(corners @ rotation(world[2]).T + world[:2])
        i, j = (np.round((np.array(outline.centroid.coords[0])[::-1] + 10.0) / 0.05)).astype(int)
        reach = math.ceil(resolution / 0.05) + 1
        near = [
            (a, b)
            for a in range(max(i - reach, 0), i + reach)
            for b in range(max(j - reach, 0), j + reach)
            if found[a, b] == 1
        ]
        touching = [
            outline.intersects(box(b * 0.05 - 10, a * 0.05 - 10, b * 0.05 - 9.95, a * 0.05 - 9.95)) for a, b in near
        ]
        assert any(touching)
    for i, j in np.argwhere(found == 1)[:200]:
        x, y = inverse(world)[:2] + rotation(-world[2]) @ (np.array([j + 0.5, i + 0.5]) * 0.05 - 10.0)
        square = Point(x, y).buffer(0.05 * math.sqrt(0.5) + 1e-9)
        assert any(
            square.intersects(box(c * resolution, r * resolution, (c + 1) * resolution, (r + 1) * resolution))
            for r, c in places
        ), "an occupied cell has the map to thank for it"


def test_a_costmap_over_a_map_covers_it_and_unknown_is_what_is_asked_for() -> None:
    cells = np.full((20, 30), -1, dtype=np.int8)
    cells[5:15, 5:25] = 0
    static = StaticMap(cells, 0.1, (3.0, -7.0))
    for unknown, cost in (("unknown", 255), ("free", 0), ("lethal", 254)):
        costmap = Costmap.over(static, settings_of(resolution=0.1, unknown=unknown))
        assert costmap.origin == (3.0, -7.0)
        field = costmap.field(0.0)
        assert field.cells.shape == (20, 30)
        assert field.cost(3.05, -6.95) == cost
        assert field.cost(4.5, -6.0) in (0, 253) or unknown == "lethal"


def test_a_costmap_is_as_old_as_its_last_scan() -> None:
    costmap = Costmap(settings_of())
    assert costmap.time == -math.inf
    costmap.observe(scan_of([1.0], time=5.0), (0.0, 0.0, 0.0))
    assert costmap.field(7.0).time == 5.0


def test_scans_that_come_late_do_not_set_the_clock_back() -> None:
    costmap = Costmap(settings_of())
    for time in (2.0, 1.9):
        costmap.observe(scan_of([1.0], time=time), (0.0, 0.0, 0.0))
    assert costmap.time == 2.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ranges": np.zeros((2, 2))}, "ranges"),
        ({"time": np.nan}, "finite time"),
        ({"increment": np.inf}, "finite increment"),
        ({"increment": 1.0, "ranges": np.ones(100)}, "one turn"),
        ({"span": (2.0, 1.0)}, "span"),
        ({"span": (np.nan, 1.0)}, "span"),
    ],
)
def test_a_bad_scan_is_refused_in_words(changes: dict, words: str) -> None:
    good = {"time": 0.0, "angle_min": 0.0, "increment": 0.01, "span": SPAN, "ranges": np.ones(5)}
    with pytest.raises(PlannerError, match=words):
        RangeScan(**{**good, **changes})


@pytest.mark.parametrize(
    ("cells", "resolution", "origin", "words"),
    [
        (np.zeros(4, dtype=int), 0.05, (0, 0), "rows, columns"),
        (np.zeros((2, 2)), 0.05, (0, 0), "whole numbers"),
        (np.full((2, 2), 101), 0.05, (0, 0), "-1 to 100"),
        (np.zeros((2, 2), dtype=int), 0.0, (0, 0), "resolution"),
        (np.zeros((2, 2), dtype=int), np.nan, (0, 0), "resolution"),
        (np.zeros((2, 2), dtype=int), 0.05, (0, np.inf), "origin"),
        (np.zeros((2, 2), dtype=int), 0.05, (0, 0, 0, 0), "origin"),
    ],
)
def test_a_bad_map_is_refused_in_words(cells: np.ndarray, resolution: float, origin: tuple, words: str) -> None:
    with pytest.raises(PlannerError, match=words):
        StaticMap(cells, resolution, origin)


def test_bad_places_and_outlines_are_refused_in_words() -> None:
    costmap = Costmap(settings_of())
    scan = scan_of([1.0])
    for pose in ((0.0, np.nan, 0.0), (0.0, 0.0), (1e9, 0.0, 0.0)):
        with pytest.raises(PlannerError, match="pose of the laser"):
            costmap.observe(scan, pose)
    for outline in (np.zeros((2, 2)), np.full((4, 2), np.nan), np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])):
        with pytest.raises(PlannerError, match="robot or cart"):
            costmap.observe(scan, (0.0, 0.0, 0.0), [outline])
    with pytest.raises(PlannerError, match="centre"):
        costmap.recentre(np.inf, 0.0)
    with pytest.raises(PlannerError, match="pose of the map"):
        costmap.place_map((0.0, 0.0))


def test_bad_settings_are_refused_in_words() -> None:
    for changes, words in (
        ({"width": 0.05}, "3 cells"),
        ({"width": 900.0, "height": 900.0}, "at most"),
        ({"mark_range": 9.0}, "mark_range"),
        ({"resolution": math.nan}, "finite"),
        ({"evidence": {"fleeting": 50.0}}, "fleeting"),
        ({"evidence": {"hit": 9}}, "hit and confirmed"),
    ):
        with pytest.raises(ValueError, match=words):
            settings_of(**changes)
