"""One item at a time: round what stands there, into the nearest of places that are alike, blockers aside."""

from __future__ import annotations

import numpy as np
import pytest
from desk_cases import laid, layout_of, model_of, three

from pbrl_planner.tabletop import Desk, Near, Objective, TabletopPlanner, TabletopSettings, pushes_of
from pbrl_planner.tabletop.carry_kernel import carry
from pbrl_planner.tabletop.carrying import exchanged, in_the_way, steps_aside
from pbrl_planner.tabletop.planner import push_tables
from pbrl_planner.tabletop.tree_kernel import apart, follow, follow_what_is_free

SETTINGS = TabletopSettings()
WEIGHT = SETTINGS.orientation


def carried(desk: Desk, layout: np.ndarray, item: int, goal: np.ndarray, most: int = 20_000) -> tuple[np.ndarray, int]:
    """Return the layout after the pushes that `carry` found, and how many."""
    tables = push_tables(desk, model_of(desk), pushes_of(SETTINGS.travels), SETTINGS)
    via, end = np.empty(most, dtype=np.int64), np.empty_like(layout)
    length = carry(layout, item, goal, WEIGHT, 0.02, most, tables, via)
    codes = item * len(pushes_of(SETTINGS.travels)) + via[:length]
    assert follow(layout, codes, np.ones(length, dtype=np.uint8), tables, end), "every push on the way is free"
    return end, length


def test_an_item_goes_round_an_obstacle_and_the_others_stay() -> None:
    desk = three(obstacle=True)
    layout = np.array([[0.2, 0.0, 0.3], [-0.25, 0.18, 0.0], [-0.27, -0.13, 0.0]])
    goal = np.array([-0.2, 0.02, 0.0])
    end, length = carried(desk, layout, 0, goal)
    assert apart(end[0], goal, WEIGHT) <= 0.02**2
    assert length >= 8
    np.testing.assert_array_equal(end[1:], layout[1:])


def test_what_cannot_be_reached_is_come_as_near_to_as_can_be() -> None:
    desk = three()
    layout = np.array([[0.2, 0.0, 0.3], [-0.25, 0.18, 0.0], [-0.2, 0.0, 0.0]])
    end, length = carried(desk, layout, 0, layout[2], most=3000)
    assert length > 0
    assert 0.02**2 < apart(end[0], layout[2], WEIGHT) < apart(layout[0], layout[2], WEIGHT)
    assert carried(desk, layout, 0, layout[0])[1] == 0


def test_places_of_items_that_are_alike_are_exchanged_only_where_it_costs_nothing(rng: np.random.Generator) -> None:
    desk, objective = laid(4, 2)
    goal = layout_of(desk, rng)
    shuffled = goal[[2, 0, 3, 1, 5, 4]]
    np.testing.assert_allclose(exchanged(objective, shuffled, goal), shuffled)
    picky = Objective.of(desk, [Near(term="near", items=("plate_0",), point=tuple(goal[0, :2]))])
    np.testing.assert_array_equal(exchanged(picky, shuffled, goal), goal)


def test_who_stands_in_the_way_steps_aside() -> None:
    desk = three()
    layout = np.array([[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.0, 0.15, 0.0]])
    place = np.array([-0.2, 0.01, 0.5])
    assert in_the_way(desk, layout, 0, place, 0.004) == [1]
    assert in_the_way(desk, layout, 0, layout[0], 0.004) == []
    places = np.array([[-0.2, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0, 0.15, 0.0], [0.2, -0.15, 0.0]])
    free = steps_aside(desk, layout, 1, places, (0, place), 0.004)
    np.testing.assert_array_equal(free, places[3])
    assert steps_aside(desk, layout, 1, places[:3], (0, place), 0.004) is None


@pytest.mark.parametrize("carries", [True, False])
def test_items_that_block_each_other_are_untangled(carries: bool) -> None:
    # The eraser is to be where the remote lies, and the remote where the eraser does: nothing gets better at once.
    desk = Desk(three().table, three().items[:2])
    start = np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0]])
    objective = Objective.from_function(
        desk,
        lambda poses: float(
            np.hypot(*(poses["eraser"][:2] - [0.2, 0.0])) + np.hypot(*(poses["remote"][:2] - [-0.2, 0.0]))
        ),
    )
    settings = SETTINGS.model_copy(update={"carry": carries, "nodes": 4000, "every": 40})
    search = TabletopPlanner(objective, model_of(desk), start, seed=3, settings=settings)
    search.improve(30.0, 0.08)
    if carries:
        assert search.best_cost <= 0.08
    again = TabletopPlanner(objective, model_of(desk), start, seed=3, settings=settings)
    again.improve(30.0, 0.08)
    assert again.best_cost == search.best_cost
    plan = search.plan()
    assert plan.cost == pytest.approx(objective(plan.layouts[-1]))


def test_of_pushes_that_are_not_all_free_those_that_are_go_on(rng: np.random.Generator) -> None:
    desk = three()
    model = model_of(desk)
    kinds = pushes_of(SETTINGS.travels)
    tables = push_tables(desk, model, kinds, SETTINGS)
    left_out = 0
    for _ in range(40):
        start = layout_of(desk, rng)
        codes = rng.integers(0, len(desk.names) * len(kinds), 30)
        free, end, again = np.empty(30, dtype=np.uint8), np.empty_like(start), np.empty_like(start)
        follow_what_is_free(start, codes, free, tables, end)
        assert follow(start, codes, free, tables, again), "what was made is free without the rest"
        assert np.array_equal(end, again)
        blocked = np.flatnonzero(free == 0)
        left_out += len(blocked)
        for each in blocked[:3]:
            upto = free.copy()
            upto[each] = 1
            assert not follow(start, codes[: each + 1], upto[: each + 1], tables, again), (
                "what was left out is not free"
            )
    assert left_out > 0
