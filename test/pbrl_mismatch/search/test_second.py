"""A wheel is parted in two where one does not explain all, and only there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, DiagnoseOptions, track_of
from pbrl_mismatch.search.fitted import Fitted, cut_stages, fit_baseline, scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.second import KEPT, is_another, parted_starts

OPTIONS = DiagnoseOptions()


def fitted(recording: Recording, kind: str) -> tuple[Any, Any, Fitted]:
    track = track_of(recording, "table")
    stages = cut_stages(track, OPTIONS)
    outline = np.array([0.6, 0.35])
    one = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), [kind], np.zeros(2), outline, None)[0]
    return track, stages, fit_baseline(np.random.default_rng(0), track, one, stages, OPTIONS)


@pytest.mark.parametrize(("concealed", "parted"), [("clean", False), ("second_wheel", True)])
def test_a_wheel_is_parted_where_it_does_not_explain_all(
    concealed_recording: Callable[..., Recording], concealed: str, parted: bool
) -> None:
    track, stages, base = fitted(concealed_recording(concealed, 2), "caster")
    assert is_another("second_wheel", base) and not is_another("tether", base)
    two = base.hypothesis.with_effect(EFFECTS["second_wheel"], scene_of(track, base.row), 0)
    starts = parted_starts(np.random.default_rng(0), two, base, stages.fitted[0], OPTIONS)
    again = parted_starts(np.random.default_rng(0), two, base, stages.fitted[0], OPTIONS)
    assert np.array_equal(starts, again)
    assert starts.shape[1] == len(two.columns) and bool(len(starts)) == parted and len(starts) <= KEPT
    assert np.array_equal(starts, two.believable(starts))
