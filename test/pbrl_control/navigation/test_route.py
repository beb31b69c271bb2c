"""Paths of the base: free, short, exact at both ends, the same for the same seed, refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from floor_cases import ROOM, box, wrapped
from shapely import Polygon

from pbrl_control.errors import ControlError
from pbrl_control.navigation import KRANG_STOWED, FloorMap, Footprint, MotionChecker, RouteResult, plan_route

CLUTTER = {"a": box(-0.4, -3.0, 0.4, 0.9), "b": box(1.6, 1.9, 3.0, 2.6), "c": box(-2.7, 1.6, -2.1, 2.2)}


def route(start, goal, obstacles=CLUTTER, footprint: Footprint = KRANG_STOWED, seed: int = 1, **more) -> RouteResult:
    checker = MotionChecker(FloorMap.of(ROOM, obstacles), footprint)
    return plan_route(checker, np.array(start, dtype=float), np.array(goal, dtype=float), seed=seed, **more)


def assert_free_and_exact(result: RouteResult, footprint: Footprint, obstacles=CLUTTER) -> None:
    path = result.path
    assert path is not None, result.reason
    free = Polygon(ROOM).difference(FloorMap.of(ROOM, obstacles).room.difference(FloorMap.of(ROOM, obstacles).free))
    poses = path.poses(0.05, 0.05)
    assert all(free.covers(Polygon(footprint.at(pose))) for pose in poses)
    np.testing.assert_allclose(poses[0], path.start)
    np.testing.assert_allclose(poses[-1][:2], path.goal[:2], atol=1e-12)
    assert abs(wrapped(poses[-1][2] - path.goal[2])) < 1e-9
    steps = np.diff(poses, axis=0)
    headings = poses[1:, 2]
    sideways = np.abs(steps[:, 1] * np.cos(headings) - steps[:, 0] * np.sin(headings))
    assert sideways.max() < 1e-9, "a differential base never moves sideways"


@pytest.mark.parametrize("footprint", [KRANG_STOWED, Footprint.circle(0.5)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_way_round_a_wall_is_free_exact_and_nearly_the_shortest(footprint: Footprint, seed: int) -> None:
    result = route((-2, -1.5, 0.3), (2, -1.5, 1.2), footprint=footprint, seed=seed)
    assert_free_and_exact(result, footprint)
    reach = 0.5 + 0.03  # half the robot's width, or its radius, with the margin
    shortest = 2.0 * np.hypot(1.6 - reach, 2.4 + reach) + 2.0 * 0.4  # about the wall's end, corners taken as points
    assert result.path is not None
    assert result.path.length < 1.15 * shortest


def test_the_same_seed_gives_the_same_bytes() -> None:
    first, again = (route((-2, -1.5, 0.3), (2, -1.5, 1.2), seed=7).path for _ in range(2))
    assert first is not None
    assert again is not None
    assert first.poses().tobytes() == again.poses().tobytes()


def test_random_queries_are_answered_by_a_free_path_or_a_reason(rng: np.random.Generator) -> None:
    answered = 0
    for _ in range(20):
        start, goal = rng.uniform([-2.4, -2.4, -3], [2.4, 2.4, 3], (2, 3))
        result = route(start, goal)
        if result.path is None:
            assert result.reason
        else:
            answered += 1
            assert_free_and_exact(result, KRANG_STOWED)
    assert answered >= 5


def test_a_gap_narrower_than_the_turning_circle_is_passed_straight() -> None:
    gap = {"left": box(-0.3, -3.0, 0.3, -0.58), "right": box(-0.3, 0.58, 0.3, 3.0)}  # 1.16 m; the circle needs 1.4
    result = route((-2, 0.5, 0.0), (2, -0.5, 0.0), obstacles=gap)
    assert_free_and_exact(result, KRANG_STOWED, gap)
    wide = route((-2, 0.5, 0.0), (2, -0.5, 0.0), obstacles=gap, footprint=Footprint.circle(0.67))
    assert wide.path is None
    assert "no path" in wide.reason


def test_a_start_before_a_table_is_left_backwards_and_such_a_goal_reached_forwards() -> None:
    table = {"table": box(0.0, -0.75, 0.75, 0.75)}
    held, away = (-0.5, 0.0, 0.0), (-1.6, 1.8, 2.0)  # nose 5 cm before the edge: no room to turn
    leaving = route(held, away, obstacles=table)
    assert_free_and_exact(leaving, KRANG_STOWED, table)
    assert leaving.path is not None
    assert leaving.path.legs[0].reverse
    arriving = route(away, held, obstacles=table)
    assert_free_and_exact(arriving, KRANG_STOWED, table)
    assert arriving.path is not None
    assert not arriving.path.legs[-1].reverse
    assert leaving.path.length == pytest.approx(arriving.path.length, rel=0.1)


def test_a_start_along_a_wall_is_left_and_reached_slantwise() -> None:
    along, away = (-2.45, 0.0, np.pi / 2), (1.0, 0.0, 0.0)  # the spine would hit the wall before the turn is done
    for start, goal in ((along, away), (away, along)):
        result = route(start, goal, obstacles={})
        assert_free_and_exact(result, KRANG_STOWED, {})
        assert result.path is not None
        assert result.path.length < 5.5


def test_short_ways_back_are_driven_backwards_and_turns_alone_need_no_leg() -> None:
    back = route((0, 0, 0), (-0.5, 0, 0), obstacles={})
    assert back.path is not None
    assert back.path.legs[0].reverse
    assert back.path.turning == pytest.approx(0.0)
    turn = route((0, 0, 0), (0, 0, 2.5), obstacles={})
    assert turn.path is not None
    assert turn.path.legs == ()
    assert turn.path.turning == pytest.approx(2.5)
    stay = route((0, 0, 1), (0, 0, 1), obstacles={})
    assert stay.path is not None
    assert (stay.path.length, stay.path.turning) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("start", "goal", "reason"),
    [
        ((-2, -1.5, 0), (0, 0, 0), "goal: the robot would be in 'a'"),
        ((-2, -1.5, 0), (2.8, 0, 0), "goal: the robot would be in the walls"),
        ((-2, -1.5, 0), (20, 0, 0), "outside the map"),
        ((0, 0, 0), (2, -1.5, 0), "start: the robot would be in 'a'"),
        ((np.nan, 0, 0), (2, -1.5, 0), "start: expected a finite pose"),
        ((-2, -1.5, 0), (2, np.inf, 0), "goal: expected a finite pose"),
        ((-2, -1.5), (2, 1, 0), "start: expected a finite pose"),
    ],
)
def test_goals_that_cannot_be_are_refused_with_the_reason(start, goal, reason: str) -> None:
    result = route(start, goal)
    assert result.path is None
    assert reason in result.reason
    assert "\n" not in result.reason


def test_a_wall_without_a_gap_is_known_to_leave_no_path() -> None:
    result = route((-2, 0, 0), (2, 0, 0), obstacles={"wall": box(-0.1, -3.0, 0.1, 3.0)})
    assert (result.path, result.exhausted) == (None, False)
    assert "every gap between start and goal is narrower" in result.reason


NARROW = {"left": box(-0.3, -3.0, 0.3, -0.485), "right": box(-0.3, 0.485, 0.3, 3.0)}  # the shoulders are 1 m wide


def test_a_gap_that_only_looks_wide_enough_ends_the_search_without_a_path() -> None:
    result = route((-2, 0.5, 0), (2, 0, 0), obstacles=NARROW)
    assert (result.path, result.exhausted) == (None, True)
    assert "no path found with" in result.reason


def test_the_time_limit_ends_the_search() -> None:
    result = route((-2, 0.5, 0), (2, 0, 0), obstacles=NARROW, time_limit=1e-6)
    assert result.path is None
    assert "1e-06 s" in result.reason


@pytest.mark.parametrize("bad", [{"seed": 0}, {"seed": -3}, {"time_limit": 0.0}, {"time_limit": float("nan")}])
def test_a_bad_option_raises(bad: dict) -> None:
    with pytest.raises(ControlError, match="positive seed and time limit"):
        route((-2, 0, 0), (2, 0, 0), **bad)
