"""From where a hypothesis is climbed on: where it is itself, and what it shares with another, windows and all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.climbed_on import (
    BEHIND,
    BEYOND_PATH,
    elsewhen,
    over_longest,
    parts_led,
    polished,
    sets_led,
    starts_from,
)
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, scene_of
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.weigh import Weighed

FLOOR = 0.15


@pytest.fixture(scope="module")
def fitted(concealed_recording: Callable[..., Recording]) -> Any:
    """Return a baseline, and a floor that leans upon it, each fitted to the same windows."""
    track = track_of(concealed_recording("floor_slope", 1), "table")
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    sloped = free.with_effect(EFFECTS["floor_slope"], scene_of(track, free.rows(free.mean[None])[0]), 0)
    cuts = cut_windows(track, 2.0)
    return [
        Fitted(each, alone(climb(Objective(each, cuts, FLOOR), each.mean[None], iterations=6)), None)
        for each in (free, sloped)
    ]


def test_one_start_is_where_it_is(fitted: Any) -> None:
    for own, other in (fitted, fitted[::-1]):
        there = climb(own.peak.objective, *starts_from(own, other), iterations=0)
        assert there.evidence[0] == pytest.approx(float(own.peak.evidence[0]), abs=1e-6)


def test_what_another_effect_does_nothing_to_is_told_as_well_without_it(fitted: Any) -> None:
    free, sloped = fitted
    flat = sloped.peak.coordinates.copy()
    slope = ~np.isin(sloped.hypothesis.columns, free.hypothesis.columns)
    flat[0, slope] = sloped.hypothesis.mean[slope]
    nothing = Fitted(sloped.hypothesis, climb(sloped.peak.objective, flat, sloped.peak.nuisance, iterations=0), None)
    led = climb(free.peak.objective, *starts_from(free, nothing), iterations=0)
    assert led.misfit[1] == pytest.approx(nothing.peak.misfit[0], rel=1e-9)


@pytest.mark.parametrize("behind", [2.0, 0.5, None])
def test_what_comes_or_goes_is_sought_all_over_beside_what_simulations_alone_tell(
    fitted: Any, behind: float | None
) -> None:
    sloped = fitted[1]
    cuts = sloped.peak.objective.cuts
    scene = scene_of(cuts.track, sloped.hypothesis.rows(sloped.peak.coordinates)[0])
    both = sloped.hypothesis.with_effect(EFFECTS["payload_change"], scene, 0)
    laid = Fitted(both, climb(Objective(both, cuts, FLOOR), both.mean[None], iterations=0), None)
    if behind is not None:
        path: Any = SimpleNamespace(evidence=laid.simulated - behind * BEYOND_PATH)
        laid = replace(laid, traced=path)
    coordinates, begins = elsewhen(laid, sloped)
    if behind != 2.0:  # there is no path, or it tells about as much
        assert len(coordinates) == len(begins) == 0
        return
    when, clock = both.columns.index("payload_time"), cuts.track.clock
    assert np.all(np.diff(coordinates[:, when]) > 0.0) and coordinates.shape[1] == len(both.columns)
    assert np.ptp(coordinates[:, when]) > 0.9 * np.ptp(clock)
    for column, value in zip(sloped.hypothesis.columns, sloped.peak.coordinates[0], strict=True):
        assert np.all(coordinates[:, both.columns.index(column)] == value)
    assert all(np.array_equal(each, sloped.peak.nuisance[0]) for each in begins)
    assert len(elsewhen(laid, laid)[0]) == 0  # the ground has it


def with_effects(fitted: Fitted, *effects: str) -> Fitted:
    return replace(fitted, hypothesis=replace(fitted.hypothesis, effects=effects))


def in_order(*fitted: Fitted) -> tuple[Weighed, ...]:
    return tuple(Weighed(each.hypothesis.effects, each, -float(k), 0.0, False) for k, each in enumerate(fitted))


def test_parts_of_a_set_are_led_to_where_it_has_them_and_nothing_else_is(fitted: Any) -> None:
    sloped = fitted[1]
    stages, options = Stages((sloped.peak.objective.cuts,), ()), DiagnoseOptions()
    began = sloped.hypothesis.mean[None]
    short = replace(sloped, peak=climb(sloped.peak.objective, began, iterations=0))
    other = with_effects(short, "detent")
    weighed = in_order(with_effects(sloped, "floor_slope", "time_offset"))
    led = parts_led(weighed, [short, other], stages, options)
    assert led[0].evidence >= sloped.evidence - 1e-6 > short.evidence
    assert led[1] is other


def test_a_set_is_climbed_on_from_where_its_part_was_led_to_and_from_no_other(fitted: Any) -> None:
    sloped = fitted[1]
    cuts = sloped.peak.objective.cuts
    stages, options = Stages((cuts,), ()), DiagnoseOptions(iterations=(2, 2))
    scene = scene_of(cuts.track, sloped.hypothesis.rows(sloped.peak.coordinates)[0])
    both = sloped.hypothesis.with_effect(EFFECTS["time_offset"], scene, 0)
    whole = Fitted(both, climb(Objective(both, cuts, FLOOR), both.mean[None], iterations=0), None)
    short = replace(sloped, peak=climb(sloped.peak.objective, sloped.hypothesis.mean[None], iterations=0))
    other = with_effects(whole, "floor_patch", "detent")
    before, now = [short, whole, other], [sloped, whole, other]
    weighed = in_order(*now)
    led = sets_led(weighed, before, now, stages, options)
    assert led[0] is sloped and led[2] is other
    # A delay of which there is nothing loses no more than its freedom costs.
    assert led[1].simulated > sloped.simulated - 5.0 > whole.simulated
    unchanged = sets_led(weighed, now, now, stages, options)
    assert all(one is same for one, same in zip(unchanged, now, strict=True))


def test_every_set_that_explains_more_leads_whatever_the_likeliest_is(fitted: Any) -> None:
    sloped = fitted[1]
    stages, options = Stages((sloped.peak.objective.cuts,), ()), DiagnoseOptions(iterations=(2, 2))
    short = replace(sloped, peak=climb(sloped.peak.objective, sloped.hypothesis.mean[None], iterations=0))
    stuck = with_effects(short, "floor_slope", "time_offset")
    found = with_effects(sloped, "floor_slope", "detent")
    led = parts_led(in_order(short, stuck, found), [short], stages, options)[0]
    assert led.evidence >= sloped.evidence - 1e-6 > short.evidence


def test_a_set_that_is_far_less_likely_than_another_hypothesis_leads_nothing(fitted: Any) -> None:
    sloped = fitted[1]
    stages, options = Stages((sloped.peak.objective.cuts,), ()), DiagnoseOptions()
    short = replace(sloped, peak=climb(sloped.peak.objective, sloped.hypothesis.mean[None], iterations=0))
    ahead = replace(with_effects(sloped, "detent"), beside=2.0 * BEHIND)
    weighed = in_order(ahead, with_effects(sloped, "floor_slope", "time_offset"))
    assert parts_led(weighed, [short], stages, options)[0] is short


def test_a_hold_that_gives_way_leads_nothing(fitted: Any) -> None:
    sloped = fitted[1]
    stages, options = Stages((sloped.peak.objective.cuts,), ()), DiagnoseOptions()
    short = replace(sloped, peak=climb(sloped.peak.objective, sloped.hypothesis.mean[None], iterations=0))
    tried = [short, with_effects(sloped, GRASP_COMPLIANCE)]
    weighed = in_order(with_effects(sloped, "floor_slope", GRASP_COMPLIANCE))
    led = parts_led(weighed, tried, stages, options)
    assert all(one is other for one, other in zip(led, tried, strict=True))


def test_a_set_of_short_windows_is_over_long_ones_at_least_what_its_part_is(fitted: Any) -> None:
    sloped = fitted[1]
    track, longest = sloped.peak.objective.cuts.track, sloped.peak.objective.cuts
    stages, options = Stages((cut_windows(track, 1.0), longest), ()), DiagnoseOptions()
    scene = scene_of(track, sloped.hypothesis.rows(sloped.peak.coordinates)[0])
    both = sloped.hypothesis.with_effect(EFFECTS["viscous_drag"], scene, 0)
    begun = climb(Objective(both, stages.fitted[0], FLOOR), both.mean[None], iterations=0)
    short = Fitted(both, begun, None)
    held = with_effects(short, "floor_slope", GRASP_COMPLIANCE)
    (found,) = over_longest(in_order(sloped, held, short), [sloped], stages, options)
    assert found.hypothesis is both and found.peak.objective.cuts is longest
    assert found.traced is not None and found.over_shorter().peak is begun
    # For a drag of which there is nothing it loses no more than what its freedom costs.
    assert found.simulated > sloped.simulated - 5.0


def test_a_set_has_an_effect_as_another_set_found_it_where_that_is_likelier(fitted: Any) -> None:
    sloped = fitted[1]
    longest = sloped.peak.objective.cuts
    stages, options = Stages((cut_windows(longest.track, 1.0), longest), ()), DiagnoseOptions(iterations=(1, 1))
    scene = scene_of(longest.track, sloped.hypothesis.rows(sloped.peak.coordinates)[0])
    free = fitted[0].hypothesis

    def over_short(*laws: tuple[str, int], slope: float) -> Fitted:
        hypothesis = free
        for name, variant in laws:
            hypothesis = hypothesis.with_effect(EFFECTS[name], scene, variant)
        start = hypothesis.mean.copy()
        for column in ("slope_x", "slope_y"):
            there = sloped.peak.coordinates[0, sloped.hypothesis.columns.index(column)]
            start[hypothesis.columns.index(column)] = slope * there
        return Fitted(
            hypothesis, climb(Objective(hypothesis, stages.fitted[0], FLOOR), start[None], iterations=0), None
        )

    lost = over_short(("floor_slope", 0), ("viscous_drag", 0), slope=-20.0)
    found = over_short(("floor_slope", 0), ("time_offset", 0), slope=1.0)
    alone_there = over_longest(in_order(sloped, lost), [], stages, options)[0]
    helped = next(
        each
        for each in over_longest(in_order(sloped, lost, found), [], stages, options)
        if each.hypothesis.effects == lost.hypothesis.effects
    )
    assert helped.simulated > alone_there.simulated + 10.0


@pytest.mark.parametrize(("name", "too"), [("hidden_obstacle", True), ("viscous_drag", False)])
def test_a_contact_s_other_shapes_are_climbed_on_with_its_best(fitted: Any, name: str, too: bool) -> None:
    free = fitted[0]
    cuts = free.peak.objective.cuts
    scene = scene_of(cuts.track, free.row)

    def laid(variant: int, heavier: float) -> Fitted:
        hypothesis = free.hypothesis.with_effect(EFFECTS[name], scene, variant)
        start = hypothesis.mean.copy()
        start[hypothesis.columns.index("mass")] += heavier
        return Fitted(hypothesis, climb(Objective(hypothesis, cuts, FLOOR), start[None], iterations=0), None)

    best, other = laid(0, 0.0), laid(1, 1.0)
    weighed = (Weighed((name,), best, 0.0, 0.9, False), Weighed((), free, -1.0, 0.1, False))
    options = DiagnoseOptions(iterations=(2, 2))
    _, found = polished(weighed, [best, other], Stages((cuts,), ()), options, hops=False)
    assert (found is not other) is too
    assert found.simulated > other.simulated + 10.0 or not too
