"""Guesses, polish and mode finder: exact on exact motions, and at the top of what they climb."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_model.errors import ModelError
from pbrl_model.fitting.guesses import axle, circle, pivot
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.polish import polish
from pbrl_model.fitting.starts import SearchPlan, distinct, find_modes
from pbrl_model.fitting.target import Target
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.priors import table2_prior
from pbrl_model.sensing.motion import Motion, observe
from pbrl_model.sensing.windows import shooting_windows
from pbrl_model.symmetry import wheel_features

COM = np.array([0.1, -0.05])
SMALL = SearchPlan(draws=60, keep=(6, 3), lengths=(0.5,), iterations=(4, 12))


def motion_from(state: np.ndarray, time: np.ndarray) -> Motion:
    """A motion that is known without noise."""
    return Motion(
        object="body",
        grippers=("left",),
        dt=float(time[1] - time[0]),
        time=time,
        wrench=np.zeros((len(time) - 1, 3)),
        pose_time=time,
        pose=state[:, :3].copy(),
        state=state,
        covariance=np.tile(1e-8 * np.eye(6), (len(time), 1, 1)),
        noise=np.full(3, 1e-4),
        oriented=True,
    )


def turning_about(point: np.ndarray, anchor: np.ndarray) -> Motion:
    """The body's point stays at the anchor in world while the heading swings."""
    time = np.arange(0, 3, 0.01)
    theta, omega = 0.5 * np.sin(time), 0.5 * np.cos(time)
    arm = COM - point
    c, s = np.cos(theta), np.sin(theta)
    x = anchor[0] + c * arm[0] - s * arm[1]
    y = anchor[1] + s * arm[0] + c * arm[1]
    return motion_from(np.stack([x, y, theta, -omega * (y - anchor[1]), omega * (x - anchor[0]), omega], -1), time)


def test_pivot_is_the_point_that_stays() -> None:
    point = np.array([-0.6, 0.3])
    np.testing.assert_allclose(pivot([turning_about(point, np.array([2.0, 1.0]))], COM), point, atol=1e-3)


def test_a_body_that_only_slides_has_its_pivot_nowhere_wild() -> None:
    time = np.arange(0, 2, 0.01)
    state = np.zeros((len(time), 6))
    state[:, 0], state[:, 3] = 0.1 * time, 0.1
    assert np.all(np.isfinite(pivot([motion_from(state, time)], COM)))


def test_axle_is_where_nothing_moves_sideways() -> None:
    # A cart: its axle at `place` rolls along the body's direction `angle` only, while the heading swings.
    angle, place = 0.4, COM + 0.35 * np.array([np.cos(0.4), np.sin(0.4)])
    time = np.arange(0, 4, 0.01)
    theta, omega = 0.6 * np.sin(time), 0.6 * np.cos(time)
    speed = 0.2 + 0.1 * np.sin(2 * time)
    c, s = np.cos(theta + angle), np.sin(theta + angle)
    arm = COM - place
    ax, ay = np.cos(theta) * arm[0] - np.sin(theta) * arm[1], np.sin(theta) * arm[0] + np.cos(theta) * arm[1]
    zeros = np.zeros_like(time)
    state = np.stack([zeros, zeros, theta, speed * c - omega * ay, speed * s + omega * ax, omega], -1)
    found_angle, found_place = axle([motion_from(state, time)], COM)
    assert found_angle == pytest.approx(angle, abs=np.pi / 60)
    along = np.array([np.cos(angle), np.sin(angle)])
    assert (found_place - place) @ along == pytest.approx(0.0, abs=0.02)


def test_circle_is_kasas() -> None:
    time = np.arange(0, 2, 0.01)
    state = np.zeros((len(time), 6))
    state[:, 0], state[:, 1] = 1.0 + 0.3 * np.cos(time), -0.6 + 0.3 * np.sin(time)
    centre, radius = circle([motion_from(state, time)])  # type: ignore[misc]
    np.testing.assert_allclose([*centre, radius], [1.0, -0.6, 0.3], atol=1e-9)
    state[:, 1] = 0.0
    assert circle([motion_from(state, time)]) is None


@pytest.fixture(scope="module")
def pushed(make_recording: Callable[..., Recording]) -> tuple[Target, Motion]:
    recording = make_recording(0, seconds=6.0)
    motion = observe(recording, "table", ("left",), 2.0, 7.9, np.zeros(2))
    body = recording.bodies["table"]
    prior = table2_prior(body, "wheel")
    likelihood = WindowedLikelihood(mass_properties(body.footprint), shooting_windows([motion], 1.0))
    return Target(prior.names, prior, likelihood, BodyParameters(mass=33.0)), motion


def test_polish_never_goes_down_and_ends_on_top(pushed: tuple[Target, Motion]) -> None:
    target, _ = pushed
    start = np.array([[40.0, -0.5, 0.2, 0.0, 0.3, 0.3, 0.0, 0.7, 1.5]])
    before = polish(target, start, iterations=0).point
    after = polish(target, start, iterations=15)
    assert after.point.log_density[0] > before.log_density[0] + 50.0
    best = after.point.position[0]
    for k in (0, 1, 2):
        step = np.zeros_like(best)
        step[k] = 1.5 * np.sqrt(after.covariance[0, k, k])
        nearby = np.stack([best - step, best + step])
        linear = after.point.linear.take(np.array([0, 0]))
        residuals = target.residuals(nearby, linear.nuisance)
        values = target.log_prior(nearby) + target.log_likelihood(nearby, residuals, linear)
        assert np.all(values < after.point.log_density[0] + 1e-6)


def test_modes_are_the_wheel_that_is_there(pushed: tuple[Target, Motion]) -> None:
    target, motion = pushed
    modes = find_modes(np.random.default_rng(0), target, [motion], SMALL)
    assert np.hypot(*(modes.point.position[0, 1:3] - [-0.65, 0.3])) < 0.04
    assert np.all(np.diff(modes.point.log_density) <= 0.0)
    again = find_modes(np.random.default_rng(0), target, [motion], SMALL)
    assert modes.point.position.tobytes() == again.point.position.tobytes()


def test_modes_are_different_wheels_not_descriptions_of_one(pushed: tuple[Target, Motion]) -> None:
    target, motion = pushed
    modes = find_modes(np.random.default_rng(0), target, [motion], SMALL)
    features = wheel_features(modes.point.position[:, :6], target.names)
    spread = wheel_features(target.prior.sample(np.random.default_rng(1), 2000), target.names).std(axis=0)
    for row in range(1, len(features)):
        assert np.all(np.any(np.abs(features[:row] - features[row]) > 0.1 * spread, axis=1))


def test_noise_of_a_mode_is_at_its_best(pushed: tuple[Target, Motion]) -> None:
    target, _ = pushed
    start = np.array([[33.0, -0.65, 0.3, 0.0, 0.2, 0.2, 0.0, 0.7, 1.5]])
    point = polish(target, start, iterations=3).point
    for column in (7, 8):
        for step in (-0.03, 0.03):
            moved = point.position.copy()
            moved[:, column] += step
            value = target.log_prior(moved) + target.log_likelihood(moved, point.residuals, point.linear)
            assert value[0] < point.log_density[0]


def test_distinct_keeps_the_best_of_each_place() -> None:
    position = np.array([[0.0, 0], [0.01, 0], [1.0, 0], [2.0, 0], [3.0, 0]])
    value = np.array([1.0, 2.0, 0.5, -np.inf, 0.1])
    np.testing.assert_array_equal(distinct(position, value, np.ones(2), 10), [1, 2, 4])
    np.testing.assert_array_equal(distinct(position, value, np.ones(2), 2), [1, 2])


def test_a_prior_that_allows_nothing_is_refused(pushed: tuple[Target, Motion]) -> None:
    target, motion = pushed

    class Nowhere(type(target.prior)):  # type: ignore[misc]
        def log_prob(self, theta: np.ndarray) -> np.ndarray:
            return np.full(len(theta), -np.inf)

    with pytest.raises(ModelError, match="finite density"):
        find_modes(np.random.default_rng(0), replace(target, prior=Nowhere(target.prior.parts)), [motion], SMALL)


def test_a_plan_without_its_stages_is_refused() -> None:
    with pytest.raises(ModelError, match="stages"):
        SearchPlan(lengths=(0.5,), keep=(3,), iterations=(3,))
