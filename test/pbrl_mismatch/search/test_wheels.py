"""A wheel begins anew: parted in two where one does not explain all, and anywhere beside a pin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, DiagnoseOptions, track_of
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, cut_stages, fit_baseline, scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.pins import fixed_place
from pbrl_mismatch.search.wheels import KEPT, holds_as_pin, is_another, parted_starts, pinned_starts

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


def test_beside_a_pin_the_wheel_begins_anywhere_whatever_it_was_taken_for(
    concealed_recording: Callable[..., Recording],
) -> None:
    track, stages, base = fitted(concealed_recording("hidden_hinge", 2), "caster")
    place, _ = fixed_place(track)
    assert holds_as_pin("hidden_hinge", base, track) and not holds_as_pin("tether", base, track)
    pinned = base.hypothesis.with_effect(EFFECTS["hidden_hinge"], scene_of(track, base.row), 0)
    # A wheel that stands where the pin is, and holds: what a baseline makes of a pin.
    elsewhere = base.peak.coordinates.copy()
    elsewhere[:, base.hypothesis.columns.index("wheel_x")] += 0.5
    elsewhere[:, base.hypothesis.columns.index("mass")] += 2.0
    taken = replace(base, peak=replace(base.peak, coordinates=elsewhere))
    starts = [
        pinned_starts(np.random.default_rng(0), pinned, each, stages.fitted[0], OPTIONS) for each in (base, taken)
    ]
    assert np.array_equal(*starts)
    assert 0 < len(starts[0]) <= KEPT and np.array_equal(starts[0], pinned.believable(starts[0]))
    pin = [pinned.columns.index(column) for column in ("pivot_x", "pivot_y")]
    assert np.hypot(*(starts[0][0, pin] - place)) < 0.05
    found = climb(Objective(pinned, stages.fitted[-1], OPTIONS.sensor_floor), starts[0])
    assert found.sigma[found.best] < 1.05 < base.noise_scale


def test_a_body_that_goes_about_has_no_wheel_that_stands_in_for_a_pin(
    concealed_recording: Callable[..., Recording],
) -> None:
    track, _, base = fitted(concealed_recording("clean", 2), "caster")
    assert not holds_as_pin("hidden_hinge", base, track)
