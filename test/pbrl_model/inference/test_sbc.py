"""Ranks of a right inference pass; posteriors that are too narrow, too wide or biased are caught; few say nothing."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.inference.sbc import Ranks, judge, least_tail, rank_among

DRAWS = 99


def normal_trials(rng: np.random.Generator, width: float, shift: float, trials: int = 200) -> Ranks:
    """Truth from N(0, 1), one observation with unit noise: the posterior is N(y / 2, 1 / 2), or is made another."""
    truth = rng.normal(size=trials)
    middle = 0.5 * (truth + rng.normal(size=trials)) + shift
    draws = middle[:, None] + width * np.sqrt(0.5) * rng.normal(size=(trials, DRAWS))
    rank = np.array([rank_among(rng, one[None], many[:, None]) for one, many in zip(truth, draws, strict=True)])
    return Ranks(("x",), rank, DRAWS)


@pytest.mark.parametrize(("width", "shift", "right"), [(1, 0, True), (0.7, 0, False), (1.5, 0, False), (1, 0.3, False)])
def test_what_is_wrong_is_caught_and_what_is_right_is_not(width: float, shift: float, right: bool) -> None:
    rng = np.random.default_rng(11)
    assert (judge(normal_trials(rng, width, shift), rng)["x"].p > 0.01) is right


def test_p_values_of_a_right_inference_are_not_small_more_often_than_they_say() -> None:
    rng = np.random.default_rng(1)
    small = 0
    for _ in range(40):
        ranks = Ranks(("x",), rng.integers(0, DRAWS + 1, size=(60, 1)), DRAWS)
        small += judge(ranks, rng)["x"].p < 0.1
    assert small <= 10


def test_spread_tells_too_narrow_from_too_wide() -> None:
    rng = np.random.default_rng(2)
    narrow, wide = (judge(normal_trials(rng, width, 0.0), rng)["x"].spread for width in (0.6, 1.8))
    assert narrow > 1.1 > 0.9 > wide


def test_too_few_trials_say_nothing() -> None:
    rng = np.random.default_rng(3)
    assert np.isnan(judge(normal_trials(rng, 0.1, 5.0, trials=10), rng)["x"].p)


def test_ties_are_broken_evenly() -> None:
    rng = np.random.default_rng(4)
    found = [rank_among(rng, np.zeros(1), np.zeros((9, 1)))[0] for _ in range(2000)]
    assert np.bincount(found, minlength=10).min() > 140


def test_bins_divide_the_ranks_evenly_and_hold_every_trial() -> None:
    ranks = normal_trials(np.random.default_rng(5), 1.0, 0.0)
    assert (ranks.draws + 1) % ranks.bins == 0 and 200 / ranks.bins >= 8
    assert ranks.histogram().sum() == 200


def test_ranks_in_order_are_as_even_as_can_be() -> None:
    even = np.arange(100)[None]
    bunched = np.concatenate([np.zeros(50, dtype=int), np.full(50, 99)])[None]
    assert least_tail(even, DRAWS)[0] > 0.5 > 1e-6 > least_tail(bunched, DRAWS)[0]


@pytest.mark.parametrize("rank", [np.zeros((3, 2), dtype=int), np.full((3, 1), 100), np.full((3, 1), -1)])
def test_ranks_that_cannot_be_are_refused(rank: np.ndarray) -> None:
    with pytest.raises(ModelError, match="ranks: expected"):
        Ranks(("x",), rank, DRAWS)
