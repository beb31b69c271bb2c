"""Figures 24 and 26: the score, the count of observations, the rows that judge them, and that figures are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_bringup.experiments import noise, sample_efficiency
from pbrl_bringup.experiments.accuracy import learn_linear, r_squared, training_and_test
from pbrl_bringup.experiments.figures import save
from pbrl_bringup.experiments.household import load_household
from pbrl_bringup.experiments.sample_efficiency import GOAL, JUDGED, MOST, NEVER, observations_needed
from pbrl_model.transitions.data import BodyTransitions, displaced

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def couch() -> tuple[BodyTransitions, BodyTransitions]:
    return training_and_test(np.random.default_rng(0), load_household()["couch"], 52, 0.005)


def test_the_truth_scores_one_and_the_mean_zero(couch: tuple[BodyTransitions, BodyTransitions]) -> None:
    test = couch[1]
    np.testing.assert_allclose(r_squared(test, test.end), 1.0)
    mean = np.broadcast_to(test.displacements.mean(axis=0), (len(test), 6))
    np.testing.assert_allclose(r_squared(test, displaced(test.start, mean)), 0.0, atol=1e-12)


def test_a_whole_turn_too_many_is_no_error(couch: tuple[BodyTransitions, BodyTransitions]) -> None:
    test = couch[1]
    turned = test.end + np.array([0.0, 0.0, 2.0 * np.pi, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(r_squared(test, turned), 1.0)


def test_linear_regression_reaches_the_goal_for_a_free_object(couch: tuple[BodyTransitions, BodyTransitions]) -> None:
    assert 7 < observations_needed(learn_linear, *couch) <= 30


@pytest.mark.parametrize(("good", "needed"), [({3, 4, 5}, 3), ({1, 2, 7, 8, 9}, 7), ({1, 3, 5}, NEVER)])
def test_needed_is_the_first_of_three_in_a_row(
    couch: tuple[BodyTransitions, BodyTransitions], good: set[int], needed: int
) -> None:
    def learn(seen: BodyTransitions) -> sample_efficiency.Predict:
        return lambda asked: asked.end if len(seen) in good else asked.start

    assert observations_needed(learn, *couch) == needed


def table(physics: float) -> Array:
    """Return what was needed (10, 4, 3): PBR, LWR, LR."""
    return np.broadcast_to(np.array([physics, 12.0, 13.0]), (10, 4, 3)).copy()


def test_rows_hold_only_where_the_numbers_do() -> None:
    good, slow, missed = table(3.0), table(11.0), table(3.0)
    missed[4, 1, 0] = NEVER
    assert [row.holds for row in sample_efficiency._rows({JUDGED: good})] == [True, True, True]
    assert [row.holds for row in sample_efficiency._rows({JUDGED: slow})] == [True, False, True]
    rows = sample_efficiency._rows({JUDGED: missed})
    assert [row.holds for row in rows] == [False, True, False]
    assert rows[0].value == 9
    assert rows[2].value == 1


def test_curves_are_judged_at_every_point() -> None:
    scores = np.broadcast_to(np.array([0.9, 0.8, 0.7])[None, :, None], (4, 3, 5)).copy()
    assert noise._rows(scores, "points")[0].holds
    scores[2, 1] = 0.95
    row = noise._rows(scores, "points")[0]
    assert not row.holds
    assert row.value == 0.75


def test_figures_are_drawn_and_are_the_same_bytes_again(tmp_path: Path) -> None:
    needed = table(3.0)
    needed[4, :, 1:] = NEVER
    names = list(load_household())
    scores = np.random.default_rng(0).uniform(0.5, 1.0, (3, 3, 5))
    drawn = [
        save(figure, tmp_path).read_bytes()
        for figure in (
            sample_efficiency._figure(names, needed),
            sample_efficiency._figure(names, needed),
            noise._figure((1, 10, 50), scores, (0.0, 0.5, 1.0), scores),
        )
    ]
    assert drawn[0] == drawn[1]
    assert drawn[2].startswith(b"\x89PNG")


def test_a_trial_is_the_same_again_and_within_the_goal() -> None:
    first = sample_efficiency.trial(5, JUDGED, "bed", 0)
    assert first == sample_efficiency.trial(5, JUDGED, "bed", 0)
    assert first[0] <= min(first[1:])
    assert first[0] <= 10
    assert GOAL == 0.995
    assert NEVER == MOST + 1
