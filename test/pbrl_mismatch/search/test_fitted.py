"""What a fitted hypothesis tells of what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, alone, tops
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective, scattered
from pbrl_mismatch.search.path.climb import climb_along, likelihood
from pbrl_mismatch.search.path.ground import traced


def test_what_is_unexplained_is_what_its_likelihood_lacks_to_that_of_noise(
    concealed_recording: Callable[..., Recording],
) -> None:
    track = track_of(concealed_recording("floor_slope", 1), "table")
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    objective = Objective(free, cut_windows(track, 2.0), 0.15)
    level = Fitted(free, climb(objective, free.mean[None], iterations=4), None)
    # A window that is explained down to the noise has no more misfit than numbers; below, its likelihood is as it is.
    noise = np.minimum(level.peak.misfit, objective.counts)
    lacks = objective.likelihood(noise) - objective.likelihood(level.peak.misfit)
    by_chance = sum(scattered(count) for count in objective.counts)
    assert level.unexplained == pytest.approx(float(lacks[0]) - by_chance, rel=1e-9)
    assert level.unexplained > 100.0
    # So it is along a path, where windows have scales of their own as well.
    found = traced(free, free.mean[None], objective.cuts, 0.15)
    misfit = climb_along(found.along, free, found.coordinates[None], 0).misfit
    along = likelihood(found.along, np.minimum(misfit, found.along.counts)) - likelihood(found.along, misfit)
    assert replace(level, traced=found).unexplained == pytest.approx(min(along[0], lacks[0]) - by_chance, rel=1e-9)


@pytest.mark.parametrize("count", [12.0, 60.0, 123.0])
def test_windows_of_noise_alone_cost_what_is_taken_off(count: float) -> None:
    misfit = np.random.default_rng(0).chisquare(count, 200_000)
    cost = 0.5 * count * np.log(np.maximum(misfit / count, 1.0))
    assert scattered(count) == pytest.approx(cost.mean(), abs=4.0 * cost.std() / math.sqrt(len(cost)))


def test_of_a_climb_a_law_that_ran_away_is_the_last(concealed_recording: Callable[..., Recording]) -> None:
    track = track_of(concealed_recording("floor_slope", 1), "table")
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    starts = free.mean + free.spread * np.array([0.0, 0.5, -0.5])[:, None]
    peak = climb(Objective(free, cut_windows(track, 2.0), 0.15), starts, iterations=1)
    peak = replace(peak, evidence=np.array([math.nan, -2.0, -1.0]))
    assert peak.ranked.tolist() == [2, 1, 0]
    assert alone(peak).evidence.tolist() == [-1.0]
    np.testing.assert_array_equal(tops(peak, 2), peak.coordinates[[2, 1]])
