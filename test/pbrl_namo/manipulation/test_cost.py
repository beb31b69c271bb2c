"""Equation 41: the more it takes, the less it is worth, between -alpha and nothing."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_namo.manipulation import CostSettings
from pbrl_namo.manipulation.cost import best_reward, reward

SETTINGS = CostSettings()
MOST = (SETTINGS.time, SETTINGS.force, SETTINGS.torque)


@pytest.mark.parametrize("which", range(3))
def test_more_of_anything_is_worse(which: int) -> None:
    amounts = [np.full(50, 0.3 * most) for most in MOST]
    amounts[which] = np.linspace(0.0, 2.0 * MOST[which], 50)
    assert (np.diff(reward(*amounts, SETTINGS)) < 0.0).all()


def test_it_is_below_nothing_and_never_worse_than_alpha() -> None:
    rng = np.random.default_rng(0)
    found = reward(*(rng.uniform(0.0, 10.0 * most, 1000) for most in MOST), SETTINGS)
    assert (found < 0.0).all()
    assert (found >= -SETTINGS.alpha).all()
    huge = reward(*(np.array([1e9 * most]) for most in MOST), SETTINGS)
    assert huge[0] == pytest.approx(-SETTINGS.alpha)


def test_half_the_nominal_maximum_costs_half() -> None:
    assert reward(*(np.array([0.5 * most]) for most in MOST), SETTINGS)[0] == pytest.approx(-0.5 * SETTINGS.alpha)
    steep = SETTINGS.model_copy(update={"beta": 30.0})
    assert reward(*(np.array([0.5 * most]) for most in MOST), steep)[0] == pytest.approx(-0.5 * SETTINGS.alpha)


def test_it_is_the_decreasing_sigmoid_of_the_text_less_alpha() -> None:
    x = np.linspace(0.0, 1.0, 11)
    z = 0.5 * SETTINGS.beta * (2.0 * x - 1.0)
    decreasing = SETTINGS.alpha * np.exp(-z) / (1.0 + np.exp(-z))
    assert reward(*(x * most for most in MOST), SETTINGS) == pytest.approx(decreasing - SETTINGS.alpha)


def test_nothing_is_better_than_nothing_at_all() -> None:
    assert best_reward(SETTINGS) == reward(np.zeros(1), np.zeros(1), np.zeros(1), SETTINGS)[0]
    assert -1.0 < best_reward(SETTINGS) < 0.0


def test_nan_stays() -> None:
    assert np.isnan(reward(np.array([np.nan]), np.array([1.0]), np.array([1.0]), SETTINGS)[0])
