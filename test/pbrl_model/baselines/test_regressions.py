"""Laws that every baseline obeys, and what each does beyond: linear, local, object-oriented."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.baselines.linear import LinearRegression, LinearRegressor
from pbrl_model.baselines.local import BANDWIDTHS, LocallyWeightedRegression, LocalRegressor
from pbrl_model.baselines.object_oriented import ObjectOrientedRegression
from pbrl_model.baselines.sectors import ContactSectors
from pbrl_model.errors import ModelError
from pbrl_model.transitions.data import Transitions, turn

Array = NDArray[np.float64]
Maker = Callable[[int, int], Transitions]

BOX = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])


def baselines() -> list[LinearRegression | LocallyWeightedRegression | ObjectOrientedRegression]:
    return [
        LinearRegression(),
        LocallyWeightedRegression(bandwidth=200.0),
        LocallyWeightedRegression(bandwidth=None),
        ObjectOrientedRegression(ContactSectors([BOX, BOX]), bandwidth=200.0),
    ]


def asked(transitions: Transitions) -> tuple[Array, Array, Array, Array]:
    return transitions.state, transitions.target, transitions.wrench, transitions.duration


@pytest.mark.parametrize("number", range(4))
def test_free_bodies_are_learned_exactly(make_free: Maker, number: int) -> None:
    test = make_free(1, 40)
    model = baselines()[number].fit(make_free(0, 200))
    np.testing.assert_allclose(model.predict(*asked(test)), test.next_state, atol=0.02)


@pytest.mark.parametrize("number", range(3))
def test_predictions_move_with_the_world(make_free: Maker, number: int) -> None:
    train, test = make_free(0, 30), make_free(1, 10)
    model = baselines()[number].fit(train)
    angle, shift = 1.1, np.array([3.0, -2.0])

    def moved(state: Array) -> Array:
        flat = state.reshape(-1, 6)
        turns = np.full(len(flat), angle)
        place, velocity = turn(flat[:, :2], turns) + shift, turn(flat[:, 3:5], turns)
        return np.column_stack([place, flat[:, 2] + angle, velocity, flat[:, 5]]).reshape(state.shape)

    pushed = np.column_stack([turn(test.wrench[:, :2], np.full(10, angle)), test.wrench[:, 2]])
    there = model.predict(moved(test.state), test.target, pushed, test.duration)
    np.testing.assert_allclose(there, moved(model.predict(*asked(test))), atol=1e-9)


@pytest.mark.parametrize("number", range(4))
def test_many_queries_at_once_are_the_queries_one_by_one(make_free: Maker, number: int) -> None:
    test = make_free(1, 5)
    model = baselines()[number].fit(make_free(0, 30))
    together = model.predict(*asked(test))
    alone = [model.predict(*asked(test[[row]]))[0] for row in range(5)]
    np.testing.assert_allclose(together, alone, atol=1e-10)


@pytest.mark.parametrize("number", range(4))
def test_what_cannot_be_learned_or_asked_is_refused(make_free: Maker, number: int) -> None:
    model, some = baselines()[number], make_free(0, 5)
    with pytest.raises(ModelError, match="call fit first"):
        model.predict(*asked(some))
    with pytest.raises(ModelError, match="at least one transition"):
        model.fit(some[:0])
    model.fit(some)
    with pytest.raises(ModelError, match="bodies"):
        model.predict(some.state[:, :1], 0, some.wrench, some.duration)
    with pytest.raises(ModelError, match="finite"):
        model.predict(some.state * np.nan, some.target, some.wrench, some.duration)


@pytest.mark.parametrize("number", range(4))
def test_one_transition_is_enough_for_an_answer_that_is_finite(make_free: Maker, number: int) -> None:
    one = make_free(0, 1)
    model = baselines()[number].fit(one)
    np.testing.assert_allclose(model.predict(*asked(one)), one.next_state, atol=1e-9)
    assert np.isfinite(model.predict(*asked(make_free(1, 3)))).all()


def test_linear_regression_is_least_squares() -> None:
    rng = np.random.default_rng(4)
    features, outputs, queries = rng.normal(size=(30, 7)), rng.normal(size=(30, 6)), rng.normal(size=(5, 7))
    design = np.column_stack([np.ones(30), features])
    expected = np.column_stack([np.ones(5), queries]) @ np.linalg.pinv(design) @ outputs
    np.testing.assert_allclose(LinearRegressor().fit(features, outputs).predict(queries), expected, atol=1e-10)


def test_the_widest_kernel_is_linear_regression() -> None:
    rng = np.random.default_rng(5)
    features, outputs, queries = rng.normal(size=(60, 7)), rng.normal(size=(60, 6)), rng.normal(size=(9, 7))
    wide = LocalRegressor(bandwidth=1e9).fit(features, outputs).predict(queries)
    np.testing.assert_allclose(wide, LinearRegressor().fit(features, outputs).predict(queries), atol=2e-3)


def test_a_narrow_kernel_follows_what_a_line_cannot() -> None:
    rng = np.random.default_rng(6)
    features = np.zeros((400, 7))
    features[:, 0] = rng.uniform(-2.0, 2.0, 400)
    outputs = np.abs(features[:, :1]) * np.ones(6)
    learned = LocalRegressor(bandwidth=None).fit(features, outputs)
    assert learned.bandwidth == BANDWIDTHS[0]
    assert np.abs(learned.predict(features) - outputs).max() < 0.25
    assert np.abs(LinearRegressor().fit(features, outputs).predict(features) - outputs).max() > 0.5


def test_only_the_nearest_neighbours_count() -> None:
    rng = np.random.default_rng(7)
    near, far = rng.normal(size=(20, 7)), rng.normal(size=(20, 7)) + 100.0
    features, outputs = np.concatenate([near, far]), np.concatenate([np.zeros((20, 6)), np.ones((20, 6))])
    query = near[:3] + 0.1
    assert np.abs(LocalRegressor(20, 1e6).fit(features, outputs).predict(query)).max() < 1e-12
    assert np.abs(LocalRegressor(40, 1e6).fit(features, outputs).predict(query)).max() > 1e-6


@pytest.mark.parametrize("options", [(0, 1.5), (10, 0.0), (10, -1.0), (10, float("nan"))])
def test_bad_options_are_refused_before_any_data(options: tuple[int, float]) -> None:
    with pytest.raises(ModelError, match="LWR"):
        LocallyWeightedRegression(*options)


def walled(seed: int, n: int) -> Transitions:
    """Return pushes of a box along x, at rest, that a wall at x = 1 stops where its front is closer than 0.1 m."""
    rng = np.random.default_rng(seed)
    state = np.zeros((n, 1, 6))
    state[:, 0, 0] = np.where(rng.random(n) < 0.5, rng.uniform(-1.0, 0.4, n), rng.uniform(0.6, 0.7, n))
    wrench = np.column_stack([rng.uniform(-5.0, 5.0, n), np.zeros((n, 2))])
    stopped = (state[:, 0, 0] > 0.5) & (wrench[:, 0] > 0.0)
    after = state.copy()
    after[:, 0, 0] += np.where(stopped, 0.0, 0.01 * wrench[:, 0])
    return Transitions(state, np.zeros(n, dtype=int), wrench, np.ones(n), after)


def test_conditions_learn_a_wall_that_pose_invariance_cannot_see() -> None:
    sectors = ContactSectors([BOX], [[[1.0, -5.0], [1.0, 5.0]]], radius=0.15)
    train, test = walled(0, 300), walled(1, 100)
    oo = ObjectOrientedRegression(sectors, bandwidth=None).fit(train)
    lwr = LocallyWeightedRegression(bandwidth=None).fit(train)
    assert oo.conditions == 2
    errors = [np.abs(model.predict(*asked(test)) - test.next_state).sum() for model in (oo, lwr)]
    assert errors[0] < 0.2 * errors[1]


def test_a_condition_never_seen_is_told_and_predicted_as_if_there_were_none() -> None:
    sectors = ContactSectors([BOX], [[[1.0, -5.0], [1.0, 5.0]]], radius=0.15)
    train, test = walled(0, 300), walled(1, 50)
    away = train[train.state[:, 0, 0] < 0.5]
    oo, lwr = ObjectOrientedRegression(sectors).fit(away), LocallyWeightedRegression().fit(away)
    touching = test.state[:, 0, 0] > 0.5
    np.testing.assert_array_equal(oo.seen(test.state), ~touching)
    np.testing.assert_array_equal(oo.predict(*asked(test)), lwr.predict(*asked(test)))


def test_learning_on_is_learning_all_at_once() -> None:
    sectors = ContactSectors([BOX], [[[1.0, -5.0], [1.0, 5.0]]], radius=0.15)
    train, test = walled(0, 60), walled(1, 20)
    on = ObjectOrientedRegression(sectors).fit(train[:25]).extend(train[25:26]).extend(train[26:])
    np.testing.assert_array_equal(
        on.predict(*asked(test)), ObjectOrientedRegression(sectors).fit(train).predict(*asked(test))
    )
