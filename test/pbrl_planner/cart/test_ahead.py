"""Where a better path may begin on one that is driven, and how the two are joined."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.cart import CartLimits, CartPlan
from pbrl_planner.cart.ahead import join_ahead, joined, same_way

LIMITS = CartLimits(speed=0.5)


def straight(length: float, heading: float = 0.0) -> np.ndarray:
    along = np.arange(0.0, length + 1e-9, 0.05)
    return np.column_stack((along * np.cos(heading), along * np.sin(heading), np.full((len(along), 2), [heading, 0.0])))


def test_nobody_is_there_before_the_lead_is_over() -> None:
    path = straight(10.0)
    join = join_ahead(path, 41, 4.0, LIMITS)
    assert join is not None and path[join, 0] - path[40, 0] == pytest.approx(2.0, abs=0.051)
    timed = CartPlan.timed(path[40:], LIMITS, 1.0, np.array([0.5, 0.0, 0.0, 0.0]))
    assert timed.reached[join - 40] >= 4.0 - 1e-6


@pytest.mark.parametrize("length", [0.0, 1.0, 3.9])
def test_near_the_end_there_is_nothing_to_better(length: float) -> None:
    assert join_ahead(straight(length), 1, 4.0, LIMITS) is None


def test_turning_on_the_spot_takes_time_too() -> None:
    turn = np.zeros((200, 4))
    turn[:, 2] = np.linspace(0.0, 6.0, 200)
    join = join_ahead(turn, 1, 4.0, LIMITS)
    assert join is not None and turn[join, 2] == pytest.approx(4.0 * LIMITS.yaw_rate, abs=0.05)


def test_the_joined_path_begins_here_and_goes_on_without_a_gap() -> None:
    path = straight(10.0)
    better = path[60] + np.vstack([np.zeros(4), straight(3.0, 0.6)[1:]])
    found = joined(path, 31, 60, better)
    assert found is not None and found[0] == pytest.approx(path[30]) and found[-1] == pytest.approx(better[-1])
    assert np.hypot(*np.diff(found[:, :2], axis=0).T).max() < 0.06


def test_what_comes_too_late_or_is_driven_anyway_is_not_taken() -> None:
    path = straight(10.0)
    other = path[60] + straight(3.0, 0.6)
    assert joined(path, 61, 60, other) is None and joined(path, 75, 60, other) is None
    assert joined(path, 31, 60, path[60:] + 0.01) is None


def test_ways_are_the_same_however_many_poses_they_have_and_a_turn_more_or_less() -> None:
    path = straight(4.0)
    assert same_way(path, path + np.array([0.02, 0.02, 0.0, 0.01])) and same_way(
        path, path + np.array([0.0, 0.0, 2.0 * np.pi, 0.0])
    )
    assert not same_way(path, path[:40]) and not same_way(path, path + np.array([0.0, 0.1, 0.0, 0.0]))
