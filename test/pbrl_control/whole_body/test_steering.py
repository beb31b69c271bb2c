"""Base steering: what it plans is a minimum, mirrors with its task, and keeps what is carried in the workspace."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.planar import compose, inverse, rotation, shift, turn, wrap
from pbrl_control.settings import BaseSettings
from pbrl_control.whole_body.steering import Predictive, Steering, steering_of, unsteered
from pbrl_control.whole_body.steering_kernel import carried_frame, steer

HOME = np.array([0.74, 0.0, 0.0])
SETTINGS = BaseSettings()
CEILING, CHANGE = np.array([0.35, 0.5]), np.array([0.5, 1.0])
WEIGHTS = np.array([100.0, 100.0, 4.0, 20.0, 10.0, 4.0, 0.6, 50.0])


def carry(steering: Steering, twist: np.ndarray, seconds: float, dt: float = 0.02) -> np.ndarray:
    """Return how far (n, 3) the carried frame is from home while it moves with a twist in its own axes."""
    base, carried, speed, errors = np.zeros(3), HOME.copy(), np.zeros(2), []
    for _ in range(round(seconds / dt)):
        seen = compose(inverse(base), carried)
        wish = steering.wish(seen, turn(twist, seen[2]), HOME)
        speed = np.clip(np.clip(wish, speed - CHANGE * dt, speed + CHANGE * dt), -CEILING, CEILING)
        base = compose(base, np.array([speed[0] * dt, 0.0, speed[1] * dt]))
        carried = compose(carried, twist * dt)
        off = compose(inverse(base), carried) - HOME
        errors.append([off[0], off[1], wrap(off[2])])
    return np.array(errors)


def test_pushed_straight_nothing_is_steered() -> None:
    off = carry(Predictive(SETTINGS), np.array([0.05, 0.0, 0.0]), 40.0)
    assert np.abs(off[:, :2]).max() < 5e-3
    assert np.abs(off[:, 2]).max() < 1e-6


@pytest.mark.parametrize("aside", [0.02, -0.02])
def test_two_metres_at_a_slant_stay_in_the_workspace(aside: float) -> None:
    twist = np.array([0.05, aside, 0.0])
    seconds = 2.0 / math.hypot(0.05, aside)
    off = carry(Predictive(SETTINGS), twist, seconds)
    assert np.abs(off[:, :2]).max() < 0.05
    drifted = carry(steering_of(BaseSettings(steering="none")), twist, seconds)
    assert np.abs(drifted[-1, 1]) > 0.5


def test_a_turn_about_a_far_point_is_followed() -> None:
    about = np.array([0.0, -3.0])
    off = carry(Predictive(SETTINGS), shift(np.array([0.0, 0.0, -0.02]), -about), 30.0)
    assert np.abs(off[:, :2]).max() < 0.05


def test_a_mirrored_task_is_steered_mirrored(rng: np.random.Generator) -> None:
    for _ in range(10):
        carried, twist = HOME + 0.05 * rng.normal(size=3), 0.05 * rng.normal(size=3)
        mirror = np.array([1.0, -1.0, -1.0])
        plan, other = np.zeros((16, 2)), np.zeros((16, 2))
        for seen, own, made in ((carried, twist, plan), (carried * mirror, twist * mirror, other)):
            steer(seen, own, HOME, unsteered(seen, turn(own, seen[2])), CEILING, WEIGHTS, 0.25, made, 40)
        np.testing.assert_allclose(other, plan * [1.0, -1.0], atol=1e-9)


def test_a_finished_plan_is_a_minimum(rng: np.random.Generator) -> None:
    carried, twist = HOME + np.array([0.03, 0.05, 0.1]), np.array([0.04, 0.01, 0.01])
    plain, plan = unsteered(carried, turn(twist, carried[2])), np.zeros((16, 2))
    best = steer(carried, twist, HOME, plain, CEILING, WEIGHTS, 0.25, plan, 200)
    assert np.abs(plan).max() < 0.3, "no bound is in the way"
    for _ in range(200):
        near = plan + 1e-3 * rng.normal(size=plan.shape)
        cost = steer(carried, twist, HOME, plain, CEILING, WEIGHTS, 0.25, near, 0)
        assert cost >= best - 1e-9


def test_more_rounds_never_cost_more(rng: np.random.Generator) -> None:
    carried, twist = HOME + 0.2 * rng.normal(size=3), 0.2 * rng.normal(size=3)
    plain, plan = np.zeros(2), np.zeros((24, 2))
    costs = [steer(carried, twist, HOME, plain, CEILING, WEIGHTS, 0.25, plan, 1) for _ in range(30)]
    assert (np.diff(costs) <= 1e-12).all()
    assert (np.abs(plan) <= CEILING).all()


def test_a_waypoint_far_aside_is_turned_to_first() -> None:
    waypoint = steering_of(BaseSettings(steering="waypoint"))
    aside = compose(np.array([0.0, 0.3, 0.0]), HOME)
    v, w = waypoint.wish(aside, np.zeros(3), HOME)
    assert v == 0.0
    assert w == pytest.approx(0.5 * 0.5 * math.pi)
    ahead = compose(np.array([0.3, 0.0, 0.0]), HOME)
    assert waypoint.wish(ahead, np.zeros(3), HOME) == pytest.approx([0.15, 0.0])
    near = compose(np.array([0.01, 0.0, 0.2]), HOME)
    assert waypoint.wish(near, np.zeros(3), HOME) == pytest.approx([0.005, 0.1])


def test_a_waypoint_behind_is_backed_to() -> None:
    waypoint = steering_of(BaseSettings(steering="waypoint"))
    behind = compose(np.array([-0.3, 0.0, 0.0]), HOME)
    assert waypoint.wish(behind, np.zeros(3), HOME) == pytest.approx([-0.15, 0.0])


def test_a_base_without_steering_takes_its_share_of_the_twist(rng: np.random.Generator) -> None:
    carried, own = rng.normal(size=3), rng.normal(size=3)
    v, w = unsteered(carried, own)
    whole = shift(own, -carried[:2])
    assert [v, w] == pytest.approx([whole[0], whole[2]])
    assert rotation(0.0) @ whole[:2] == pytest.approx([v, whole[1]])


def test_a_stopped_steering_begins_anew() -> None:
    steering, fresh = Predictive(SETTINGS), Predictive(SETTINGS)
    task = (HOME + np.array([0.02, -0.03, 0.0]), np.array([0.03, 0.02, 0.0]), HOME)
    steering.wish(HOME + 0.1, np.array([-0.1, 0.1, 0.1]), HOME)
    steering.stop()
    np.testing.assert_array_equal(steering.wish(*task), fresh.wish(*task))


@pytest.mark.parametrize("count", [1, 2])
def test_the_carried_frame_is_the_plain_formula(count: int) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        rows = rng.normal(size=(count, 3, 3))
        rows[:, :2, 2] *= 2.0
        carried, twist, home = carried_frame(rows)
        places, homes, asked = rows.transpose(1, 0, 2)
        away = places - homes
        away[:, 2] = [wrap(angle) for angle in away[:, 2]]
        np.testing.assert_allclose(home, homes.mean(0), atol=1e-12)
        np.testing.assert_allclose(carried, homes.mean(0) + away.mean(0), atol=1e-12)
        shifted = [shift(each, carried[:2] - place[:2]) for each, place in zip(asked, places, strict=True)]
        np.testing.assert_allclose(twist, np.mean(shifted, 0), atol=1e-12)
