"""What makes the first plan soon changes no answer: bounds that stop early, states left out, floods, arrays kept."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from lattice_cases import CELL, Reference, cart_motions, free_state, point_motions, random_grid

from pbrl_planner.lattice import CostGrid, Lattice, LatticeProblem, LatticeSettings, plan, planner, warm_up
from pbrl_planner.lattice.lower_bound import LowerBound
from pbrl_planner.lattice.moves import _fewer, _needed, relax
from pbrl_planner.lattice.reach import reach
from pbrl_planner.lattice.search_kernel import LAST_STAMP, LIMIT
from pbrl_planner.lattice.shelf import Answers, Records, Shelf

DIRECTIONS: tuple[Literal["forward", "backward"], ...] = ("forward", "backward")


def lattice_of(kind: str, seed: int, rows: int = 24, columns: int = 30) -> Lattice:
    rng = np.random.default_rng(seed)
    motions = point_motions() if kind == "point" else cart_motions()
    return Lattice(random_grid(rng, rows, columns, 0.3 if kind == "point" else 0.02), motions)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("kind", ["point", "cart"])
def test_a_bound_that_stops_early_is_the_full_one_as_far_as_it_goes(
    kind: str, direction: Literal["forward", "backward"]
) -> None:
    lattice = lattice_of(kind, 1)
    rng = np.random.default_rng(2)
    goal, state = (lattice.number_of(free_state(lattice, rng)) for _ in range(2))
    full, early = LowerBound.of(lattice, goal, direction), LowerBound(lattice, goal, direction)
    assert full.radius == LIMIT
    assert early.at(goal) == 0
    for share in (1.0, 1.3, 2.0):
        early.reach(state, share)
        assert early.at(state) == full.at(state)
        assert early.radius >= min(LIMIT, share * full.toward[state // lattice.primitives.bins])
        assert (np.minimum(early.toward, early.radius) == np.minimum(full.toward, early.radius)).all()
    early.finish()
    assert early.radius == LIMIT and (early.toward == full.toward).all()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_bound_that_stops_early_is_consistent_and_admissible(direction: Literal["forward", "backward"]) -> None:
    lattice = lattice_of("cart", 3, 18, 22)
    reference, rng = Reference.of(lattice), np.random.default_rng(4)
    goal, state = (lattice.number_of(free_state(lattice, rng)) for _ in range(2))
    bound = LowerBound(lattice, goal, direction)
    bound.reach(state)
    ends = reference.edges[:, [0, 1] if direction == "forward" else [1, 0]]
    here, there = (at_all(bound, ends[:, k]) for k in range(2))
    assert (here <= reference.edges[:, 2] + there)[there < LIMIT].all()
    true = reference.costs_from(goal, backward=direction == "forward")
    reached = np.flatnonzero(np.isfinite(true))
    assert (at_all(bound, reached) <= true[reached]).all()


def at_all(bound: LowerBound, states: np.ndarray) -> np.ndarray:
    cells, bins = np.divmod(states, len(bound.turning))
    return np.minimum(bound.toward[cells].astype(np.int64), bound.radius) + bound.turning[bins]


def test_fewer_moves_on_the_floor_cost_no_more_than_those_they_stand_for() -> None:
    for motions in (point_motions(16, 8), cart_motions()):
        moves = _needed([replace(move, source=0, target=0) for move in motions.moves])
        few = {(move.dx, move.dy): move.cost for move in _fewer(moves)}
        assert len(few) <= len(moves)
        # Free floor of 25 by 25 cells: the cheapest way by few moves is no dearer than any single move.
        reach_, cost = 12, {(0, 0): 0}
        for _ in range(2 * reach_):
            for (x, y), so_far in list(cost.items()):
                for (dx, dy), more in few.items():
                    end = (x + dx, y + dy)
                    if max(map(abs, end)) <= reach_:
                        cost[end] = min(cost.get(end, LIMIT), so_far + more)
        assert all(cost[move.dx, move.dy] <= move.cost for move in moves if max(abs(move.dx), abs(move.dy)) <= reach_)
    assert relax(point_motions().moves, 8, LIMIT).turning.diagonal().tolist() == [0] * 8


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize(("kind", "thinned"), [("point", 2), ("point", 8), ("cart", 4)])
def test_plans_cost_what_dijkstra_s_do_whatever_is_left_out_at_first(
    kind: str, thinned: Literal[2, 4, 8], direction: Literal["forward", "backward"]
) -> None:
    lattice, rng = lattice_of(kind, 5, 18, 30), np.random.default_rng(6)
    reference = Reference.of(lattice)
    settings = LatticeSettings(direction=direction, thinned=thinned, time_limit=600.0)
    found = 0
    for _ in range(5):
        start, goal = (lattice.pose_of(free_state(lattice, rng)) for _ in range(2))
        problem = LatticeProblem(lattice, start, goal)
        best = reference.costs_from(lattice.number_of(problem.start_state))[lattice.number_of(problem.goal_state)]
        made = plan(problem, settings)
        assert made.found == bool(np.isfinite(best)) and made.exhausted != made.found
        assert bool(made.reason) == made.exhausted
        found += made.found
        if made.found:
            assert made.cost == best and made.epsilon == 1.0
            assert all(best <= each.cost <= each.epsilon * best + 1e-6 for each in made.history)
            costs = [each.cost for each in made.history]
            assert costs == sorted(costs, reverse=True)
    assert found >= 2


@pytest.mark.parametrize(("kind", "share"), [("point", 0.62), ("cart", 0.035)])
def test_floods_reach_what_dijkstra_does_and_tell_the_way(kind: str, share: float) -> None:
    answers = []
    motions = point_motions() if kind == "point" else cart_motions()
    for seed in range(2):
        rng = np.random.default_rng(seed)
        lattice = Lattice(random_grid(rng, 16, 70, share), motions)
        reference = Reference.of(lattice)
        for _ in range(5):
            start, goal = (lattice.number_of(free_state(lattice, rng)) for _ in range(2))
            best = reference.costs_from(start)[goal]
            found = reach(lattice, start, goal, 600.0)
            assert found.connected is bool(np.isfinite(best))
            answers.append(found.connected)
            if found.primitives is None:
                assert found.side in ("start", "goal")
                continue
            here = start
            for number in found.primitives:
                (edge,) = reference.edges[(reference.edges[:, 0] == here) & (reference.edges[:, 3] == number)]
                here = edge[1]
            assert here == goal
    assert 1 <= sum(answers) < len(answers), "both kinds of answers are asked for"


def test_the_disc_s_proof_never_contradicts_the_floods() -> None:
    shut = 0
    for seed in range(3):
        lattice, rng = lattice_of("cart", 20 + seed, 16, 60), np.random.default_rng(seed)
        goal = lattice.number_of(free_state(lattice, rng))
        bound = LowerBound.of(lattice, goal, "forward")
        for _ in range(4):
            start = lattice.number_of(free_state(lattice, rng))
            if reach(lattice, start, goal, 600.0).connected:
                assert bound.at(start) < LIMIT
            else:
                shut += 1
    assert shut


def test_no_time_for_floods_is_no_proof() -> None:
    lattice, rng = lattice_of("cart", 1), np.random.default_rng(2)
    start, goal = (lattice.number_of(free_state(lattice, rng)) for _ in range(2))
    assert reach(lattice, start, goal, -1.0).connected is None


def test_where_the_search_may_not_look_far_a_way_is_found_all_the_same() -> None:
    lattice = Lattice(CostGrid(np.zeros((60, 60), dtype=np.uint8), CELL), cart_motions())
    problem = LatticeProblem(lattice, (1.0, 1.0, 0.0, 0.0), (4.0, 4.5, 3.0, 0.0))
    best = plan(problem, LatticeSettings(time_limit=600.0)).cost
    made = plan(problem, LatticeSettings(thinned=8, expansions=3))
    assert made.found and not made.exhausted and made.epsilon > 1.0
    assert best <= made.cost <= made.epsilon * best
    assert lattice.cost_along(problem.start_state, made.primitives) == made.cost
    assert np.allclose(made.waypoints[-1, :2], lattice.pose_of(problem.goal_state)[:2])


def test_arrays_that_are_used_again_change_nothing() -> None:
    motions = cart_motions()
    rng = np.random.default_rng(8)
    lattices = [Lattice(random_grid(rng, 20 + k, 30, 0.02), motions) for k in (4, 0, 2)]
    problems = [LatticeProblem(each, *(each.pose_of(free_state(each, rng)) for _ in range(2))) for each in lattices]
    settings = LatticeSettings(time_limit=600.0, thinned=4)
    for _ in range(2):
        for problem in (*problems, problems[0]):
            kept, motions.shelf = motions.shelf, Shelf()
            alone = Lattice(problem.lattice.grid, motions)
            expected = plan(LatticeProblem(alone, problem.start, problem.goal), settings)
            motions.shelf = kept
            made = plan(problem, settings)
            assert (made.cost, made.expansions) == (expected.cost, expected.expansions)
            assert made.poses.tobytes() == expected.poses.tobytes()


@pytest.mark.parametrize("cells", [4, 40])
def test_warming_up_changes_no_plan_and_leaves_memory_for_the_next(cells: int) -> None:
    grid = CostGrid(np.zeros((cells, cells), dtype=np.uint8), CELL)
    settings = LatticeSettings(time_limit=600.0, thinned=4)
    cold, warm = cart_motions(), cart_motions()
    warm_up(warm, grid, settings)
    lattice = Lattice(grid, warm)
    assert warm.shelf.take_records(lattice.cells * lattice.primitives.bins).stamp > 1
    warm_up(warm, grid, settings)
    if cells < 10:  # nothing has room there
        return
    ends = (1.0, 1.0, 0.0, 0.0), (2.0, 2.5, 1.0, 0.0)
    expected, made = (plan(LatticeProblem(Lattice(grid, motions), *ends), settings) for motions in (cold, warm))
    assert (made.cost, made.expansions) == (expected.cost, expected.expansions)
    assert made.poses.tobytes() == expected.poses.tobytes()


def test_after_warming_up_all_memory_of_a_search_is_there() -> None:
    command = [sys.executable, str(Path(__file__).with_name("warm_pages.py"))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=True)
    warm, cold = map(int, done.stdout.split())
    assert warm <= 2 < 10 < cold


@pytest.mark.parametrize("door", [4, 5])
def test_little_floor_is_searched_before_floods_are_asked(monkeypatch: pytest.MonkeyPatch, door: int) -> None:
    cells = np.zeros((70, 120), dtype=np.uint8)
    cells[:, 60:62] = 254
    cells[30 : 30 + door, 60:62] = 0  # 0.4 m are too little for robot and cart, 0.5 m are not
    problem = LatticeProblem(
        Lattice(CostGrid(cells, CELL), cart_motions()), (0.6, 0.6, 1.57, 0.0), (9.2, 2.6, 0.0, 0.0)
    )
    monkeypatch.setattr(planner, "reach", lambda *_: pytest.fail("a flood takes longer than the search"))
    made = plan(problem, LatticeSettings(thinned=8, time_limit=600.0))
    assert made.found == (door == 5) and made.exhausted != made.found


def test_a_plan_within_a_plan_gets_arrays_of_its_own() -> None:
    lattice = lattice_of("point", 1)
    rng = np.random.default_rng(9)
    problem = LatticeProblem(lattice, *(lattice.pose_of(free_state(lattice, rng)) for _ in range(2)))
    expected = plan(problem)
    inner: list[int] = []
    made = plan(problem, None, lambda _: inner.append(plan(problem).cost))
    assert made.cost == expected.cost and set(inner) <= {expected.cost}
    assert made.poses.tobytes() == expected.poses.tobytes()


def test_stamps_that_are_used_up_are_followed_by_new_arrays() -> None:
    shelf = point_motions(8, 2).shelf
    records = shelf.take_records(10)
    shelf.give_back(Records(records.array, LAST_STAMP))
    again = shelf.take_records(10)
    assert again.stamp == 1 and again.array is not records.array and not again.array.any()
    shelf.give_back(again)
    assert shelf.take_records(5).stamp == 2
    first = shelf.answers("moves", 6)
    shelf._answers["moves"] = Answers(first.free, first.known, LAST_STAMP)
    assert shelf.answers("moves", 6).known is not first.known
