"""Laws of transitions: round trips, invariance to pose, and one-line refusals of what cannot be one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.transitions.data import (
    Transitions,
    body_features,
    concatenate,
    displaced,
    displacements,
    observed,
    turn,
)

Array = NDArray[np.float64]


def some(n: int = 7, bodies: int = 3, seed: int = 0) -> Transitions:
    rng = np.random.default_rng(seed)
    return Transitions(
        rng.normal(size=(n, bodies, 6)),
        rng.integers(0, bodies, n),
        rng.normal(size=(n, 3)),
        rng.uniform(0.1, 0.5, n),
        rng.normal(size=(n, bodies, 6)),
    )


def test_displaced_undoes_displacements() -> None:
    rng = np.random.default_rng(1)
    start = rng.normal(size=(50, 6))
    end = start + rng.uniform(-3.0, 3.0, (50, 6))
    np.testing.assert_allclose(displaced(start, displacements(start, end)), end, atol=1e-12)


def test_displacements_and_features_do_not_change_when_the_world_is_moved() -> None:
    rng = np.random.default_rng(2)
    start, end = rng.normal(size=(2, 20, 6))
    wrench = rng.normal(size=(20, 3))
    angle, shift = np.full(20, 2.3), np.array([4.0, -7.0])

    def moved(state: Array) -> Array:
        place, velocity = turn(state[:, :2], angle) + shift, turn(state[:, 3:5], angle)
        return np.column_stack([place, state[:, 2] + angle, velocity, state[:, 5]])

    pushed = np.column_stack([turn(wrench[:, :2], angle), wrench[:, 2]])
    np.testing.assert_allclose(displacements(moved(start), moved(end)), displacements(start, end), atol=1e-12)
    np.testing.assert_allclose(
        body_features(moved(start), pushed, np.ones(20)), body_features(start, wrench, np.ones(20)), atol=1e-12
    )


def test_a_turn_is_told_the_short_way_round() -> None:
    start, end = np.zeros((1, 6)), np.array([[0.0, 0.0, 2.0 * np.pi + 0.1, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(displacements(start, end)[0, 2], 0.1)


def test_slices_join_to_the_whole() -> None:
    whole = some()
    joined = concatenate([whole[:3], whole[[3, 4]], whole[np.arange(7) > 4]])
    for name in ("state", "target", "wrench", "duration", "next_state"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))


def test_a_body_feels_only_wrenches_of_its_own() -> None:
    whole = some()
    for index in range(3):
        part = whole.body(index)
        mine = whole.target == index
        np.testing.assert_array_equal(part.wrench[mine], whole.wrench[mine])
        assert not part.wrench[~mine].any()


def test_a_body_left_at_rest_says_nothing() -> None:
    state = np.zeros((2, 2, 6))
    after = state.copy()
    after[:, 0, 0] = 0.1
    seen = Transitions(state, np.array([0, 0]), np.ones((2, 3)), np.ones(2), after)
    assert len(seen.body(0).informative()) == 2
    assert len(seen.body(1).informative()) == 0


def test_noise_has_the_deviation_asked_for_and_angles_the_lever() -> None:
    zeros = np.zeros((20_000, 1, 6))
    clean = Transitions(zeros, np.zeros(20_000, dtype=int), np.zeros((20_000, 3)), np.ones(20_000), zeros)
    noisy = observed(np.random.default_rng(3), clean, 0.02, [0.5])
    np.testing.assert_allclose(noisy.next_state[:, 0].std(axis=0), [0.02, 0.02, 0.04, 0.02, 0.02, 0.04], rtol=0.03)
    assert not noisy.state.any()
    assert observed(np.random.default_rng(3), clean, 0.02, [0.5], of_start=True).state.any()


def test_none_at_all_is_legal() -> None:
    assert (
        len(Transitions(np.zeros((0, 2, 6)), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2, 6)))) == 0
    )


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("state", np.zeros((7, 6)), "shape"),
        ("state", np.full((7, 3, 6), np.nan), "finite state"),
        ("target", np.full(7, 3), "target in 0..2"),
        ("target", np.full(7, -1), "target in 0..2"),
        ("target", np.full(7, 0.5), "whole numbers"),
        ("wrench", np.zeros((7, 2)), "wrench of shape"),
        ("wrench", np.full((7, 3), np.inf), "finite wrench"),
        ("duration", np.zeros(7), "above zero"),
        ("duration", np.ones(6), "duration of shape"),
        ("next_state", np.zeros((6, 3, 6)), "next_state of shape"),
    ],
)
def test_what_cannot_be_a_transition_is_refused_in_one_line(field: str, value: Array, said: str) -> None:
    whole = some()
    values = {name: getattr(whole, name) for name in ("state", "target", "wrench", "duration", "next_state")}
    with pytest.raises(ModelError, match=said) as caught:
        Transitions(**(values | {field: value}))
    assert "\n" not in str(caught.value)


def test_other_bad_input_is_refused() -> None:
    with pytest.raises(ModelError, match="no parts"):
        concatenate([])
    with pytest.raises(ModelError, match="one number of bodies"):
        concatenate([some(bodies=2), some(bodies=3)])
    with pytest.raises(ModelError, match=r"index in 0\.\.2"):
        some().body(3)
    with pytest.raises(ModelError, match="at least zero"):
        observed(np.random.default_rng(0), some(), -1.0, [1.0, 1.0, 1.0])
    with pytest.raises(ModelError, match="levers above zero"):
        observed(np.random.default_rng(0), some(), 1.0, [1.0, 0.0, 1.0])
