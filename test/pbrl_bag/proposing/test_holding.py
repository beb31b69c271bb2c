"""A hand that stands where it will hold does not hold yet: what is felt says when it does."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bag.proposing.holding import AFTER, BEFORE, Held, while_felt

TOGETHER = Held(2.0, 20.0, np.array([-0.6, 0.1]), 1.0)


def wrench(begin: float, end: float, seed: int = 0, rate: float = 100.0) -> np.ndarray:
    """Return rows of a raw sensor with weight, noise and single wrong values, loaded between two times."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 25.0, 1.0 / rate)
    force = np.array([0.4, -0.3, -18.0]) + 0.1 * rng.standard_normal((len(time), 3))
    loaded = (time >= begin) & (time <= end)
    force[loaded] += np.column_stack([15.0 + 5.0 * np.sin(time), np.cos(time), 0.0 * time])[loaded]
    force[rng.integers(0, len(time), 12)] += 40.0
    return np.column_stack([time, force, np.zeros((len(time), 3))])


@pytest.mark.parametrize("rate", [40.0, 500.0])
@pytest.mark.parametrize("seed", range(4))
def test_the_hold_is_cut_to_what_was_felt(seed: int, rate: float) -> None:
    found = while_felt(TOGETHER, wrench(5.0, 17.0, seed, rate))
    assert found.start == pytest.approx(5.0 - BEFORE, abs=5.0 / rate)
    assert found.end == pytest.approx(17.0 + AFTER, abs=5.0 / rate)


def test_it_is_never_longer_than_hand_and_object_were_together() -> None:
    found = while_felt(TOGETHER, wrench(2.4, 24.0))
    assert found.start == TOGETHER.start
    assert found.end == TOGETHER.end


@pytest.mark.parametrize("rows", [np.empty((0, 7)), wrench(30.0, 31.0)[:3], np.full((2500, 7), np.nan)])
def test_without_a_force_to_go_by_it_stays(rows: np.ndarray) -> None:
    assert while_felt(TOGETHER, rows) == TOGETHER
