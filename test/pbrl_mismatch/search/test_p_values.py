"""P-values that are joined stay as even as they were, or are too high."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from pbrl_mismatch.search.p_values import UNBELIEVABLE, least_of_two, unless_unbelievable, with_library


def test_a_law_that_is_known_lowers_the_p_value_and_never_by_more_than_its_odds_allow() -> None:
    assert with_library(0.5, -math.inf) == pytest.approx(0.525)
    assert with_library(0.5, 20.0) == pytest.approx(11.0 * math.exp(-20.0))
    assert with_library(1e-9, 3.0) == pytest.approx(1.1e-9)
    assert with_library(1.0, 0.0) == 1.0
    assert with_library(0.3, 1e4) == 0.0
    # By Markov's inequality odds beyond 1 / a have a chance of a at most: both ways together keep the level.
    rng = np.random.default_rng(0)
    shift = rng.standard_normal(20_000)
    odds = shift * 3.0 - 4.5  # of a law at three standard deviations, where there is none
    values = np.array([with_library(p, o) for p, o in zip(rng.random(20_000), odds, strict=True)])
    for level in (0.01, 0.05, 0.2):
        assert np.mean(values < level) < level
    # Where the library has nothing to say, p-values stay as even as they were.
    assert all(abs(with_library(p, -math.inf) - p) < 1 / 39 for p in np.linspace(0.0, 1.0, 50))


def test_of_two_tests_the_lesser_p_value_is_as_uniform_as_each() -> None:
    one, other = np.random.default_rng(1).random((2, 4000))
    values = [least_of_two(a, b) for a, b in zip(one, other, strict=True)]
    assert kstest(values, "uniform").pvalue > 0.01


def test_what_is_believed_counts_only_where_it_is_unbelievable() -> None:
    assert unless_unbelievable(0.3, 2.0 * UNBELIEVABLE) == 0.3
    assert unless_unbelievable(0.3, 0.5 * UNBELIEVABLE) == 0.5 * UNBELIEVABLE
    assert unless_unbelievable(1e-9, 0.5 * UNBELIEVABLE) == 1e-9
    # Of what is believed three times as wide as it is there is no alarm more.
    rng = np.random.default_rng(2)
    conflicts = chi2.sf(np.sum((rng.standard_normal((4000, 4)) / 3.0) ** 2, axis=1), 4)
    values = [unless_unbelievable(p, c) for p, c in zip(rng.random(4000), conflicts, strict=True)]
    assert kstest(values, "uniform").pvalue > 0.01
