"""The library on a base: what is worth simulating, and what the path alone rules out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import DiagnoseOptions, track_of
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.search.fitted import Fitted, cut_stages, fit_from
from pbrl_mismatch.search.grip import GripEvidence, GripLaw, beside_motion
from pbrl_mismatch.search.grown import AS_GOOD, survivors
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.library import of_every_shape, search_library
from pbrl_mismatch.search.weigh import CLEAR, OF_EXACT, weigh, worth_of_another

FEW = ("viscous_drag", "floor_slope", "wrench_bias")
OPTIONS = DiagnoseOptions(
    draws=60, shortlist=4, survivors=(2,), without=tuple(name for name in DiagnoseOptions().effects if name not in FEW)
)
WORTH = 5.0
"""What an effect has to be worth along the path [nat]."""
SAYS_NOTHING = 16.0
"""What three numbers that are not needed cost by their priors [nat], with some for a climb that is not at its end."""


def base_of(recording: Recording) -> tuple[Any, Any, Fitted]:
    """Return the track of a table, its windows, and a body without laws fitted to them."""
    track = track_of(recording, "table")
    stages = cut_stages(track, OPTIONS)
    free = baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    return track, stages, fit_from(free, stages, free.mean[None], OPTIONS)


@pytest.mark.parametrize(("concealed", "left"), [("clean", 0), ("viscous_drag", 1)])
def test_nothing_is_simulated_where_the_path_has_no_use_for_it(
    concealed_recording: Callable[..., Recording], concealed: str, left: int
) -> None:
    track, stages, base = base_of(concealed_recording(concealed, 1))
    found = search_library(np.random.SeedSequence(0), track, [base], stages, OPTIONS, WORTH)
    assert bool(found) == bool(left)
    if found:
        best = max(found, key=lambda each: each.evidence)
        assert best.hypothesis.effects == ("viscous_drag",)
        again = search_library(np.random.SeedSequence(1), track, [best], stages, OPTIONS, WORTH)
        assert not again, "what explains all leaves nothing that is worth another"
        asks = worth_of_another(weigh([base], found, OPTIONS))
        singles = len({each.hypothesis.effects for each in found})
        assert EFFECTS["viscous_drag"].exact
        assert asks == pytest.approx(np.log(singles) + OF_EXACT * (best.evidence - base.evidence) + CLEAR)


def test_what_only_the_grippers_poses_show_is_worth_simulating(
    concealed_recording: Callable[..., Recording],
) -> None:
    track, stages, base = base_of(concealed_recording("clean", 1))
    law = GripLaw(-190.0, np.zeros(3), np.eye(3), np.zeros(3), np.eye(3))
    late = replace(law, evidence=-120.0)
    laws = {(gives, is_late): late if is_late else law for gives in (False, True) for is_late in (False, True)}
    grip = GripEvidence(laws, 1e-9, np.eye(3))
    options = OPTIONS.model_copy(update={"without": tuple(n for n in OPTIONS.without if n != "time_offset")})
    base = beside_motion(base, grip)
    assert not search_library(np.random.SeedSequence(0), track, [base], stages, options, WORTH)
    found = search_library(np.random.SeedSequence(0), track, [base], stages, options, WORTH, grip)
    assert ("time_offset",) in {each.hypothesis.effects for each in found}


def test_an_effect_that_says_nothing_is_hardly_less_likely_than_what_it_is_laid_on(
    concealed_recording: Callable[..., Recording],
) -> None:
    track, stages, base = base_of(concealed_recording("ground_friction", 1))
    few = ("ground_friction", "wrench_bias", "floor_slope")
    without = tuple(name for name in DiagnoseOptions().effects if name not in few)
    options = OPTIONS.model_copy(update={"without": without, "shortlist": 8, "survivors": (8,), "keep": (1, 1)})
    found = search_library(np.random.SeedSequence(0), track, [base], stages, options)
    best = max(found, key=lambda each: float(each.peak.evidence[0]))
    assert best.hypothesis.effects == ("ground_friction",)
    sets = search_library(np.random.SeedSequence(1), track, [best], stages, options)
    offsets = [each for each in sets if "wrench_bias" in each.hypothesis.effects]
    assert len(offsets) == len(EFFECTS["wrench_bias"].variants)
    for each in offsets:
        assert each.peak.evidence[0] > best.peak.evidence[0] - SAYS_NOTHING, each.hypothesis.variant


def test_of_sets_that_go_on_each_counts_once_in_whatever_order_it_was_found() -> None:
    sets = [("tether", "detent"), ("detent", "tether"), ("tether", "floor_slope"), ("detent", "viscous_drag")]
    tried = [SimpleNamespace(effects=effects) for effects in sets]
    assert survivors(tried, [50.0, 49.0, 40.0, 30.0], 2, 0.0) == [0, 1, 2]
    assert survivors(tried, [50.0, 49.0 - AS_GOOD, 40.0, 30.0], 2, 0.0) == [0, 2], "the worse order is given up"


def test_a_contact_goes_on_in_every_shape_where_it_goes_on_at_all() -> None:
    jobs = [(name, ground) for ground in (0, 1) for name in ("hidden_obstacle", "hidden_obstacle", "external_force")]
    assert of_every_shape(jobs, [1]) == [0, 1]
    assert of_every_shape(jobs, [2, 3]) == [2, 3, 4]
    assert of_every_shape(jobs, [5]) == [5]
