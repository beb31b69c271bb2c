"""Only what a best policy may use is estimated, and nothing is lost by it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrl_namo.manipulation import Estimate
from pbrl_namo.mdp import Expansion, MdpSettings, expand
from pbrl_namo.regions import Opening

Make = Callable[..., Estimate]
BEST = -0.1


def expanded(
    estimates: list[Estimate], count: int, start: int, goal: int, mode: str
) -> tuple[Expansion, list[Opening]]:
    """Expand, and say what was asked for in which order."""
    asked: list[Opening] = []
    known = {each.opening: each for each in estimates}

    def answer(opening: Opening) -> Estimate:
        asked.append(opening)
        return known[opening]

    found = expand(count, start, goal, [each.opening for each in estimates], answer, BEST, MdpSettings(expand=mode))
    return found, asked


@pytest.mark.parametrize("seed", range(60))
def test_the_start_is_worth_as_much_as_with_all_estimates(seed: int, make: Make) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 10))
    estimates = [
        make(a, b, float(rng.choice([0.0, 0.2, 0.7, 1.0])), float(-rng.uniform(0.1, 25.0)), f"thing_{k}")
        for k in range(int(rng.integers(1, 25)))
        for a, b in [map(int, rng.choice(count, 2, replace=False))]
    ]
    start, goal = map(int, rng.choice(count, 2, replace=False))
    all_of_them, every = expanded(estimates, count, start, goal, "all")
    needed, some = expanded(estimates, count, start, goal, "needed")
    assert needed.policy.values[start] == pytest.approx(all_of_them.policy.values[start], abs=1e-6)
    assert (needed.policy.values >= all_of_them.policy.values - 1e-6).all()
    assert len(every) == len(estimates)
    assert len(some) == len(set(some)) <= len(every)
    here, steps = start, 0
    while here != goal and needed.policy.best[here] is not None and steps < count:
        action = needed.policy.best[here]
        assert action is not None
        assert needed.estimates[action] is not None  # the way is known
        here, steps = estimates[action].opening.end, steps + 1


def test_what_lies_behind_the_goal_or_in_a_dead_end_is_not_asked_for(make: Make) -> None:
    estimates = [
        make(0, 1, 1.0, -3.0, "door"),
        make(0, 2, 1.0, -1.0, "dead end"),
        make(2, 0, 1.0, -1.0, "back"),
        make(1, 3, 1.0, -1.0, "behind"),
        make(1, 0, 1.0, -1.0, "return"),
    ]
    found, asked = expanded(estimates, 4, 0, 1, "needed")
    assert [opening.object for opening in asked] == ["door"]
    assert found.estimates[1:] == (None,) * 4
    assert found.policy.best[0] == 0


def test_where_nothing_works_everything_that_could_have_was_asked_for(make: Make) -> None:
    estimates = [make(0, 1, 0.0, -25.0, name) for name in ("a", "b", "c")]
    found, asked = expanded(estimates, 2, 0, 1, "needed")
    assert len(asked) == 3
    assert found.policy.best[0] is None
    assert found.policy.values[0] == 0.0


def test_without_openings_there_is_nothing_to_ask() -> None:
    found, asked = expanded([], 2, 0, 1, "needed")
    assert asked == []
    assert found.estimates == ()
    assert found.policy.values.tolist() == [0.0, 200.0]
