"""A catch is placed where it is, and nothing is named where there is none."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from doors_pulled import bump, noise, opened, pulled, texture

from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.joint.diagnosis import diagnose_pull
from pbrl_mismatch.joint.heldout import correlation_length, in_blocks, noise_of
from pbrl_mismatch.joint.laws import LAWS, laws_of
from pbrl_mismatch.joint.significance import p_value
from pbrl_mismatch.options import DiagnoseOptions

OPTIONS = DiagnoseOptions(baseline=("hinge",))
CATCH = tuple(law for law in LAWS if law.effect == "detent")


@pytest.mark.parametrize(("at", "width", "force"), [(3.0, 1.0, 6.0), (12.0, 5.0, 3.0), (60.0, 2.0, 3.0)])
def test_a_catch_is_named_and_placed_within_its_uncertainty(at: float, width: float, force: float) -> None:
    angle = opened()
    pull = pulled(0.6 + force * bump(angle, at, width) + noise(np.random.default_rng(5), angle), angle)
    found = diagnose_pull(np.random.default_rng(0), pull, OPTIONS)
    assert found.mismatch and [each.effect for each in found.effects] == ["detent"]
    place = found.effects[0].parameters["detent_angle"]
    off = abs(math.degrees(float(place["mean"])) - at)
    assert off < 3.0 * math.degrees(float(place["sd"])) and off < 3.0
    assert abs(float(found.effects[0].parameters["detent_force"]["mean"]) - force) < 0.25 * force
    where = found.report["effects"][0]["where"]
    assert where["frame"] == "joint" and where["shape"][0][0] < math.radians(at) < where["shape"][1][0]
    assert found.blocks.rmse_after < 0.6 * found.blocks.rmse_before


def test_a_stiff_stretch_is_told_with_its_place_and_a_width_with_the_mean_of_what_is_above_zero() -> None:
    angle = opened()
    stiff = 4.0 * ((angle > math.radians(20.0)) & (angle < math.radians(28.0)))
    pull = pulled(0.6 + stiff + noise(np.random.default_rng(5), angle), angle)
    others = tuple(dict.fromkeys(law.effect for law in LAWS if law.effect != "floor_patch"))
    found = diagnose_pull(np.random.default_rng(0), pull, OPTIONS.model_copy(update={"without": others}))
    assert [each.effect for each in found.effects] == ["floor_patch"]
    told = re.search(r"floor_patch at (\S+) ± \S+ degrees left out", found.notes[0])
    assert told is not None and float(told[1]) == pytest.approx(20.0, abs=1.0)
    best = found.repaired
    k = [each.name for each in best.problem.unknowns].index("patch_width")
    value, spread = float(best.values[k]), math.sqrt(best.covariance[k, k])
    width = found.effects[0].parameters["patch_width"]
    assert width["mean"] == pytest.approx(value * math.exp(0.5 * spread**2), rel=1e-9)
    draws = value * np.exp(spread * np.random.default_rng(1).standard_normal(100_000))
    assert width["sd"] == pytest.approx(draws.std(), rel=0.02)


def test_p_values_of_doors_without_a_catch_are_uniform() -> None:
    angle = opened(60.0, 0.5)
    chances = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        length, strength = rng.uniform(1.5, 8.0), rng.uniform(0.05, 0.4)
        force = 1.0 + texture(rng, angle, strength, length) + 0.1 * rng.standard_normal(len(angle))
        chances.append(p_value(rng, pulled(force, angle), laws_of(), drawn=79))
    found = np.array(chances)
    # Of 60 at the 5 % level: more than 8 has a chance below 0.5 %.
    assert np.sum(found < 0.05) <= 8
    edges = np.sort(found)
    steps = np.arange(1, len(edges) + 1) / len(edges)
    assert np.max(np.abs(edges - steps)) < 1.63 / math.sqrt(len(edges))  # Kolmogorov, 1 %


def test_without_a_catch_nothing_is_named_and_the_report_says_so() -> None:
    angle = opened()
    pull = pulled(0.6 + noise(np.random.default_rng(8), angle), angle)
    found = diagnose_pull(np.random.default_rng(0), pull, OPTIONS)
    assert not found.mismatch and not found.effects and not found.report["effects"]
    assert found.repaired is found.baseline and "agree" in found.notes[0]
    told = found.report["heldout"]["rmse_force_N"]
    assert told["baseline"] == told["repaired"]


def test_without_the_catch_in_the_library_it_is_not_named() -> None:
    angle = opened()
    pull = pulled(0.6 + 6.0 * bump(angle, 30.0, 1.5) + noise(np.random.default_rng(5), angle), angle)
    found = diagnose_pull(np.random.default_rng(0), pull, OPTIONS.model_copy(update={"without": ("detent",)}))
    assert found.mismatch and "detent" not in {each.effect for each in (*found.effects, *found.alternatives)}


def test_same_seed_same_report() -> None:
    angle = opened(40.0, 0.5)
    pull = pulled(0.6 + 4.0 * bump(angle, 8.0, 2.0) + noise(np.random.default_rng(6), angle), angle)
    one, two = (diagnose_pull(np.random.default_rng(7), pull, OPTIONS).report for _ in range(2))
    assert one == two


def test_a_block_is_predicted_by_a_fit_that_never_saw_it() -> None:
    angle = opened(40.0)
    pull = pulled(0.6 + noise(np.random.default_rng(9), angle), angle)
    changed = pull.force.copy()
    first = in_blocks(pull, CATCH[:1], offsets=1)
    changed[first.out] += 50.0
    other = in_blocks(pulled(changed, angle), CATCH[:1], offsets=1)
    assert np.array_equal(first.after[first.out], other.after[first.out])
    assert np.array_equal(first.before[first.out], other.before[first.out])
    assert not np.allclose(first.before[~first.out], other.before[~first.out], atol=1.0)


def test_noise_of_neighbours_is_told() -> None:
    angle = opened()
    pull = pulled(3.0 * bump(angle, 40.0, 10.0) + 0.1 * np.random.default_rng(1).standard_normal(len(angle)), angle)
    assert noise_of(pull) == pytest.approx(0.1, rel=0.25)


def test_a_library_without_effects_is_refused() -> None:
    everything = tuple(dict.fromkeys(law.effect for law in LAWS))
    angle = opened()
    with pytest.raises(MismatchError, match="expected at least one effect"):
        diagnose_pull(
            np.random.default_rng(0),
            pulled(np.ones(len(angle)), angle),
            OPTIONS.model_copy(update={"without": everything}),
        )


@pytest.mark.parametrize("degrees", [6.0, 20.0, 90.0])
def test_how_far_the_rest_is_alike_does_not_hang_on_a_second_hold(degrees: float) -> None:
    found = []
    for seed in range(30):
        rng, first, second = np.random.default_rng(seed), opened(90.0), opened(degrees)
        rough = [texture(rng, each, length=5.0) for each in (first, second)]
        one, other = pulled(rough[0], first), pulled(rough[1], second)
        both = {
            name: np.concatenate([getattr(one, name), getattr(other, name)])
            for name in ("angle", "force", "across", "speed", "sense", "travelled")
        }
        number = np.repeat([0, 1], [len(first), len(second)])
        time = np.concatenate([one.time, other.time + one.time[-1] + 60.0])
        pull = replace(one, **both, time=time, number=number)
        found.append(np.degrees(correlation_length(pull, pull.force)))
    assert 3.0 < np.median(found) < 7.0
