"""What a climb simulates: each window's nuisances as long as they gain, and nothing twice where nothing has moved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.search.climb import PROMISED, TRIALS, climb, settled
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import NUISANCES, Linear, Objective, nuisance_step


@pytest.fixture(scope="module")
def objective(concealed_recording: Callable[..., Recording]) -> Objective:
    """Return a table with a wheel, over windows of a recording of one without."""
    track = track_of(concealed_recording("clean", 1), "table")
    wheel = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    return Objective(wheel, cut_windows(track, 1.0), 0.15)


@pytest.fixture(scope="module")
def points(objective: Objective) -> Any:
    """Return coordinates and nuisances that are off."""
    rng = np.random.default_rng(0)
    draws = objective.hypothesis.believable(objective.hypothesis.sample_prior(rng, 3))
    return draws, 0.3 * rng.standard_normal((3, len(objective.cuts), NUISANCES))


def test_windows_that_are_asked_are_the_same_bytes_as_among_all(objective: Objective, points: Any) -> None:
    asked = np.random.default_rng(1).random((3, len(objective.cuts))) < 0.3
    asked[1] = False
    assert np.array_equal(objective.residual_of(asked, *points), objective.residual(*points)[asked])


def test_settled_windows_are_where_the_residuals_say_and_never_worse(objective: Objective, points: Any) -> None:
    spread = objective.linearise(*points).spread
    before, held = objective.misfit(objective.residual(*points), points[1]), points[1].copy()
    z, residual, misfit = settled(objective, *points, spread)
    assert np.array_equal(points[1], held), "what was given stays as it was"
    assert np.array_equal(residual, objective.residual(points[0], z))
    assert misfit == pytest.approx(objective.misfit(residual, z))
    assert np.all(misfit <= before + 1e-9) and misfit.sum() < before.sum()


def test_slopes_of_one_point_may_stand_for_all_and_where_all_is_nearly_linear_nothing_is_left_to_gain(
    objective: Objective,
) -> None:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    rolling, u = replace(objective, hypothesis=free), np.repeat(free.mean[None], 3, axis=0)
    z = 0.3 * np.random.default_rng(3).standard_normal((3, len(objective.cuts), NUISANCES))
    spread = rolling.linearise(u[:1], z[:1]).spread
    z, residual, misfit = settled(rolling, u, z, spread)
    _, _, again = settled(rolling, u, z, rolling.linearise(u, z).spread, residual)
    assert np.all(misfit - again < 0.05)


def test_a_step_of_nuisances_promises_what_a_linear_model_would_gain() -> None:
    rng = np.random.default_rng(2)
    spread, residual, z = (rng.standard_normal(shape) for shape in ((5, 40, NUISANCES), (5, 40), (5, NUISANCES)))
    step, promised = nuisance_step(spread, residual, z)
    before = np.sum(residual**2, axis=1) + np.sum(z**2, axis=1)
    after = np.sum((residual - (spread @ step[..., None])[..., 0]) ** 2, axis=1) + np.sum((z + step) ** 2, axis=1)
    assert before - after == pytest.approx(promised)
    assert np.all(promised > PROMISED)


class Walled(Objective):
    """What no step improves: every residual but the first point's is larger."""

    def __init__(self, of: Objective) -> None:
        super().__init__(of.hypothesis, of.cuts, of.floor)
        object.__setattr__(self, "asked", [])
        object.__setattr__(self, "here", of.hypothesis.mean)

    def residual(self, coordinates: Any, nuisance: Any) -> Any:
        off = np.any(coordinates != self.here, axis=1)  # type: ignore[attr-defined]
        return np.where(off, 9.0, 1.0)[:, None, None] * np.ones((len(off), len(self.cuts), self.cuts.weight[0].size))

    def linearise(self, coordinates: Any, nuisance: Any, spread: Any = None) -> Linear:
        self.asked.append(len(coordinates))  # type: ignore[attr-defined]
        here = self.residual(coordinates, nuisance)
        return Linear(here, np.ones((*here.shape, coordinates.shape[1])), np.zeros((*here.shape, NUISANCES)))


def test_where_no_step_gains_shorter_ones_are_tried_without_another_linearisation(objective: Objective) -> None:
    walled = Walled(objective)
    peak = climb(walled, walled.hypothesis.mean[None], iterations=6)
    assert np.array_equal(peak.coordinates[0], walled.hypothesis.mean)
    assert walled.asked == [1, 1], f"at the start and for the evidence, not after {TRIALS} steps that failed"
