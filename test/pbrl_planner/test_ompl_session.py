"""The session restores what it changes, seeds anew, and the budget ends a search."""

from __future__ import annotations

import pytest
from ompl import base as ob
from ompl import util as ou

from pbrl_planner.errors import PlannerError
from pbrl_planner.ompl_session import Budget, seeded


def draws(seed: int) -> list[float]:
    with seeded(seed):
        space = ob.RealVectorStateSpace(1)
        space.setBounds(0.0, 1.0)
        sampler, state = space.allocDefaultStateSampler(), space.allocState()
        found = []
        for _ in range(5):
            sampler.sampleUniform(state)
            found.append(state[0])
        return found


def test_a_seed_starts_the_draws_anew() -> None:
    assert draws(3) == draws(3)
    assert draws(3) != draws(4)


def test_the_log_level_comes_back_also_after_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    before = ou.getLogLevel()
    with pytest.raises(KeyError), seeded(1):
        assert ou.getLogLevel() == ou.LogLevel.LOG_NONE
        raise KeyError
    assert ou.getLogLevel() == before
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("seed", [0, -3, 2**32, 0.5, True])
def test_seeds_that_ompl_would_not_take_are_refused(seed: int) -> None:
    with pytest.raises(PlannerError, match="seed: expected a whole number"), seeded(seed):
        pytest.fail("the session began")


def test_a_budget_ends_by_iterations_and_counts_those_begun() -> None:
    budget = Budget(3, 1000.0)
    assert [budget.is_spent() for _ in range(5)] == [False, False, False, True, True]
    assert budget.used == 3
    assert not budget.timed_out


def test_a_budget_ends_by_time_before_anything_is_begun() -> None:
    budget = Budget(3, 0.0)
    assert budget.condition()()
    assert budget.used == 0
    assert budget.timed_out
