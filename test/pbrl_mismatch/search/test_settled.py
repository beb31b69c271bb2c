"""What is simulated again of a window that has settled, and of a point that has not moved: nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.climb import climb, settled
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines
from pbrl_mismatch.search.objective import Objective

FLOOR = 0.15
CASTERS = {"caster_roll": 0.02, "caster_scrub": 0.1, "caster_trail": 0.03}
LOAD = {"slosh_mass": 3.0, "slosh_frequency": 1.5, "slosh_damping": 0.1}


@pytest.fixture(scope="module")
def cuts(concealed_recording: Callable[..., Recording]) -> Cuts:
    return cut_windows(track_of(concealed_recording("floor_slope", 1), "table"), 2.0)


@pytest.fixture(scope="module")
def free() -> Hypothesis:
    return baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


@pytest.mark.parametrize("law", [{}, CASTERS, LOAD], ids=["nothing", "casters", "load"])
@pytest.mark.parametrize("parallel", [False, True])
def test_windows_that_are_asked_are_as_among_all(cuts: Cuts, free: Hypothesis, law: Any, parallel: bool) -> None:
    rows = free.rows(free.sample_prior(np.random.default_rng(1), 4))
    for name, value in law.items():
        rows[:, COLUMN[name]] = value
    asked = np.random.default_rng(2).uniform(size=(len(rows), len(cuts))) < 0.4
    asked[1] = False
    some = poses(rows, cuts, asked=asked, parallel=parallel)
    assert np.array_equal(some[asked], poses(rows, cuts)[asked])
    assert np.isnan(some[~asked]).all()


def test_which_are_asked_is_told_of_every_row_and_window(cuts: Cuts, free: Hypothesis) -> None:
    with pytest.raises(MismatchError, match="expected asked of shape"):
        poses(free.rows(free.mean[None]), cuts, asked=np.ones(len(cuts), dtype=np.bool_))


def test_what_has_settled_is_told_as_it_is_and_not_simulated_again(
    cuts: Cuts, free: Hypothesis, monkeypatch: pytest.MonkeyPatch
) -> None:
    objective, points = Objective(free, cuts, FLOOR), free.sample_prior(np.random.default_rng(3), 3)
    slopes = objective.linearise(points, objective.at_rest(3)).spread
    z, residual, misfit = settled(objective, points, objective.at_rest(3), slopes)
    assert np.array_equal(residual, objective.residual(points, z))
    assert np.array_equal(misfit, objective.misfit(residual, z))
    for _ in range(3):  # A window that gained in each of its rounds may have a little left to gain.
        z, residual, misfit = settled(objective, points, z, slopes, residual)
    monkeypatch.setattr(Objective, "residual", None)
    again = settled(objective, points, z, slopes, residual)
    assert all(np.array_equal(one, other) for one, other in zip(again, (z, residual, misfit), strict=True))


def test_a_climb_tells_of_where_it_ends_and_looks_no_further_from_a_top(
    cuts: Cuts, free: Hypothesis, monkeypatch: pytest.MonkeyPatch
) -> None:
    objective = Objective(free, cuts, FLOOR)
    top = climb(objective, free.mean[None], iterations=20)
    looked: list[int] = []
    linearise = Objective.linearise

    def counted(self: Objective, coordinates: Any, *rest: Any) -> Any:
        looked.append(len(coordinates))
        return linearise(self, coordinates, *rest)

    monkeypatch.setattr(Objective, "linearise", counted)
    both = np.concatenate([top.coordinates, free.mean[None]])
    begun = np.concatenate([top.nuisance, objective.at_rest(1)])
    for rough in (True, False):
        looked.clear()
        found = climb(objective, both, begun, iterations=6, rough=rough)
        assert min(looked[:-1]) == 1, "the one at the top is looked at no more"
        there = climb(objective, found.coordinates, found.nuisance, iterations=0)
        np.testing.assert_allclose(there.misfit, found.misfit, rtol=1e-12)
        assert rough or there.evidence == pytest.approx(found.evidence, abs=1e-6)
