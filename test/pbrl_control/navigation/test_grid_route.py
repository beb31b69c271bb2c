"""Paths on a grid of places and headings: free by another's reckoning, complete where it is narrow, always the same."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from floor_cases import box, wrapped
from shapely import MultiPoint, Polygon, unary_union

from pbrl_control.navigation import KRANG_STOWED, BasePath, FloorMap, Footprint, MotionChecker, grid_route, plan_route
from pbrl_control.navigation.grid_route import grid_path

ROOM = box(-2.0, -1.6, 2.4, 1.6)
NOSE = float(KRANG_STOWED.outline[:, 0].max())
CELL = grid_route.CELLS[0]


def checker(room: np.ndarray = ROOM, margin: float = 0.03, **obstacles: np.ndarray) -> MotionChecker:
    return MotionChecker(FloorMap.of(room, obstacles), KRANG_STOWED, margin)


def gap(width: float) -> MotionChecker:
    """A wall of 0.4 m across the room with one gap about y = 0."""
    return checker(low=box(-0.2, -1.6, 0.2, -width / 2), high=box(-0.2, width / 2, 0.2, 1.6))


def assert_free(path: BasePath | None, room: np.ndarray = ROOM, **obstacles: np.ndarray) -> BasePath:
    """Place the outline all along a path, by shapely alone, and hold the path to what such a base can do."""
    assert path is not None
    free = Polygon(room).difference(unary_union([Polygon(each) for each in obstacles.values()]))
    poses = path.poses(0.01, 0.01)
    placed = [KRANG_STOWED.at(pose) for pose in poses]
    hulls = [MultiPoint(np.vstack(pair)).convex_hull for pair in pairwise(placed)]
    assert all(free.covers(each) for each in hulls)
    np.testing.assert_allclose(poses[0], path.start)
    np.testing.assert_allclose(poses[-1][:2], path.goal[:2], atol=1e-12)
    assert abs(wrapped(poses[-1][2] - path.goal[2])) < 1e-9
    for a, b in pairwise(path.legs):
        np.testing.assert_array_equal(a.end, b.start)
    return path


def pose(x: float, y: float, degrees: float = 0.0) -> np.ndarray:
    return np.array([x, y, math.radians(degrees)])


@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_random_questions_in_a_full_room_are_answered_by_free_paths(margin: float, rng: np.random.Generator) -> None:
    things = {"a": box(-0.4, -1.6, 0.3, -0.1), "b": box(1.2, 0.9, 1.9, 1.6)}
    asked = checker(margin=margin, **things)
    answered = 0
    for _ in range(30):
        start, goal = rng.uniform([-1.4, -1.0, -3.1], [1.8, 1.0, 3.1], (2, 3))
        if asked.pose_fault(start) or asked.pose_fault(goal):
            continue
        path = grid_path(asked, start, goal)
        if path is not None:
            assert_free(path, **things)
            answered += 1
        if answered == 2:
            return
    pytest.fail(f"expected 2 of 30 questions to have a way, got {answered}")


def test_the_same_question_has_the_same_bytes_and_no_memory_of_others() -> None:
    start, goal = pose(-1.2, 0.3, 100.0), pose(1.5, -0.4, -60.0)
    first = grid_path(gap(1.16), start, goal)
    asked = gap(1.16)
    grid_path(asked, goal, start)
    grid_path(checker(), start, goal)  # another room in between
    again, once_more = grid_path(asked, start, goal), grid_path(asked, start, goal)
    assert first is not None
    assert again is not None
    assert once_more is not None
    assert first.poses().tobytes() == again.poses().tobytes() == once_more.poses().tobytes()


def test_one_checker_pays_for_its_grid_once() -> None:
    asked = gap(1.16)
    assert grid_route._grid(asked, CELL) is grid_route._grid(asked, CELL)
    assert grid_route._grid(gap(1.16), CELL) is not grid_route._grid(asked, CELL)


@pytest.mark.parametrize("turned", [0.0, 90.0, 37.0])
def test_a_gap_of_one_metre_ten_is_passed(turned: float) -> None:
    path = assert_free(
        grid_path(gap(1.10), pose(-1.2, 0.2, turned), pose(1.4, -0.2, turned)),
        low=box(-0.2, -1.6, 0.2, -0.55),
        high=box(-0.2, 0.55, 0.2, 1.6),
    )
    assert path.length < 3.5


@pytest.mark.parametrize("width", [0.3, 0.95, 0.995])
def test_a_gap_narrower_than_the_robot_is_not(width: float) -> None:
    asked, start, goal = gap(width), pose(-1.2, 0.0), pose(1.4, 0.0)
    assert grid_path(asked, start, goal) is None
    route = plan_route(asked, start, goal, seed=1, time_limit=0.3, narrow=True)
    assert route.path is None
    assert route.reason


@pytest.mark.parametrize("off", [0.002, 0.02, 0.05])
@pytest.mark.parametrize("side", [-0.31, 0.0, 0.173])
def test_a_start_with_its_nose_at_an_edge_is_left_straight_back(off: float, side: float) -> None:
    table = box(0.6, -0.75, 1.35, 0.75)
    path = assert_free(
        grid_path(checker(table=table), pose(0.6 - NOSE - off, side), pose(-1.2, 0.8, 120.0)), table=table
    )
    assert path.legs[0].reverse
    assert path.legs[0].length > 0.05
    assert abs(path.legs[0].heading) < 12.0 * off  # [rad]: as much as it can turn there


def test_such_a_pose_is_reached_straight_ahead() -> None:
    table = box(0.6, -0.75, 1.35, 0.75)
    path = assert_free(
        grid_path(checker(table=table), pose(-1.2, 0.8, 120.0), pose(0.6 - NOSE - 0.03, 0.11)), table=table
    )
    assert not path.legs[-1].reverse


def test_a_goal_in_a_dead_end_is_reached_whichever_way_it_is_to_face() -> None:
    walls = {"low": box(0.6, -1.6, 2.4, -0.56), "high": box(0.6, 0.56, 2.4, 1.6)}  # no room to turn inside
    into = assert_free(grid_path(checker(**walls), pose(-0.9, -0.3, 90.0), pose(1.6, 0.0, 0.0)), **walls)
    assert not into.legs[-1].reverse
    back = assert_free(grid_path(checker(**walls), pose(-0.9, -0.3, 90.0), pose(1.6, 0.0, 180.0)), **walls)
    assert back.legs[-1].reverse


def test_backwards_is_driven_only_where_that_is_cheaper() -> None:
    free = checker()
    ahead = assert_free(grid_path(free, pose(-1.2, 0.0), pose(1.5, 0.0)))
    assert not any(leg.reverse for leg in ahead.legs)
    far = assert_free(grid_path(free, pose(1.5, 0.0), pose(-1.2, 0.0, 180.0)))
    assert not any(leg.reverse for leg in far.legs), "a half turn costs less than 2.7 m backwards"
    near = assert_free(grid_path(free, pose(0.3, 0.0), pose(0.0, 0.0)))
    assert [leg.reverse for leg in near.legs] == [True], "two half turns cost more than 0.3 m backwards"


def test_start_and_goal_in_one_place_need_no_leg() -> None:
    here = pose(-0.5, 0.2, 30.0)
    for goal in (here, pose(-0.5, 0.2, -80.0)):
        route = plan_route(checker(), here, goal, seed=1, narrow=True)
        assert route.path is not None
        assert route.path.legs == ()


def turned_by(corners: np.ndarray, quarters: int) -> np.ndarray:
    matrix = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarters)
    return corners @ matrix.T


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_room_turned_by_quarters_has_the_same_way(quarters: int) -> None:
    things = {"low": box(-0.2, -1.6, 0.2, -0.35), "high": box(-0.2, 0.8, 0.2, 1.6)}
    start, goal = pose(-1.2, -0.5, 20.0), pose(1.5, -0.6, -70.0)
    plain = grid_path(checker(**things), start, goal)
    again = [np.array([*turned_by(each[:2], quarters), each[2] + quarters * math.pi / 2]) for each in (start, goal)]
    turned_things = {name: turned_by(corners, quarters) for name, corners in things.items()}
    other = grid_path(checker(turned_by(ROOM, quarters), **turned_things), *again)
    assert plain is not None
    assert other is not None
    assert other.length == pytest.approx(plain.length, abs=2 * CELL)


def test_where_the_grid_has_no_way_samples_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def none(*question: object) -> None:
        asked.append(question)

    monkeypatch.setattr("pbrl_control.navigation.route.grid_path", none)
    thing = box(-0.4, -1.6, 0.4, -0.2)
    route = plan_route(checker(thing=thing), pose(-1.2, -0.8), pose(1.4, -0.8), seed=1, narrow=True)
    assert len(asked) == 1
    assert_free(route.path, thing=thing)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_poses_that_are_none_are_refused_in_words(bad: float) -> None:
    good = pose(-1.2, 0.0)
    for start, goal, word in ((np.array([0.0, 0.0, bad]), good, "start"), (good, np.array([1.0, bad, 0.0]), "goal")):
        route = plan_route(checker(), start, goal, seed=1, narrow=True)
        assert route.path is None
        assert route.reason.startswith(f"{word}: expected a finite pose")


def test_a_pose_beyond_the_map_or_in_an_obstacle_is_refused() -> None:
    asked = checker(thing=box(0.5, -0.5, 1.5, 0.5))
    for goal in (pose(9.0, 0.0), pose(1.0, 0.0)):
        assert plan_route(asked, pose(-1.2, 0.0), goal, seed=1, narrow=True).path is None
        assert grid_path(asked, pose(-1.2, 0.0), goal) is None


def test_a_round_robot_finds_its_way_too() -> None:
    floor = FloorMap.of(ROOM, {"thing": box(-0.2, -1.6, 0.2, 0.3)})
    path = grid_path(MotionChecker(floor, Footprint.circle(0.4)), pose(-1.2, -0.8), pose(1.4, -0.8))
    assert path is not None
    assert path.length > 2.6
