"""What no effect explains is described: planted laws come back, chance is not taken for one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wandering import moments, table_row

from pbrl_bag.types import Recording
from pbrl_mismatch import MismatchError, residual_wrench, track_of
from pbrl_mismatch.unknown.describe import describe_unknown, surely_there
from pbrl_mismatch.unknown.features import along_motion, features_of
from pbrl_mismatch.unknown.process import wrench_process
from pbrl_mismatch.unknown.regression import sparse_law
from pbrl_mismatch.unknown.samples import apart


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


PLANTED = [
    ({"steady_x": -4.0, "steady_y": 2.0}, "constant in world", [4.0, -2.0]),
    ({"drag_linear": -20.0}, "viscous resistance", [20.0]),
    ({"drag_linear": -12.0, "steady_x": -3.0}, "viscous resistance", [12.0]),
    ({"bias_x": 2.0}, "constant in body", [2.0, 0.0]),
    ({"steady_torque": -1.5}, "constant moment", [1.5]),
    ({"drag_turn": -3.0}, "viscous turning resistance", [3.0]),
]


@pytest.mark.parametrize(("values", "name", "wanted"), PLANTED)
def test_a_planted_law_is_recovered_with_its_coefficient_inside_its_interval(
    track: Any, values: dict[str, float], name: str, wanted: list[float]
) -> None:
    # The model is given a law that is not there: what is left out is its negative.
    row = table_row(**values)
    told = describe_unknown(np.random.default_rng(0), track, residual_wrench(track, row), row)
    term = next(each for each in told.law.terms if each.feature.name == name)
    assert np.all(np.abs(term.mean - wanted) < 2.6 * term.sd), (term.mean, term.sd)
    assert np.all(term.sd < 0.25 * np.max(np.abs(wanted)))
    assert told.law.share > 0.7 and term.stability > 0.6


def test_a_rhythm_is_found_with_its_frequency(track: Any) -> None:
    row = table_row(periodic_x=4.0, periodic_frequency=0.31)
    told = describe_unknown(np.random.default_rng(0), track, residual_wrench(track, row), row)
    assert told.law.terms[0].feature.name.startswith("rhythm of 0.3") and "rhythm" in told.sentences[0]
    assert any("follows time" in note for note in told.notes)


def test_where_nothing_is_left_out_no_law_is_named(track: Any) -> None:
    row = table_row()
    told = describe_unknown(np.random.default_rng(0), track, residual_wrench(track, row), row)
    assert not told.law.terms and told.law.share == 0.0 and any("no physical feature" in note for note in told.notes)
    for seed in range(3):
        chance = moments(np.random.default_rng(seed), 80, 1.0)
        assert not sparse_law(np.random.default_rng(0), chance, features_of(chance)).terms


def test_what_has_no_name_is_surely_there_while_it_acts_however_long_that_is(track: Any) -> None:
    def there(row: np.ndarray) -> np.ndarray:
        when = surely_there(track, residual_wrench(track, row, memory=None))
        return np.any([(track.clock >= a) & (track.clock < b) for a, b in when] or [0.0 * track.clock > 1.0], axis=0)

    assert there(table_row(steady_x=0.6)).mean() > 0.8  # of 0.4 s alone, half a newton is next to the noise
    assert there(table_row()).mean() < 0.02
    begins = float(track.clock[len(track.clock) // 2])
    found = there(table_row(steady_x=2.0, force_start=begins))
    assert found[track.clock > begins].mean() > 0.8 and found[track.clock < begins].mean() < 0.2


def test_a_region_is_told_by_its_border() -> None:
    here = moments(np.random.default_rng(1), 150, 0.4)
    border = float(np.quantile(here.place[:, 0], 0.5))
    beyond = (here.place[:, 0] > border)[:, None]
    wrench = here.wrench.copy()
    wrench[:, :2] -= 3.0 * along_motion(here) * beyond
    here = replace(here, wrench=wrench)
    law = sparse_law(np.random.default_rng(0), here, features_of(here))
    term = law.terms[0]
    assert term.feature.name.startswith("resistance where x >") and f"{border:.2f}" in term.feature.name
    assert abs(term.mean[0] - 3.0) < 3.0 * term.sd[0]


def test_the_process_knows_nothing_far_away_and_the_field_nearby() -> None:
    here = moments(np.random.default_rng(2), 150, 0.2)
    field = 3.0 * np.stack([np.sin(here.place[:, 0]), np.cos(here.place[:, 1]), 0.0 * here.time], -1)
    here = replace(here, wrench=here.wrench + field)
    process = wrench_process(here)
    assert process.axes == "world" and process.share > 0.8
    far = np.full((1, 2), 100.0)
    mean, covariance = process.predict(far, np.zeros(1), np.zeros((1, 2)))
    np.testing.assert_allclose(mean, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.diag(covariance[0]), process.size**2, rtol=1e-9)
    mean, covariance = process.predict(here.place, here.heading, here.velocity)
    off = (mean - field) / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert np.mean(np.abs(off[:, :2]) < 1.96) > 0.85
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-9)


def test_a_force_fixed_in_the_body_is_seen_in_the_body_s_axes() -> None:
    here = moments(np.random.default_rng(3), 120, 0.2)
    heading = np.linspace(0.0, 9.0, len(here))
    wrench = here.wrench + 3.0 * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], -1)
    process = wrench_process(replace(here, heading=heading, wrench=wrench))
    assert process.axes == "body"
    mean, _ = process.predict(here.place[:5], np.full(5, 1.0), here.velocity[:5])
    np.testing.assert_allclose(mean[:, :2], np.tile([3 * np.cos(1.0), 3 * np.sin(1.0)], (5, 1)), atol=0.5)


def test_chance_is_not_predicted() -> None:
    assert wrench_process(moments(np.random.default_rng(4), 100, 1.0)).share < 0.2


def test_the_report_is_json_and_the_same_seed_gives_the_same(track: Any) -> None:
    row = table_row(drag_linear=-20.0)
    residual = residual_wrench(track, row)
    first, second = (
        json.dumps(describe_unknown(np.random.default_rng(5), track, residual, row).to_report(), allow_nan=False)
        for _ in range(2)
    )
    assert first == second
    told = json.loads(first)
    assert set(told) == {"sentences", "terms", "share_explained", "left_over", "gaussian_process", "when", "notes"}
    assert "against the direction of motion" in told["sentences"][0] and "N s/m" in told["sentences"][0]


def test_too_short_a_recording_is_refused(track: Any) -> None:
    short = replace(track, clock=track.clock[:100], last=np.array([99]))
    with pytest.raises(MismatchError, match="expected at least 3 s"):
        apart(short)
    with pytest.raises(MismatchError, match="moments"):
        wrench_process(moments(np.random.default_rng(0), 4, 1.0))
