"""The task-space search: plans that hold under shapely and the model, the gain of the descent, hostile questions."""

from __future__ import annotations

import numpy as np
import pytest
from desk_cases import ERASER, PUNCH, laid, layout_of, model_of, three
from shapely import LineString, Polygon, box
from shapely.affinity import rotate, translate

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop import (
    Aligned,
    Desk,
    Item,
    LearnedDisplacements,
    Near,
    Objective,
    Table,
    TabletopPlan,
    TabletopPlanner,
    TabletopSettings,
    displaced,
    plan_tidying,
    pushes_of,
)

QUICK = TabletopSettings(time_limit=20.0, nodes=600, every=60)


def tidy(desk: Desk) -> Objective:
    return Objective.of(
        desk, [Near(term="near", items=desk.names), Aligned(term="aligned", items=desk.names, weight=0.2)]
    )


def outline(item: Item, pose: np.ndarray) -> Polygon:
    shape = box(*-item.half, *item.half)
    return translate(rotate(shape, pose[2], origin=(0, 0), use_radians=True), pose[0], pose[1])


def assert_holds(plan: TabletopPlan, objective: Objective, model: LearnedDisplacements) -> None:
    """Follow a plan by the model alone, and look at every layout and every way of the ball with shapely."""
    desk = objective.desk
    top = box(*desk.table.low, *desk.table.high)
    fixed = [outline(item, pose) for item, pose in desk.obstacles]
    for step, before, after in zip(plan.steps, plan.layouts, plan.layouts[1:], strict=False):
        item = desk.items[step.item]
        mean = model.of(item.name, step.push).mean
        expected = displaced(before[step.item], mean)
        np.testing.assert_allclose(after[step.item, :2], expected[:2], atol=1e-12)
        np.testing.assert_array_equal(np.delete(after, step.item, axis=0), np.delete(before, step.item, axis=0))
        others = [outline(each, pose) for each, pose in zip(desk.items, before, strict=True) if each != item] + fixed
        moved = outline(item, after[step.item])
        assert top.covers(moved)
        ball = LineString(step.push.path_in_world(item, before[step.item], desk.effector, 0.01)).buffer(desk.effector)
        for other in others:
            assert not other.intersects(moved)
            assert not other.intersects(ball)
    assert plan.cost == pytest.approx(objective(plan.layouts[-1]))
    assert plan.cost <= plan.first_cost


@pytest.mark.parametrize("obstacle", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_plans_are_free_by_another_reckoning(obstacle: bool, seed: int) -> None:
    desk = three(obstacle)
    objective, model = tidy(desk), model_of(desk)
    start = layout_of(desk, np.random.default_rng(seed))
    plan = plan_tidying(objective, model, start, seed=seed, settings=QUICK)
    assert len(plan.steps) > 3
    assert_holds(plan, objective, model)
    assert plan.cost < 0.6 * plan.first_cost


def test_the_same_seed_gives_the_same_plan(rng: np.random.Generator) -> None:
    desk = three()
    objective, model, start = tidy(desk), model_of(desk), layout_of(desk, rng)
    plans = [plan_tidying(objective, model, start, seed=seed, settings=QUICK) for seed in (3, 3, 4)]
    assert plans[0].layouts.tobytes() == plans[1].layouts.tobytes()
    assert plans[0].layouts.tobytes() != plans[2].layouts.tobytes()


def test_a_table_is_laid_and_the_descent_gains(rng: np.random.Generator) -> None:
    desk, objective = laid(4, 2)
    model, start = model_of(desk), layout_of(desk, rng)
    plain = QUICK.model_copy(update={"descent": False, "climb": False})
    with_descent = plan_tidying(objective, model, start, seed=1, settings=QUICK.model_copy(update={"climb": False}))
    without = plan_tidying(objective, model, start, seed=1, settings=plain)
    assert with_descent.cost < without.cost - 0.2, "the same number of layouts, with DIRECTGD and without"
    assert with_descent.aimed_cost <= with_descent.cost + 0.05
    assert_holds(with_descent, objective, model)


def test_the_best_layout_is_always_available(rng: np.random.Generator) -> None:
    desk = three()
    search = TabletopPlanner(tidy(desk), model_of(desk), layout_of(desk, rng), seed=1, settings=QUICK)
    empty = search.plan()
    assert empty.steps == ()
    assert empty.cost == empty.first_cost
    costs = []
    for _ in range(4):
        search.improve(1e-9)
        costs.append(search.plan().cost)
    assert costs == sorted(costs, reverse=True)
    assert search.improve(5.0, enough=costs[-1] + 0.01)


def test_a_room_that_is_moved_has_the_same_plan() -> None:
    shift = np.array([3.0, -2.0])
    plans = []
    for move in (np.zeros(2), shift):
        table = Table(np.array([-0.4, -0.25]) + move, np.array([0.4, 0.25]) + move)
        desk = Desk(table, (ERASER,), ((PUNCH, np.array([*move, np.pi / 2])),))
        start = np.array([[0.25 + move[0], 0.05 + move[1], 0.4]])
        objective = Objective.of(desk, [Near(term="near", items=("eraser",), point=(move[0] - 0.25, move[1]))])
        plans.append(plan_tidying(objective, model_of(desk), start, seed=2, settings=QUICK))
    assert [step.push for step in plans[0].steps] == [step.push for step in plans[1].steps]
    np.testing.assert_allclose(plans[0].layouts[:, 0, :2] + shift, plans[1].layouts[:, 0, :2], atol=1e-9)
    assert plans[0].cost < 0.06, "it goes round the hole punch"


def test_what_the_arm_does_not_reach_is_not_pushed() -> None:
    desk = Desk(Table.of(0.8, 0.5), (ERASER,), reach=(0.0, -0.45, 0.15, 0.5))
    objective = Objective.of(desk, [Near(term="near", items=("eraser",), point=(0.0, 0.2))])
    plan = plan_tidying(objective, model_of(desk), np.array([[0.0, -0.1, 0.2]]), seed=1, settings=QUICK)
    for step, layout in zip(plan.steps, plan.layouts, strict=False):
        assert desk.in_reach(step.push.path_in_world(ERASER, layout[0], desk.effector, 0.01))
    assert plan.layouts[-1][0, 1] < 0.05 + desk.effector + ERASER.half[0], "pushed as far as the ball goes"


def test_hostile_questions_are_refused_or_answered_by_nothing(rng: np.random.Generator) -> None:
    desk = three()
    objective, model = tidy(desk), model_of(desk)
    good = layout_of(desk, rng)
    overlapping = good.copy()
    overlapping[1] = good[0]
    with pytest.raises(PlannerError, match=r"start: eraser overlaps remote"):
        TabletopPlanner(objective, model, overlapping, seed=1)
    with pytest.raises(PlannerError, match="expected 3 finite poses"):
        TabletopPlanner(objective, model, good[:2], seed=1)
    with pytest.raises(PlannerError, match="expected 3 pushes"):
        TabletopPlanner(objective, LearnedDisplacements(), good, seed=1)
    with pytest.raises(PlannerError, match="got nan"):
        TabletopPlanner(Objective.from_function(desk, lambda poses: np.nan), model, good, seed=1)
    small = Desk(Table.of(0.135, 0.055), (ERASER,))
    nothing = plan_tidying(
        tidy(small), model_of(small), np.zeros((1, 3)), seed=1, settings=QUICK.model_copy(update={"time_limit": 0.3})
    )
    assert nothing.steps == ()


def test_items_that_seem_to_touch_are_taken_apart() -> None:
    desk = Desk(Table.of(0.8, 0.5), (ERASER, Item("other", 0.13, 0.05)))
    objective = Objective.of(desk, [Near(term="near", items=("other",), point=(0.3, 0.0))])
    start = np.array([[0.0, 0.0, 0.0], [0.0, 0.046, 0.0]])
    plan = plan_tidying(objective, model_of(desk), start, seed=1, settings=QUICK)
    assert plan.cost < 0.1
    assert pushes_of((0.05,))[0] in {step.push for step in plan.steps}
