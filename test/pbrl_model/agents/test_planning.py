"""A* against brute force; what has no plan says so; moving the whole scene changes nothing."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from pbrl_model.agents.domain import Goal, Thing
from pbrl_model.agents.obstacles import edges, obstacles_of, placed
from pbrl_model.agents.planning import Motions, Planner, SearchOptions, Space
from pbrl_model.agents.plans import PlanStatus
from pbrl_model.errors import ModelError

BOX = np.array([[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]])
FLOOR = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]])
ENDS = np.array([[0.37, 0.0, 0.0], [0.2, 0.15, 0.9], [0.2, -0.15, -0.9], [-0.3, 0.0, 0.0]])


def motions(ends: np.ndarray = ENDS, cost: np.ndarray | None = None) -> Motions:
    way = np.array([[share * end for share in (0.5, 1.0)] for end in ends])
    return Motions(way[None], np.ones(len(ends)) if cost is None else cost)


def planner(walls: list[np.ndarray], floor: np.ndarray = FLOOR, **options: object) -> Planner:
    settings = SearchOptions(**{"cell": 0.02, "turns": 180, **options})  # type: ignore[arg-type]
    space = Space(floor.min(axis=0), floor.max(axis=0), obstacles_of([*edges(floor), *walls]), 0.01)
    return Planner(Thing("box", BOX, np.zeros(3)), space, settings)


def compose(pose: np.ndarray, change: np.ndarray) -> np.ndarray:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose + np.array([c * change[0] - s * change[1], s * change[0] + c * change[1], change[2]])


def cheapest(plan: Planner, start: np.ndarray, goal: Goal, table: Motions, depth: int) -> float:
    """Try every sequence of actions up to a depth."""
    best = np.inf
    for sequence in (actions for n in range(1, depth + 1) for actions in product(range(len(table.cost)), repeat=n)):
        pose, total = start, 0.0
        for action in sequence:
            if not all(plan.free(compose(pose, way)) for way in table.table[0, action]):
                break
            pose, total = compose(pose, table.table[0, action, -1]), total + table.cost[action]
        else:
            if goal.reached(pose):
                best = min(best, total)
    return best


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("around", [True, False])
def test_a_plan_costs_what_brute_force_finds(seed: int, around: bool) -> None:
    rng = np.random.default_rng(seed)
    walls = [
        placed(
            np.array([[-0.05, -0.3], [0.05, -0.3], [0.05, 0.3], [-0.05, 0.3]]), rng.uniform([1, 0.5, 0], [2, 1.5, 3])
        )
    ]
    found = planner(walls, around=around)
    table = motions(cost=rng.uniform(0.7, 1.3, len(ENDS)))
    start = np.array([0.4, 1.0, rng.uniform(-0.4, 0.4)])
    goal_pose = start
    for action in rng.integers(len(ENDS), size=4):
        goal_pose = compose(goal_pose, ENDS[action])
    goal = Goal(goal_pose, 0.06, 0.15)
    plan = found.plan(start, goal, table)
    expected = cheapest(found, start, goal, table, 5)
    if np.isinf(expected):
        assert not plan.reaches or plan.cost > 5 * table.cost.min()
    elif not goal.reached(start):
        assert plan.status is PlanStatus.FOUND
        assert plan.cost == pytest.approx(expected)


def test_a_plan_does_what_it_says() -> None:
    wall = np.array([[1.4, 0.0], [1.5, 0.0], [1.5, 1.3], [1.4, 1.3]])
    found, table = planner([wall]), motions()
    goal = Goal(np.array([2.4, 0.5, np.nan]), 0.1)
    plan = found.plan(np.array([0.5, 0.5, 0.0]), goal, table)
    assert plan.reaches and goal.reached(plan.poses[-1])
    pose = plan.poses[0]
    for action, expected in zip(plan.actions, plan.poses[1:], strict=True):
        assert all(found.free(compose(pose, way)) for way in table.table[0, action])
        pose = compose(pose, table.table[0, action, -1])
        np.testing.assert_allclose(pose, expected)
    assert plan.cost == len(plan.actions)


@pytest.mark.parametrize(("turn", "shift"), [(0.0, (7.0, -3.0)), (np.pi / 2, (0.0, 0.0)), (np.pi, (1.3, 2.6))])
def test_moving_the_whole_scene_leaves_the_cost(turn: float, shift: tuple[float, float]) -> None:
    move = np.array([*shift, turn])
    wall = np.array([[1.4, 0.0], [1.5, 0.0], [1.5, 1.3], [1.4, 1.3]])
    start, goal = np.array([0.5, 0.5, 0.3]), np.array([2.4, 0.5, 0.0])
    costs = []
    for change in (np.zeros(3), move):
        found = planner([placed(wall, change)], placed(FLOOR, change))
        plan = found.plan(compose(change, start), Goal(compose(change, goal), 0.12, 0.5), motions())
        assert plan.reaches
        costs.append(plan.cost)
    assert costs[0] == costs[1]


def test_weight_costs_at_most_its_factor() -> None:
    wall = np.array([[1.4, 0.0], [1.5, 0.0], [1.5, 1.3], [1.4, 1.3]])
    goal, start = Goal(np.array([2.4, 0.5, np.nan]), 0.1), np.array([0.5, 0.5, 0.0])
    best = planner([wall]).plan(start, goal, motions())
    fast = planner([wall], weight=2.0).plan(start, goal, motions())
    assert best.cost <= fast.cost <= 2.0 * best.cost
    assert fast.expanded <= best.expanded


def test_a_goal_that_cannot_be_reached_ends_with_a_sentence() -> None:
    closet = np.array([[2.0, 0.0], [2.05, 0.0], [2.05, 2.0], [2.0, 2.0]])
    goal = Goal(np.array([2.6, 1.0, np.nan]), 0.1)
    start = np.array([0.5, 1.0, 0.0])
    for around in (True, False):
        plan = planner([closet], around=around, cell=0.1, turns=16).plan(start, goal, motions())
        assert plan.status is PlanStatus.EXHAUSTED and "no plan" in plan.status.value
        assert not plan.reaches
    short = planner([closet], budget=20, around=False).plan(start, goal, motions())
    assert short.status is PlanStatus.OUT_OF_BUDGET and short.expanded == 20


def test_there_already_and_off_the_floor() -> None:
    goal = Goal(np.array([1.0, 1.0, np.nan]), 0.1)
    there = planner([]).plan(np.array([1.05, 1.0, 2.0]), goal, motions())
    assert there.status is PlanStatus.THERE and not len(there.actions) and there.reaches
    assert planner([]).plan(np.array([9.0, 9.0, 0.0]), goal, motions()).status is PlanStatus.OUTSIDE


def test_a_body_that_touches_a_wall_can_still_leave_it() -> None:
    plan = planner([]).plan(np.array([0.151, 1.0, 0.0]), Goal(np.array([1.0, 1.0, np.nan]), 0.2), motions())
    assert plan.reaches


def test_a_planner_without_walls_in_its_mind_goes_through_them() -> None:
    wall = np.array([[1.4, 0.0], [1.5, 0.0], [1.5, 2.0], [1.4, 2.0]])
    space = Space(FLOOR.min(axis=0), FLOOR.max(axis=0), obstacles_of([wall]), 0.01, knows_walls=False)
    blind = Planner(Thing("box", BOX, np.zeros(3)), space)
    assert blind.plan(np.array([0.5, 1.0, 0.0]), Goal(np.array([2.5, 1.0, np.nan]), 0.2), motions()).reaches


@pytest.mark.parametrize(
    ("table", "cost"),
    [
        (np.zeros((1, 2, 3)), np.ones(2)),
        (np.zeros((1, 2, 1, 3)), np.ones(3)),
        (np.zeros((1, 2, 1, 3)), np.array([1.0, 0.0])),
        (np.full((1, 2, 1, 3), np.nan), np.ones(2)),
    ],
)
def test_motions_that_are_none_are_refused(table: np.ndarray, cost: np.ndarray) -> None:
    with pytest.raises(ModelError, match="motions: expected"):
        Motions(table, cost)


def test_conditions_need_rays() -> None:
    table = Motions(np.zeros((16, 1, 1, 3)), np.ones(1))
    with pytest.raises(ModelError, match="contact conditions"):
        planner([]).plan(np.array([0.5, 1.0, 0.0]), Goal(np.array([2.5, 1.0, 0.0])), table)
