"""Windows that no effect predicts alone are given up, and taken up again where several together predict them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.explain import Tried, with_sets
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, cut_stages, scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.weigh import weigh

OPTIONS = DiagnoseOptions()


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Track:
    return track_of(concealed_recording("floor_slope", 1), "table")


def fitted(track: Track, stages: Stages, effects: Sequence[str]) -> Fitted:
    """Return some effects on a free body, fitted to the longest windows."""
    found = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    scene = scene_of(track, found.rows(found.mean[None])[0])
    for name in effects:
        found = found.with_effect(EFFECTS[name], scene, 0)
    objective = Objective(found, stages.fitted[-1], OPTIONS.sensor_floor)
    return Fitted(found, alone(climb(objective, found.mean[None], iterations=8)), None)


def taken_up(track: Track, *effects: str) -> tuple[Tried, Tried | None]:
    """Return windows that were given up, and as they are taken up by a set that shorter ones have found."""
    longest = cut_stages(track, OPTIONS)
    shorter = longest.without_longest()
    given_up = Tried(longest, [fitted(track, longest, ())], [fitted(track, longest, effects[:1])])
    weighed = weigh([fitted(track, shorter, ())], [fitted(track, shorter, effects)], OPTIONS)
    return given_up, with_sets(given_up, weighed, None, OPTIONS)


def test_windows_are_taken_up_by_a_set_that_predicts_them(track: Track) -> None:
    given_up, found = taken_up(track, "viscous_drag", "floor_slope")
    assert found is not None and found.stages is given_up.stages and found.bases is given_up.bases
    part, both = found.tried
    assert part.hypothesis.effects == ("viscous_drag",) and both.hypothesis.effects == ("viscous_drag", "floor_slope")
    assert both.peak.objective.cuts is given_up.stages.fitted[-1]
    # An effect alone is held against the set after as many hops.
    assert both.evidence > part.evidence + 50.0 and part.evidence >= given_up.tried[0].evidence


def test_windows_that_no_set_predicts_stay_given_up(track: Track) -> None:
    _, found = taken_up(track, "viscous_drag", "payload_change")
    assert found is None
