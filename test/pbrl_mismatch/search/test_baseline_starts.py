"""From where a baseline is climbed: from friction that is felt, whatever else is believed possible of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import DiagnoseOptions, track_of
from pbrl_mismatch.search import fitted
from pbrl_mismatch.search.hypothesis import BELIEVED, BaselineOptions, baselines


class _SeenError(Exception):
    """What a climb was given."""


def test_a_wheel_s_friction_is_felt_where_a_climb_begins(
    concealed_recording: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    def climb_along(along: Any, hypothesis: Any, starts: np.ndarray, iterations: int) -> Any:
        raise _SeenError(starts)

    monkeypatch.setattr(fitted, "climb_along", climb_along)
    track, options = track_of(concealed_recording("clean", 1), "table"), DiagnoseOptions()
    wheel = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    with pytest.raises(_SeenError) as seen:
        fitted.fit_baseline(np.random.default_rng(0), track, wheel, fitted.cut_stages(track, options), options)
    starts = seen.value.args[0]
    for column in ("mu_x", "mu_y"):
        friction = np.exp(starts[:, wheel.columns.index(column)])
        assert 0.05 < np.median(friction) < 0.2
        assert np.all(friction > 0.003)


def test_a_body_that_is_held_back_is_fitted_at_least_as_well_as_from_what_is_believed_of_it(
    concealed_recording: Callable[..., Recording],
) -> None:
    track, options = track_of(concealed_recording("hidden_obstacle", 4), "table"), DiagnoseOptions()
    wheel = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    stages = fitted.cut_stages(track, options)
    whole = fitted.fit_baseline(np.random.default_rng(0), track, wheel, stages, options)
    held = fitted.fit_baseline(np.random.default_rng(0), track, wheel.fixed(BELIEVED), stages, options)
    from_held = wheel.laid_on(held.hypothesis, held.peak.coordinates[0], wheel.mean[None])
    assert whole.evidence >= fitted.fit_from(wheel, stages, from_held, options).evidence - 1.0
