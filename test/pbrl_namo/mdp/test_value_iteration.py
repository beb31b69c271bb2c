"""Value iteration: against linear algebra, and the laws of values."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation import Estimate
from pbrl_namo.mdp import MdpSettings, Policy, solve

Make = Callable[..., Estimate]


def random_problem(seed: int, make: Make) -> tuple[int, int, list[Estimate]]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 12))
    pairs = [rng.choice(count, 2, replace=False) for _ in range(int(rng.integers(1, 40)))]
    numbers = zip(rng.choice([0.0, 0.1, 0.6, 1.0], len(pairs)), -rng.uniform(0.1, 25.0, len(pairs)), strict=True)
    estimates = [make(int(a), int(b), float(t), float(r)) for (a, b), (t, r) in zip(pairs, numbers, strict=True)]
    return count, int(rng.integers(count)), estimates


def values_of(count: int, goal: int, estimates: list[Estimate], policy: Policy, settings: MdpSettings) -> np.ndarray:
    """Return the values of a fixed policy: (I - gamma P) V = R, dense; giving up leads to a region worth nothing."""
    transition, reward = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    for region, action in enumerate(policy.best):
        if action is None:
            transition[region, count] = region != goal
            continue
        chosen = estimates[action]
        transition[region, chosen.opening.end] += chosen.probability
        transition[region, region] += 1.0 - chosen.probability
        reward[region] = chosen.reward
    reward[goal] = settings.terminal
    transition[goal] = 0.0
    return np.linalg.solve(np.eye(count + 1) - settings.gamma * transition, reward)[:count]


@pytest.mark.parametrize("gamma", [0.3, 0.95, 0.999])
@pytest.mark.parametrize("seed", range(30))
def test_values_are_those_of_the_policy_by_linear_algebra(seed: int, gamma: float, make: Make) -> None:
    count, goal, estimates = random_problem(seed, make)
    settings = MdpSettings(gamma=gamma)
    policy = solve(count, goal, estimates, settings)
    dense = values_of(count, goal, estimates, policy, settings)
    assert policy.values == pytest.approx(dense, abs=1e-5)
    for q, each in zip(policy.q, estimates, strict=True):  # Bellman's equation, action by action
        ahead = each.probability * dense[each.opening.end] + (1.0 - each.probability) * dense[each.opening.start]
        assert q == pytest.approx(each.reward + gamma * ahead, abs=1e-5)
        if each.opening.start != goal:
            assert policy.values[each.opening.start] >= q - 1e-5


@pytest.mark.parametrize("seed", range(30))
def test_nobody_does_better_by_another_action(seed: int, make: Make) -> None:
    """Of small problems every policy is tried."""
    count, goal, estimates = random_problem(seed, make)
    estimates, settings = estimates[:6], MdpSettings(gamma=0.9)
    policy = solve(count, goal, estimates, settings)
    choices = [
        [None, *(k for k, e in enumerate(estimates) if e.opening.start == s)] if s != goal else [None]
        for s in range(count)
    ]
    for other in np.ndindex(*map(len, choices)):
        best = tuple(choices[s][k] for s, k in enumerate(other))
        values = values_of(count, goal, estimates, Policy(policy.values, policy.q, best, 0), settings)
        assert (values <= policy.values + 1e-5).all()


def test_the_goal_absorbs(make: Make) -> None:
    away = [make(0, 1, 1.0, -0.1), make(1, 0, 1.0, -0.1)]
    policy = solve(2, 0, away)
    assert policy.values[0] == 200.0
    assert policy.best == (None, 1)
    assert policy.values[1] == pytest.approx(-0.1 + 0.95 * 200.0)


def test_what_leads_nowhere_is_worth_nothing(make: Make) -> None:
    policy = solve(4, 0, [make(1, 0), make(2, 3), make(3, 2)])
    assert policy.values.tolist() == [200.0, 189.0, 0.0, 0.0]
    assert policy.best == (None, 0, None, None)


def test_without_openings_only_the_goal_is_worth_something() -> None:
    policy = solve(3, 2, [])
    assert policy.values.tolist() == [0.0, 0.0, 200.0]
    assert policy.best == (None, None, None)
    assert len(policy.q) == 0


def test_an_opening_that_never_works_is_not_tried(make: Make) -> None:
    policy = solve(2, 0, [make(1, 0, 0.0, -0.1)])
    assert policy.best == (None, None)
    assert policy.q[0] < 0.0


def test_one_that_often_fails_is_tried_again(make: Make) -> None:
    policy = solve(2, 0, [make(1, 0, 0.5, -2.0)], MdpSettings(gamma=0.9))
    assert policy.values[1] == pytest.approx((-2.0 + 0.9 * 0.5 * 200.0) / (1.0 - 0.9 * 0.5))


def test_patience_decides_between_a_sure_detour_and_a_gamble(make: Make) -> None:
    problem = [make(2, 0, 0.3, -5.0), make(2, 1, 1.0, -5.0), make(1, 0, 1.0, -5.0)]
    assert solve(3, 0, problem, MdpSettings(gamma=0.95)).best[2] == 1
    assert solve(3, 0, problem, MdpSettings(gamma=0.3)).best[2] == 0


@pytest.mark.parametrize("seed", range(20))
def test_values_grow_with_probability_and_reward(seed: int, make: Make) -> None:
    count, goal, estimates = random_problem(seed, make)
    values = solve(count, goal, estimates).values
    for k, each in enumerate(estimates):
        start, end = each.opening.start, each.opening.end
        likelier = make(start, end, min(1.0, each.probability + 0.3), each.reward)
        cheaper = make(start, end, each.probability, 0.5 * each.reward)
        for better in (likelier, cheaper):
            more = solve(count, goal, [*estimates[:k], better, *estimates[k + 1 :]]).values
            assert (more >= values - 1e-6).all()


def test_without_discount_only_costs_count(make: Make) -> None:
    settings = MdpSettings(gamma=1.0)
    policy = solve(
        4, 0, [make(3, 2, 1.0, -3.0), make(2, 1, 0.5, -2.0), make(1, 0, 1.0, -1.0), make(3, 0, 0.0, -1.0)], settings
    )
    assert policy.values == pytest.approx([200.0, 199.0, 195.0, 192.0], abs=1e-6)


def test_nothing_later_counts_where_gamma_is_zero(make: Make) -> None:
    policy = solve(2, 0, [make(1, 0, 1.0, -1.0)], MdpSettings(gamma=0.0))
    assert policy.values.tolist() == [200.0, 0.0]
    assert policy.best == (None, None)
    assert policy.q[0] == -1.0


def test_values_that_never_stand_are_an_error(make: Make) -> None:
    with pytest.raises(NamoError, match="lower gamma"):
        solve(2, 0, [make(1, 0, 1e-9, -1e-12)], MdpSettings(gamma=1.0, sweeps=50, tolerance=1e-12))


@pytest.mark.parametrize(
    ("count", "goal", "start", "end", "probability", "reward"),
    [
        (2, 2, 1, 0, 1.0, -1.0),
        (2, -1, 1, 0, 1.0, -1.0),
        (0, 0, 1, 0, 1.0, -1.0),
        (2, 0, 2, 0, 1.0, -1.0),
        (2, 0, 1, -1, 1.0, -1.0),
        (2, 0, 1, 0, 1.1, -1.0),
        (2, 0, 1, 0, -0.1, -1.0),
        (2, 0, 1, 0, math.nan, -1.0),
        (2, 0, 1, 0, 1.0, math.nan),
        (2, 0, 1, 0, 1.0, -math.inf),
    ],
)
def test_what_is_no_problem_is_refused(
    count: int, goal: int, start: int, end: int, probability: float, reward: float, make: Make
) -> None:
    with pytest.raises(NamoError, match="expected"):
        solve(count, goal, [make(start, end, probability, reward)])
