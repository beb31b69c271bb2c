"""Basin hopping: where climbs end apart, hops end together; what predicts its windows is left as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, alone, scene_of
from pbrl_mismatch.search.hops import REACHED, hopped
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective

OPTIONS = DiagnoseOptions()


@pytest.fixture(scope="module")
def ends(concealed_recording: Callable[..., Recording]) -> Any:
    """Return two climbs towards a concealed patch, from beside it, the windows, and where hops end from each."""
    track = track_of(concealed_recording("floor_patch", 1), "table")
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    patch = free.with_effect(EFFECTS["floor_patch"], scene_of(track, free.rows(free.mean[None])[0]), 0)
    patch = patch.fixed(("patch_roll",))  # there is no wheel that it could hold
    cuts, rng = cut_windows(track, 2.0), np.random.default_rng(0)
    objective = Objective(patch, cuts, OPTIONS.sensor_floor)
    beside = patch.mean + 0.3 * patch.spread * rng.standard_normal((2, len(patch.mean)))
    climbed = [Fitted(patch, alone(climb(objective, each[None], iterations=8)), None) for each in beside]
    return climbed, cuts, [hopped([each], cuts, OPTIONS)[0] for each in climbed]


def test_hops_from_where_climbs_end_apart_end_together(ends: Any) -> None:
    before, _, after = ends
    assert min(each.noise_scale for each in before) > 10.0  # neither has found it
    assert max(each.noise_scale for each in after) < REACHED
    assert abs(np.diff([each.evidence for each in after])) < 0.1 * abs(np.diff([each.evidence for each in before]))


def test_the_same_seed_hops_the_same_way_on_any_number_of_workers(ends: Any) -> None:
    (first, _), cuts, (after, _) = ends
    (again,) = hopped([first], cuts, OPTIONS.model_copy(update={"workers": 2}))
    assert again.peak.coordinates.tobytes() == after.peak.coordinates.tobytes()
    assert again.evidence == after.evidence >= first.evidence


def test_what_predicts_its_windows_is_left_as_it_is(ends: Any) -> None:
    (first, _), cuts, _ = ends
    explained = replace(first, peak=replace(first.peak, misfit=np.zeros_like(first.peak.misfit)))
    assert explained.noise_scale == 1.0
    assert hopped([explained], cuts, OPTIONS)[0] is explained


def test_what_is_too_far_behind_hops_no_more(ends: Any) -> None:
    (first, _), cuts, (after, _) = ends
    (behind,) = hopped([first], cuts, OPTIONS, ahead=1e6)
    assert first.evidence < behind.evidence < after.evidence
