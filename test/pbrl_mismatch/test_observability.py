"""What a recording could not have shown: the stated power is the share of recordings in which it is noticed."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, DiagnoseOptions, MismatchError, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.observability.detectable import Detectable, Sensitivity, could_not_show, detectable
from pbrl_mismatch.observability.power import needed, power
from pbrl_mismatch.observability.strengths import STRENGTHS, scaled, size_of, strength_columns
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, scene_of
from pbrl_mismatch.search.grip import GripEvidence
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import NUISANCES, Objective

FLOOR = 0.15


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


@pytest.fixture(scope="module")
def ground(track: Any) -> Fitted:
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    return Fitted(free, climb(Objective(free, cut_windows(track, 2.0), FLOOR), free.mean[None], iterations=6), None)


def test_power_is_the_share_of_draws_over_the_limit() -> None:
    rng = np.random.default_rng(0)
    for parameters, noncentrality in ((1, 3.0), (3, 9.0), (6, 17.0)):
        draws = rng.standard_normal((40_000, parameters))
        draws[:, 0] += math.sqrt(noncentrality)
        share = np.mean(np.sum(draws**2, axis=1) > chi2.isf(0.05, parameters))
        assert float(power(np.array(noncentrality), parameters, 0.05)) == pytest.approx(share, abs=0.01)


def test_power_starts_at_the_level_grows_and_is_inverted_by_needed() -> None:
    values = power(np.linspace(0.0, 60.0, 40), 4, 0.05)
    assert values[0] == pytest.approx(0.05) and np.all(np.diff(values) >= 0.0)
    for parameters in (1, 5):
        assert float(power(np.array(needed(parameters, 0.05, 0.95)), parameters, 0.05)) == pytest.approx(0.95, abs=1e-6)
    assert float(power(np.array(math.inf), 2, 0.05)) == pytest.approx(1.0)


def test_one_number_is_found_in_95_percent_where_the_two_tails_say() -> None:
    # Of a number with unit noise the far tail never counts: it stands at the sum of two quantiles.
    assert needed(1, 0.05, 0.95) == pytest.approx((norm.isf(0.025) + norm.isf(0.05)) ** 2, rel=1e-3)


def test_what_is_needed_grows_with_what_is_free_and_with_what_is_asked() -> None:
    values = [needed(freedom, 0.05, 0.95) for freedom in range(1, 12)]
    assert np.all(np.diff(values) > 0.0)
    assert needed(3, 0.05, 0.5) < needed(3, 0.05, 0.95) < needed(3, 0.01, 0.95)


def test_an_effect_of_the_smallest_strength_is_noticed_as_often_as_stated(track: Any, ground: Fitted) -> None:
    # Recordings are drawn from the model with a slope; what it gains when it is allowed a slope is the test.
    rng, cuts = np.random.default_rng(1), ground.peak.objective.cuts.take(np.arange(4))
    free = ground.hypothesis
    ground = Fitted(free, climb(Objective(free, cuts, FLOOR), ground.peak.coordinates, iterations=3), None)
    slope = free.with_effect(EFFECTS["floor_slope"], scene_of(track, ground.row), 0)
    row = ground.row[None].copy()
    row[0, COLUMN["slope_x"]] = 1e-3
    unit = Sensitivity(ground).noncentrality(row)[0]
    for wanted in (0.5, 0.9):
        strong = row.copy()
        strong[0, COLUMN["slope_x"]] *= math.sqrt(needed(2, 0.05, wanted) / unit)
        noticed = []
        for _ in range(24):
            z = rng.standard_normal((1, len(cuts), NUISANCES))
            told = cuts.told + np.einsum("wkl,pwl->pwk", cuts.root, z[..., :6])
            extra = z[..., None, 6:] * FLOOR * np.array([1.0, 1.0, track.gyration])
            noise = rng.standard_normal(cuts.pose.shape) / np.where(cuts.weight > 0.0, cuts.weight, 1.0)
            data = replace(cuts, pose=poses(strong, cuts, told, extra)[0] + noise)
            start = np.concatenate([ground.peak.coordinates[0], [0.0, 0.0]])
            fits = [
                climb(Objective(each, data, FLOOR), at[None], iterations=2)
                for each, at in ((free, start[: len(free.parameters)]), (slope, start))
            ]
            cost = [float(fit.misfit.sum() + fit.objective.prior_misfit(fit.coordinates)[0]) for fit in fits]
            noticed.append(cost[0] - cost[1] > chi2.isf(0.05, 2))
        assert abs(np.mean(noticed) - wanted) < 0.25, (wanted, np.mean(noticed))


def test_what_acts_on_all_motion_is_shown_and_what_is_elsewhere_is_not(ground: Fitted) -> None:
    found = {each.effect: each for each in detectable(np.random.default_rng(0), ground)}
    assert set(found) == set(EFFECTS)
    for name in ("viscous_drag", "ground_friction", "floor_slope", "wrench_bias"):
        assert found[name].shown and found[name].chance > 0.8
    hidden = {each.effect for each in could_not_show(np.random.default_rng(0), ground)}
    assert "grasp_compliance" in hidden and "detent" in hidden
    assert hidden == {name for name, each in found.items() if not each.shown}
    assert "nowhere" in found["grasp_compliance"].sentence()
    json.dumps([each.to_report() for each in found.values()], allow_nan=False)


def test_a_hold_that_gives_shows_between_gripper_and_body(ground: Fitted) -> None:
    def told(spread: float) -> Detectable:
        grip = GripEvidence({}, 1.0, np.diag([spread, 10.0 * spread, 0.01]) ** 2)
        (found,) = detectable(np.random.default_rng(0), ground, ("grasp_compliance",), grip)
        hidden = could_not_show(np.random.default_rng(0), ground, ("grasp_compliance",), grip)
        assert bool(hidden) == (not found.shown)
        return found

    sharp, blunt = told(1e-5), told(1e-3)
    assert sharp.shown and not blunt.shown and sharp.chance > 0.9 > blunt.chance
    assert sharp.unit == "m/N" and blunt.smallest == pytest.approx(100.0 * sharp.smallest)


def test_a_longer_recording_shows_weaker_effects(ground: Fitted) -> None:
    few = ground.peak.objective.cuts.take(np.arange(3))
    start = ground.peak.coordinates
    short = Fitted(ground.hypothesis, climb(Objective(ground.hypothesis, few, FLOOR), start, iterations=3), None)
    names = ("viscous_drag", "floor_slope")
    all_of_it, some = (detectable(np.random.default_rng(0), each, names) for each in (ground, short))
    assert all(a.smallest < b.smallest for a, b in zip(all_of_it, some, strict=True))


def test_what_is_already_in_the_model_is_left_out(track: Any, ground: Fitted) -> None:
    drag = ground.hypothesis.with_effect(EFFECTS["viscous_drag"], scene_of(track, ground.row), 1)
    with_drag = Fitted(drag, climb(Objective(drag, ground.peak.objective.cuts, FLOOR), drag.mean[None]), None)
    found = detectable(np.random.default_rng(0), with_drag, ("viscous_drag", "floor_slope"))
    assert [each.effect for each in found] == ["floor_slope"]


def test_an_effect_is_added_to_a_model_that_is_else_what_it_was(
    track: Any, ground: Fitted, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A round second wheel has its friction across fixed: it was tested without, so that everything seemed to show.
    scene, cuts = scene_of(track, ground.row), ground.peak.objective.cuts.take(np.arange(1))
    wheel = ground.hypothesis.with_effect(EFFECTS["second_wheel"], scene, 0)
    with_wheel = Fitted(wheel, climb(Objective(wheel, cuts, FLOOR), wheel.mean[None], iterations=1), None)
    tried = []
    monkeypatch.setattr(Sensitivity, "noncentrality", lambda self, rows: tried.append(rows) or np.ones(len(rows)))
    for name in ("floor_slope", "breakaway_friction", "com_offset"):
        tried.clear()
        detectable(np.random.default_rng(0), with_wheel, (name,), draws=2)
        own = [COLUMN[column] for free in EFFECTS[name].variants for column in free]
        others = np.setdiff1d(np.arange(len(ground.row)), own)
        assert tried
        for rows in tried:
            np.testing.assert_array_equal(rows[:, others], np.tile(with_wheel.row[others], (2, 1)))
    # What moves the middle of a footprint that is not known exactly is an offset none the less.
    unsure = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005, 0.0, 0.01), ["free"], np.zeros(2), np.ones(2), None)[0]
    of_unsure = Fitted(unsure, climb(Objective(unsure, cuts, FLOOR), unsure.mean[None], iterations=1), None)
    detectable(np.random.default_rng(0), of_unsure, ("com_offset",), draws=2)
    assert np.all(tried[-1][:, COLUMN["com_x"]] != of_unsure.row[COLUMN["com_x"]])
    np.testing.assert_array_equal(tried[-1][:, COLUMN["inertia_factor"]], of_unsure.row[COLUMN["inertia_factor"]])


def test_strengths_scale_from_nothing(track: Any, ground: Fitted) -> None:
    scene = scene_of(track, ground.row)
    assert set(STRENGTHS) == set(EFFECTS) == set(DiagnoseOptions().effects)
    for name, effect in EFFECTS.items():
        for variant, free in enumerate(effect.variants):
            columns = strength_columns(name, free)
            hypothesis = ground.hypothesis.with_effect(effect, scene, variant)
            rows = hypothesis.rows(hypothesis.sample_prior(np.random.default_rng(0), 4))
            assert columns
            np.testing.assert_allclose(size_of(scaled(rows, columns, np.zeros(4)), columns), 0.0, atol=1e-12)
            np.testing.assert_allclose(scaled(rows, columns, np.ones(4)), rows)
            assert np.all(size_of(scaled(rows, columns, np.full(4, 2.0)), columns) > size_of(rows, columns))


def test_a_patch_of_no_strength_does_nothing_to_a_wheel_either(track: Any, ground: Fitted) -> None:
    scene, cuts = scene_of(track, ground.row), ground.peak.objective.cuts.take(np.arange(2))
    wheel = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.005), ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    fitted = Fitted(wheel, climb(Objective(wheel, cuts, FLOOR), wheel.mean[None], iterations=1), None)
    patch = wheel.with_effect(EFFECTS["floor_patch"], scene, 0)
    rows = np.tile(fitted.row, (2, 1))
    for parameter in patch.parameters[len(wheel.parameters) :]:
        rows[:, COLUMN[parameter.column]] = parameter.centre
    rows[:, [COLUMN["patch_x"], COLUMN["patch_y"]]] = track.seen[0, :2]
    rows[:, COLUMN["patch_roll"]] = 1.0
    columns = strength_columns("floor_patch", EFFECTS["floor_patch"].variants[0])
    strong, none = Sensitivity(fitted).noncentrality(scaled(rows, columns, np.array([1.0, 0.0])))
    assert strong > 1.0 and none == 0.0


def test_a_test_that_always_alarms_hides_nothing(ground: Fitted) -> None:
    assert could_not_show(np.random.default_rng(0), ground, ("detent",), level=0.97) == ()


def test_bad_input_is_refused(ground: Fitted) -> None:
    with pytest.raises(MismatchError, match="power"):
        needed(2, 0.05, 0.01)
    with pytest.raises(MismatchError, match="effect"):
        detectable(np.random.default_rng(0), ground, ("no_such",))
