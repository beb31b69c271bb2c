"""Where what holds or stops a body begins: short simulations tell, also where the ground was taken for many times as
heavy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from concealed_cases import concealed, on_the_way

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, DiagnoseOptions, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.search.fitted import cut_stages, fit_baseline, scene_of
from pbrl_mismatch.search.held import KEPT_OF_PLACES, held_starts, holds
from pbrl_mismatch.search.hypothesis import OF_FRICTION, BaselineOptions, baselines
from pbrl_mismatch.search.path.ground import ground_of

OPTIONS = DiagnoseOptions()


# The second post is one that a place elsewhere stands in for: a search finds it three times in four, and in none of six
# when it drew two hundred times and kept what was best anywhere.
@pytest.mark.parametrize(
    ("name", "seed", "within", "least", "searches"),
    [("hidden_obstacle", 4, 0.1, 6, 6), ("hidden_obstacle", 12, 0.1, 4, 6), ("floor_patch", 8, 0.35, 1, 1)],
)
@pytest.mark.parametrize("heavier", [1.0, 8.0])
def test_the_place_is_found_whatever_the_body_was_taken_for(
    concealed_recording: Callable[..., Recording],
    name: str,
    seed: int,
    within: float,
    least: int,
    searches: int,
    heavier: float,
) -> None:
    truth = on_the_way(name, concealed(name, np.random.default_rng([seed, 7])), seed)
    track = track_of(concealed_recording(name, seed), "table")
    believed = BaselineOptions(20.0, 0.1, 0.1, 0.02)
    wheel = baselines(believed, ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    stages = cut_stages(track, OPTIONS)
    base = fit_baseline(np.random.default_rng(0), track, wheel, stages, OPTIONS)
    # What holds a body is easily taken for its weight; a wheel's friction then is as much less of that.
    bend = np.array([(column == "mass") - (column in OF_FRICTION) for column in wheel.columns]) * math.log(heavier)
    base = replace(base, peak=replace(base.peak, coordinates=base.peak.coordinates + bend))
    ground = ground_of(wheel, base.peak.coordinates[0], cut_windows(track, 2.0), OPTIONS.sensor_floor)
    laid = wheel.with_effect(EFFECTS[name], scene_of(track, base.row), 0)

    def begin(seed: int) -> np.ndarray:
        return held_starts(np.random.default_rng(seed), laid, 0, base, ground, stages.fitted[0], OPTIONS)

    starts = begin(1)
    np.testing.assert_array_equal(starts, begin(1))
    np.testing.assert_array_equal(starts, laid.believable(starts))
    assert 1 <= len(starts) <= KEPT_OF_PLACES
    x, y, turn = track.seen[0, :3]
    c, s = math.cos(turn), math.sin(turn)
    there = np.array([x + c * truth["x"] - s * truth["y"], y + s * truth["x"] + c * truth["y"]])
    place = [laid.columns.index(column) for column in EFFECTS[name].place or ()]
    off = [np.hypot(*(begin(search)[:, place] - there).T).min() for search in range(1, 1 + searches)]
    assert sum(each < within for each in off) >= least


def test_friction_and_contacts_hold_and_nothing_else() -> None:
    assert {name for name in EFFECTS if holds(name)} == {
        "ground_friction",
        "breakaway_friction",
        "second_wheel",
        "caster_swivel",
        "floor_patch",
        "hidden_obstacle",
        "unseen_body",
    }
