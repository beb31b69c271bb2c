"""Plans with times: limits, shape, hostile input."""

from __future__ import annotations

import numpy as np
import pytest
from cart_cases import PATHS, straight

from pbrl_control.cart import CartLimits, CartPlan
from pbrl_control.errors import ControlError

LIMITS = CartLimits()


@pytest.mark.parametrize("name", PATHS)
def test_a_timed_plan_goes_the_same_way_within_speeds_and_a_share_of_the_accelerations(name: str) -> None:
    plan = CartPlan.timed(PATHS[name], LIMITS, 0.5)
    assert np.allclose(plan.poses[[0, -1]], PATHS[name][[0, -1]])
    times = np.arange(0.0, plan.duration, 0.05)
    poses = plan.at(times)
    rates = np.diff(poses, axis=0) / 0.05
    sizes = np.column_stack((np.hypot(rates[:, 0], rates[:, 1]), np.abs(rates[:, 2:])))
    assert (sizes <= LIMITS.speeds + 1e-9).all()
    changes = np.diff(rates, axis=0)
    # A corner is rounded by the robot, not by the plan: there the plan's rates jump a little.
    jump = 3.0 if name in ("corner", "reversal") else 1.0
    sizes = np.column_stack((np.hypot(changes[:, 0], changes[:, 1]), np.abs(changes[:, 2:])))
    assert (sizes <= jump * LIMITS.accelerations * 0.05 + 0.02).all()
    dense = np.array(
        [np.interp(np.linspace(0, 1, 4000), np.linspace(0, 1, len(PATHS[name])), c) for c in PATHS[name].T]
    )
    off = np.abs(poses[:, :, None] - dense[None]).max(axis=1).min(axis=1)
    assert off.max() < 2e-3


def test_time_is_what_the_slowest_takes() -> None:
    assert CartPlan.timed(straight(3.5), LIMITS).duration == pytest.approx(10.0, rel=0.2)
    turn = np.array([[0, 0, 0, 0], [0, 0, 3.5, 0]])
    assert CartPlan.timed(turn, LIMITS).duration == pytest.approx(10.0, rel=0.2)


@pytest.mark.parametrize("heading", [0.0, 2.1])
@pytest.mark.parametrize("speed", [0.0, 0.1, 0.3, 5.0])
def test_who_is_under_way_goes_on_at_his_speed(speed: float, heading: float) -> None:
    path = straight(3.5, heading)
    plan = CartPlan.timed(path, LIMITS, 0.5, np.array([speed, 0.1, 0.0, 0.0]))
    assert plan.rates(0.0, 0.02)[0] == pytest.approx(min(speed, LIMITS.speeds[0]), abs=0.05)
    assert plan.duration <= CartPlan.timed(path, LIMITS, 0.5).duration + 1e-9
    backwards = CartPlan.timed(path, LIMITS, 0.5, np.array([-speed, 0.0, 0.0, 0.0]))
    assert backwards.duration == CartPlan.timed(path, LIMITS, 0.5).duration


def test_headings_may_wind_round() -> None:
    turned = np.zeros((9, 4))
    turned[:, 2] = np.angle(np.exp(1j * np.linspace(3.0, 4.0, 9)))
    plan = CartPlan.timed(turned, LIMITS)
    assert plan.poses[-1, 2] - plan.poses[0, 2] == pytest.approx(1.0)


def test_poses_that_repeat_cost_no_time() -> None:
    path = np.repeat(straight(1.0), 3, axis=0)
    assert CartPlan.timed(path, LIMITS).duration == pytest.approx(CartPlan.timed(straight(1.0), LIMITS).duration)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (np.zeros((3, 3)), "shape"),
        (np.zeros((0, 4)), "shape"),
        ("plan", "numbers|shape"),
        ([[0, 0, 0, 0], [1, 2]], "numbers"),
        (np.full((2, 4), np.nan), "finite"),
        ([[0, 0, 0, 0], [1e9, 0, 0, 0]], "1e6"),
        ([[0, 0, 0, 0], [1e5, 0, 0, 0]], "check its units"),
        ([[0, 0, 0, 0], [0, 0, 0, 1.2]], "articulations"),
    ],
)
def test_what_is_no_plan_is_refused_in_words(poses: object, words: str) -> None:
    with pytest.raises(ControlError, match=words):
        CartPlan.timed(poses, LIMITS)


@pytest.mark.parametrize("times", [[0.0, 0.0], [1.0, 2.0], [0.0, np.nan], [0.0]])
def test_times_that_do_not_ascend_are_refused(times: list[float]) -> None:
    with pytest.raises(ControlError, match="times"):
        CartPlan(np.array(times), np.zeros((2, 4)))
