"""How hypotheses are weighed: an effect's variants share its part, also those that were given up."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_mismatch import EFFECTS, DiagnoseOptions
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.weigh import weigh

OPTIONS = DiagnoseOptions()


def fitted(variant: str, evidence: float) -> Any:
    """Return what is weighed of a hypothesis, by its variant: its kind of baseline, then effects by number."""
    effects = tuple(part.split("/")[0] for part in variant.split(" + ")[1:])
    return SimpleNamespace(
        hypothesis=SimpleNamespace(effects=effects, variant=variant), evidence=evidence, noise_scale=1.0
    )


BASES = [fitted("free", -100.0)]


def weights(*tried: Any) -> dict[tuple[str, ...], float]:
    return {each.effects: each.log_weight for each in weigh(BASES, tried, OPTIONS)}


def test_a_variant_that_was_given_up_counts_as_one_that_explains_nothing() -> None:
    slope, push = fitted("free + floor_slope/0", -50.0), fitted("free + external_force/0", -50.0)
    alone = weights(slope, push)
    hopeless = weights(slope, push, fitted("free + external_force/2", -500.0))
    assert alone == hopeless
    share = math.log(len(EFFECTS["external_force"].variants))
    assert alone["floor_slope",] - alone["external_force",] == pytest.approx(share)


def test_variants_that_are_as_good_share_what_the_best_of_them_lost() -> None:
    every = [fitted(f"free + external_force/{k}", -50.0) for k in range(len(EFFECTS["external_force"].variants))]
    found = weights(fitted("free + floor_slope/0", -50.0), *every)
    assert found["external_force",] == pytest.approx(found["floor_slope",])


def test_two_effects_are_the_same_two_in_either_order() -> None:
    ways = ["free + tether/0 + detent/1", "free + detent/1 + tether/0"]
    once, twice = (weights(*(fitted(way, -50.0) for way in ways[:count])) for count in (1, 2))
    assert once["detent", "tether"] == pytest.approx(twice["detent", "tether"])


@pytest.mark.parametrize("friction", [0.0005, 0.5])
def test_a_wheel_may_roll_on_bearings_or_slide(friction: float) -> None:
    options = BaselineOptions(20.0, 0.1, 0.1, 0.02)
    wheel = baselines(options, ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]
    for part in wheel.parameters:
        if part.column in ("mu_x", "mu_y"):
            assert abs(math.log(friction) - part.mean) < 2.5 * part.spread
