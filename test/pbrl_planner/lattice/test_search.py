"""ARA* against Dijkstra on small lattices: the same cost, the promised bounds, no path exactly where there is none."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from lattice_cases import CELL, Reference, cart_motions, free_state, point_motions, random_grid
from pydantic import ValidationError

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import (
    CostGrid,
    Lattice,
    LatticePlan,
    LatticeProblem,
    LatticeSettings,
    Motions,
    lower_bound,
    plan,
)
from pbrl_planner.lattice.lower_bound import LowerBound
from pbrl_planner.lattice.search_kernel import LIMIT

DIRECTIONS: tuple[Literal["forward", "backward"], ...] = ("forward", "backward")


@pytest.fixture(scope="module")
def points() -> Motions:
    return point_motions()


@pytest.fixture(scope="module")
def carts() -> Motions:
    return cart_motions()


def ask(lattice: Lattice, rng: np.random.Generator) -> LatticeProblem:
    start, goal = (lattice.pose_of(free_state(lattice, rng)) for _ in range(2))
    return LatticeProblem(lattice, start, goal)


def across(lattice: Lattice) -> LatticeProblem:
    """Ask for a way from the first free cell to the last."""
    rows, columns = np.nonzero(lattice.grid.cells < 253)
    ends = [lattice.pose_of((int(columns[k]), int(rows[k]), 0, 0)) for k in (0, -1)]
    return LatticeProblem(lattice, *ends)


def check_against(reference: Reference, problem: LatticeProblem, settings: LatticeSettings) -> LatticePlan:
    lattice = problem.lattice
    start, goal = lattice.number_of(problem.start_state), lattice.number_of(problem.goal_state)
    best = reference.costs_from(start)[goal]
    found = plan(problem, settings)
    assert found.found == bool(np.isfinite(best))
    assert found.exhausted == (not found.found)
    assert bool(found.reason) == found.exhausted
    if not found.found:
        return found
    assert found.cost == best
    assert found.epsilon == 1.0
    for each in found.history:
        assert each.cost <= each.epsilon * best + 1e-6
    epsilons = [each.epsilon for each in found.history]
    assert epsilons == sorted(epsilons, reverse=True)
    costs = [each.cost for each in found.history]
    assert costs == sorted(costs, reverse=True)
    assert lattice.cost_along(problem.start_state, found.primitives) == found.cost
    edges = {(int(source), int(number)): int(target) for source, target, _, number in reference.edges}
    here = start
    for number in found.primitives:
        here = edges[here, int(number)]
    assert here == goal
    return found


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_point_s_plans_cost_what_dijkstra_s_do(points: Motions, direction: Literal["forward", "backward"]) -> None:
    rng = np.random.default_rng(3)
    none = 0
    for _ in range(6):
        lattice = Lattice(random_grid(rng, 11, 13, 0.42), points)
        reference = Reference.of(lattice)
        for _ in range(5):
            settings = LatticeSettings(direction=direction, epsilon_step=0.5)
            none += check_against(reference, ask(lattice, rng), settings).exhausted
    assert 3 <= none <= 27, "both kinds of answers are asked for"


@pytest.fixture(scope="module")
def cart_reference(carts: Motions) -> Reference:
    return Reference.of(Lattice(random_grid(np.random.default_rng(4), 20, 24, 0.015), carts))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_cart_s_plans_cost_what_dijkstra_s_do(
    cart_reference: Reference, direction: Literal["forward", "backward"]
) -> None:
    rng = np.random.default_rng(4)
    settings = LatticeSettings(direction=direction, epsilon=5.0)
    made = [check_against(cart_reference, ask(cart_reference.lattice, rng), settings) for _ in range(10)]
    assert sum(each.found for each in made) >= 3


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("kind", ["point", "cart"])
def test_the_lower_bound_is_consistent_and_admissible(
    points: Motions, carts: Motions, kind: str, direction: Literal["forward", "backward"]
) -> None:
    rng = np.random.default_rng(5)
    grid = random_grid(rng, 20, 24, 0.25 if kind == "point" else 0.01)
    lattice = Lattice(grid, points if kind == "point" else carts)
    reference = Reference.of(lattice)
    goal = lattice.number_of(ask(lattice, rng).goal_state)
    bound = LowerBound.of(lattice, goal, direction)
    assert bound.at(goal) == 0
    ends = reference.edges[:, [0, 1] if direction == "forward" else [1, 0]]
    here, there = (at_all(bound, ends[:, k]) for k in range(2))
    assert (here <= reference.edges[:, 2] + there)[there < LIMIT].all()
    true = reference.costs_from(goal, backward=direction == "forward")
    reached = np.flatnonzero(np.isfinite(true))
    found = at_all(bound, reached)
    assert (found <= true[reached]).all()
    assert found.sum() > 0.1 * true[reached].sum(), "and it is worth something"


def at_all(bound: LowerBound, states: np.ndarray) -> np.ndarray:
    """Return what `LowerBound.at` does for many states."""
    cells, bins = np.divmod(states, len(bound.turning))
    return bound.toward[cells].astype(np.int64) + bound.turning[bins]


def test_the_same_problem_gives_the_same_bytes(points: Motions) -> None:
    rng = np.random.default_rng(6)
    grid = random_grid(rng, 30, 30, 0.15)
    problem = ask(Lattice(grid, points), rng)
    first, again = (plan(LatticeProblem(Lattice(grid, points), problem.start, problem.goal)) for _ in range(2))
    assert first.poses.tobytes() == again.poses.tobytes()
    assert first.primitives.tobytes() == again.primitives.tobytes()
    assert [(e.epsilon, e.cost, e.expansions) for e in first.history] == [
        (e.epsilon, e.cost, e.expansions) for e in again.history
    ]


def test_effort_is_used_again(points: Motions) -> None:
    rng = np.random.default_rng(7)
    lattice = Lattice(random_grid(rng, 80, 80, 0.2), points)
    problem = across(lattice)
    settings = LatticeSettings(epsilon=3.0, epsilon_step=0.25)
    at_once = sum(
        plan(
            problem, LatticeSettings(epsilon=n / settings.denominator, last_epsilon=n / settings.denominator)
        ).expansions
        for n in settings.numerators
    )
    assert plan(problem, settings).expansions < at_once


def test_the_way_is_in_one_piece(carts: Motions) -> None:
    lattice = Lattice(CostGrid(np.zeros((40, 40), dtype=np.uint8), CELL), carts)
    problem = LatticeProblem(lattice, (1.0, 1.0, 0.0, 0.0), (3.0, 2.5, -3.0, 0.5))
    found = plan(problem)
    assert len(found.waypoints) == len(found.primitives) + 1
    assert np.allclose(found.poses[0], lattice.pose_of(problem.start_state))
    end = lattice.pose_of(problem.goal_state)
    assert np.allclose(found.poses[-1, [0, 1, 3]], end[[0, 1, 3]])
    assert np.cos(found.poses[-1, 2] - end[2]) == pytest.approx(1.0)
    assert np.abs(np.diff(found.poses[:, :2], axis=0)).max() < CELL
    assert np.abs(np.diff(found.poses[:, 2])).max() < 0.2
    assert np.abs(np.diff(found.poses[:, 3])).max() < 0.2


def test_start_at_the_goal_costs_nothing(points: Motions) -> None:
    lattice = Lattice(CostGrid(np.zeros((5, 5), dtype=np.uint8), CELL), points)
    found = plan(LatticeProblem(lattice, (0.2, 0.2, 0.0), (0.2, 0.2, 0.0)))
    assert (found.cost, found.epsilon, len(found.primitives), len(found.poses)) == (0, 1.0, 0, 1)


def test_each_solution_is_given_away_at_once_and_can_be_good_enough(points: Motions) -> None:
    rng = np.random.default_rng(8)
    lattice = Lattice(random_grid(rng, 60, 60, 0.2), points)
    problem = across(lattice)
    seen: list[LatticePlan] = []
    last = plan(problem, LatticeSettings(epsilon=5.0), lambda found: seen.append(found))
    assert len(seen) == len(last.history) > 1
    assert [each.cost for each in seen] == [each.cost for each in last.history]
    assert seen[0].found and seen[0].epsilon > 1.0
    first = plan(problem, LatticeSettings(epsilon=5.0), lambda _: True)
    assert first.primitives.tobytes() == seen[0].primitives.tobytes()
    assert len(first.history) == 1 and not first.exhausted


def test_out_of_patience_is_no_proof(points: Motions) -> None:
    lattice = Lattice(CostGrid(np.zeros((60, 60), dtype=np.uint8), CELL), points)
    problem = LatticeProblem(lattice, (0.5, 0.5, 0.0), (5.5, 5.5, 0.0))
    short = plan(problem, LatticeSettings(expansions=3))
    assert not short.found and not short.exhausted
    assert "3 expansions" in short.reason
    timed_out = plan(problem, LatticeSettings(time_limit=1e-9))
    assert not timed_out.found and not timed_out.exhausted and "there may be one" in timed_out.reason


def test_a_plan_that_is_cut_short_keeps_its_bound(points: Motions) -> None:
    rng = np.random.default_rng(9)
    lattice = Lattice(random_grid(rng, 60, 60, 0.2), points)
    problem = across(lattice)
    whole = plan(problem, LatticeSettings(epsilon=5.0))
    first = whole.history[0].expansions
    for more in range(1, whole.expansions - first, max(1, (whole.expansions - first) // 7)):
        cut = plan(problem, LatticeSettings(epsilon=5.0, expansions=first + more))
        assert cut.found
        assert whole.cost <= cut.cost <= cut.epsilon * whole.cost + 1e-6


def test_costs_that_cannot_be_added_up_are_refused(points: Motions, monkeypatch: pytest.MonkeyPatch) -> None:
    lattice = Lattice(CostGrid(np.full((9, 9), 250, dtype=np.uint8), CELL), points)
    problem = LatticeProblem(lattice, (0.1, 0.1, 0.0), (0.8, 0.8, 0.0))
    assert plan(problem).found
    monkeypatch.setattr(lower_bound, "LIMIT", 40_000)
    with pytest.raises(PlannerError, match="costs: expected sums below 40000"):
        LowerBound.of(lattice, lattice.number_of(problem.goal_state), "forward")
    for wrong in (np.zeros(len(points.costs), dtype=int), np.ones(3, dtype=int), np.ones(len(points.costs))):
        with pytest.raises(PlannerError, match="whole numbers from 1"):
            Motions(points.primitives, costs=wrong)


@pytest.mark.parametrize(
    "wrong", [{"epsilon": 0.9}, {"epsilon": 1.5, "last_epsilon": 2.0}, {"epsilon_step": 0.01}, {"direction": "up"}]
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        LatticeSettings.model_validate(wrong)
