"""Scores of a diagnosis: closed forms, and reports made by hand."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from pbrl_bringup.benches.concealed_figures import confusion, draw_all
from pbrl_bringup.benches.concealed_rows import interval, mean_interval, median_interval, rows_of
from pbrl_bringup.concealed.localisation import Localised, claimed_by_report, f1, localise
from pbrl_bringup.concealed.places import border_error, moment_error, parameter_bias, place_error
from pbrl_bringup.concealed.scoring import (
    Comparison,
    Oracle,
    RivalScore,
    Score,
    failed_score,
    intersection_over_union,
    read_score,
    score,
)
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.files import without_nan
from pbrl_bringup.rivals.samples import Samples, regimes_of

TOLD = {"tether_x": 1.0, "tether_y": 2.0, "tether_stiffness": 50.0}
TRUTH = Truth(("tether",), "table", {}, {"tether": [(2.0, 4.0)]}, {"tether": []}, 0.7, {"tether": 0.3}, TOLD)
PATCH = [(1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)]


def report(named: list[str], others: list[str], when: list[list[float]] | None = None, **more: Any) -> dict[str, Any]:
    parameters = {
        "tether_x": {"mean": 1.03, "sd": 0.02, "unit": "m"},
        "tether_y": {"mean": 2.04, "sd": 0.02, "unit": "m"},
        "tether_stiffness": {"mean": 55.0, "sd": 10.0, "unit": "N/m"},
    }
    entries = [{"effect": n, "probability": 0.5, "when": when, "where": None, "parameters": parameters} for n in named]
    told = {
        "mismatch": bool(named or others),
        "p_value": 0.001,
        "effects": entries,
        "alternatives": [{"effect": name, "probability": 0.1, "when": None} for name in others],
        "unknown": False,
        "heldout": {
            "rmse_position_m": {"baseline": 0.05, "repaired": 0.01, "noise_floor": None},
            "rmse_position_retold_m": {"baseline": 0.012, "repaired": 0.006, "noise_floor": None},
        },
    }
    return {"objects": {"table": told | more}}


def walk() -> Samples:
    """A body with one foot that goes along x with 0.1 m/s for 40 s, in samples of 0.1 s."""
    time = 0.1 * np.arange(400)
    state = np.zeros((400, 6))
    state[:, 0], state[:, 3] = 0.1 * time, 0.1
    return Samples(np.arange(400), time, state, state[:, None, :2].copy(), np.ones(400, dtype=bool))


def scored(named: list[str], others: list[str], **more: Any) -> Score:
    return score("one", TRUTH, report(named, others, **more), TRUTH.seal(), 3.0, group="single")


@pytest.mark.parametrize(
    ("named", "others", "first", "in_two", "in_three"),
    [
        (["tether"], [], True, True, True),
        (["detent"], ["tether"], False, True, True),
        (["detent"], ["sloshing_load", "tether"], False, False, True),
        ([], ["tether"], False, True, True),
        ([], [], False, False, False),
    ],
)
def test_named_first_and_among_two(
    named: list[str], others: list[str], first: bool, in_two: bool, in_three: bool
) -> None:
    found = scored(named, others)
    assert (found.first, found.in_two, found.in_three) == (first, in_two, in_three)


def test_overlap_in_time() -> None:
    assert intersection_over_union([(0.0, 1.0)], [(0.5, 1.5)]) == pytest.approx(1 / 3, abs=0.02)
    assert intersection_over_union([(0.0, 1.0)], [(0.0, 1.0)]) == 1.0
    assert intersection_over_union([(0.0, 1.0)], [(2.0, 3.0)]) == 0.0
    assert intersection_over_union([], []) == 0.0
    assert scored(["tether"], [], when=[[3.0, 4.0]]).overlap == pytest.approx(0.5, abs=0.02)


def test_f1_is_the_harmonic_mean_of_precision_and_recall() -> None:
    claimed, true = np.array([1, 1, 1, 0, 0], bool), np.array([0, 1, 1, 1, 1], bool)
    precision, recall = 2 / 3, 2 / 4
    assert f1(claimed, true) == pytest.approx(2 * precision * recall / (precision + recall))
    assert f1(true, true) == 1.0 and f1(~true, true) == 0.0 and f1(np.zeros(3, bool), np.zeros(3, bool)) == 1.0


def test_a_claim_that_is_the_truth_scores_one_and_nothing_claimed_scores_nothing() -> None:
    samples = walk()
    regimes = regimes_of(samples)
    truth = replace(TRUTH, effects=("floor_patch",), when={"floor_patch": [(10.0, 20.0)]}, place={"floor_patch": PATCH})
    right = localise(truth, samples, regimes, samples.inside([(10.0, 20.0)]), [np.array(PATCH)])
    assert (right.time, right.region, right.overlap) == (1.0, 1.0, 1.0)
    nothing = localise(truth, samples, regimes, samples.inside([]))
    assert (nothing.time, nothing.region, nothing.overlap) == (0.0, 0.0, 0.0)
    assert all(
        math.isnan(each)
        for each in asdict(localise(replace(TRUTH, effects=()), samples, regimes, samples.moving)).values()
    )
    half = localise(truth, samples, regimes, samples.inside([(10.0, 14.9)]))
    assert half.time == pytest.approx(2 / 3, abs=0.02) and half.overlap == pytest.approx(0.5, abs=0.02)


def test_what_has_no_name_is_claimed_when_it_is_surely_there() -> None:
    samples = walk()
    nothing = report([], [])["objects"]["table"]
    described = nothing | {"unknown_description": {"when": [[10.0, 20.0]]}}
    claimed, outlines = claimed_by_report(described, samples)
    np.testing.assert_array_equal(claimed, samples.inside([(10.0, 20.0)]))
    assert not outlines and not claimed_by_report(nothing, samples)[0].any()


def test_the_border_is_compared_where_it_was_crossed() -> None:
    feet, patch = walk().feet, np.array(PATCH)
    assert border_error(feet, patch, patch) == pytest.approx(0.0, abs=1e-12)
    assert border_error(feet, patch, patch + np.array([0.04, 0.0])) == pytest.approx(0.04)
    assert border_error(feet, patch, patch + np.array([0.0, 0.3])) == pytest.approx(
        0.0, abs=1e-12
    )  # no foot was there to see it
    assert border_error(feet, patch, patch + np.array([0.0, 50.0])) == math.inf


@pytest.mark.parametrize(("along", "expected"), [(1e-4, 0.03), (0.2, 0.5)])
def test_a_wheel_that_rolls_freely_is_compared_across_its_axle(along: float, expected: float) -> None:
    turn, told = 0.4, {"wheel2_x": 0.1, "wheel2_y": 0.2, "wheel2_mu_x": along, "wheel2_mu_y": 0.2}
    truth = replace(TRUTH, effects=("second_wheel",), told=told | {"wheel2_theta": turn})
    c, s = math.cos(turn), math.sin(turn)
    off = 0.03 * np.array([c, s]) + math.sqrt(0.25 - 0.03**2) * np.array(
        [-s, c]
    )  # half a metre, most of it on its axle
    entry = {"parameters": {"wheel2_x": {"mean": 0.1 + off[0]}, "wheel2_y": {"mean": 0.2 + off[1]}}}
    assert place_error("second_wheel", truth, entry, walk(), np.array(PATCH)) == pytest.approx(expected)


def test_places_moments_and_bias_of_what_was_named_right() -> None:
    entry = report(["tether"], [])["objects"]["table"]["effects"][0]
    assert place_error("tether", TRUTH, entry, walk(), np.array(PATCH)) == pytest.approx(0.05)
    bias = parameter_bias(TRUTH, entry)
    assert bias["tether_stiffness"] == pytest.approx((0.1, 0.5)) and bias["tether_x"] == pytest.approx((0.03, 1.5))
    load = replace(TRUTH, effects=("payload_change",), told={"payload_time": 7.0})
    moment = {"parameters": {"payload_time": {"mean": 6.9, "sd": 0.1, "unit": "s"}}, "when": None}
    assert moment_error("payload_change", load, moment) == pytest.approx(0.1)
    met = replace(TRUTH, effects=("unseen_body",), when={"unseen_body": [(3.0, 5.0)]})
    assert moment_error("unseen_body", met, {"parameters": {}, "when": [[3.25, 4.0]]}) == pytest.approx(0.25)
    assert math.isnan(moment_error("unseen_body", met, {"parameters": {}, "when": None}))
    assert math.isnan(moment_error("tether", TRUTH, entry))


@pytest.mark.parametrize(
    ("column", "turn", "wrapped"),
    [
        ("sensor_turn", math.pi, math.pi),
        ("caster_heading", -0.9 * math.pi, -0.9 * math.pi),
        ("tag_theta", 2.0 * math.pi, 0.0),
        ("wheel2_theta", math.pi, 0.0),
        ("patch_theta", 0.5 * math.pi, 0.5 * math.pi),
        ("obstacle_angle", 0.5 * math.pi, 0.0),
    ],
)
def test_an_angle_is_off_by_as_much_as_turns_it_into_what_looks_the_same(
    column: str, turn: float, wrapped: float
) -> None:
    truth = replace(TRUTH, told={column: 0.4})
    entry = {"parameters": {column: {"mean": 0.4 + turn, "sd": 0.1, "unit": "rad"}}}
    (relative, in_sds) = parameter_bias(truth, entry)[column]
    assert abs(in_sds) == pytest.approx(abs(wrapped) / 0.1, abs=1e-9)
    assert relative * 0.4 == pytest.approx(in_sds * 0.1)


def test_gain_strength_and_abstention_against_an_oracle() -> None:
    told = score("one", TRUTH, report(["tether"], []), TRUTH.seal(), 3.0, oracle=Oracle(0.01, 60.0, 3.0))
    assert told.gain == pytest.approx(1.0) and told.times_detectable == pytest.approx(3.0)
    wrong = score("one", TRUTH, report(["detent"], []), TRUTH.seal(), 3.0, oracle=Oracle(0.0095, 9.0))
    assert wrong.abstained  # it predicts as well as the oracle
    assert not replace(wrong, oracle=0.005).abstained
    assert replace(wrong, oracle=0.005, named=(), unknown=True).abstained
    assert math.isnan(scored(["tether"], []).gain) and math.isnan(scored(["tether"], []).times_detectable)


@pytest.mark.parametrize("named", [["tether"], []])
def test_a_score_survives_json(named: list[str]) -> None:
    samples = walk()
    comparison = Comparison(samples, regimes_of(samples), np.array(PATCH))
    claim = {"rival": "refit", "when": [[2.0, 3.0]], "regimes": {}, "heldout": None, "seconds": 1.0}
    found = score(
        "one", TRUTH, report(named, [], when=[[2.0, 4.0]]), "seal", 3.0, comparison=comparison, claims=[claim]
    )
    again = read_score(json.loads(json.dumps(without_nan(asdict(found)), allow_nan=False)))
    assert str(again) == str(found)
    assert found.rivals["refit"].time == pytest.approx(2 / 3, abs=0.05)
    far = replace(found, places={"floor_patch": math.inf})
    assert read_score(json.loads(json.dumps(without_nan(asdict(far))))).places == {"floor_patch": math.inf}


@pytest.mark.parametrize(("hits", "count"), [(0, 10), (3, 10), (10, 10)])
def test_intervals_are_exact(hits: int, count: int) -> None:
    found = binomtest(hits, count).proportion_ci(0.95, method="exact")
    assert interval(hits, count) == f"{found.low:.3f} to {found.high:.3f}"
    assert interval(0, 0) == "0 to 1"


def many() -> list[Score]:
    clean = Truth((), "table", {}, {}, {}, 0.0, {})
    silent = score("clean", clean, report([], [], p_value=0.4), clean.seal(), 2.0, group="clean")
    alarm = score("clean2", clean, report(["detent"], []), clean.seal(), 2.0, group="clean")
    at = Localised(0.9, math.nan, 0.8, 0.8)
    beside = {"LISDD": RivalScore(0.5, math.nan, 0.4, 0.4, 0.04, 1.0)}
    right = replace(scored(["tether"], []), located=at, rivals=beside, oracle=0.01, times_detectable=4.0, share=0.3)
    wrong = replace(
        scored(["detent"], ["tether"]), located=at, rivals=beside, oracle=0.01, times_detectable=0.4, share=0.3
    )
    gone = replace(scored([], ["detent"], unknown=True), set="withheld", withheld=("tether",))
    broken = failed_score("broken", TRUTH, "seal", "ERROR: no", "single", ())
    return [silent, alarm, right, wrong, gone, broken]


def test_rows_say_what_was_measured() -> None:
    rows = {row.what: row for row in rows_of(many())}
    assert rows["false alarms on 2 clean recordings at the 5 % level, share"].value == 0.5
    assert rows["single: effect named first, share of 3 recordings"].value == pytest.approx(1 / 3)
    assert rows["single: effect among the first two, share of 3 recordings"].value == pytest.approx(2 / 3)
    strong = rows["single: effect named first at 3 times the detectable strength, share of 1 recordings"]
    assert strong.value == 1.0 and strong.holds and strong.against["weaker_than_an_oracle_detects"] == 1
    what = "position error of held-out forecasts before over after, where named right, median of 1"
    assert rows[what].value == pytest.approx(5.0) and rows[what].against["LISDD"] == pytest.approx(1.25)
    assert rows["withheld: unknown, or a name that predicts as well as the oracle, share of 1 recordings"].value == 1.0
    # Who ended with an error has found nothing, where there was something to be found.
    time = rows["localisation F1 (time) of effects that act for part of the time, mean of 3"]
    assert time.value == pytest.approx(0.6) and time.against["LISDD"] == pytest.approx(0.5)
    over = "localisation F1 (time) of effects that act for part of the time: over the best of the four beside it"
    assert (
        rows[f"{over}, mean of 2"].value == pytest.approx(0.4) and rows[f"{over}, mean of 2"].against["best"] == "LISDD"
    )
    spent = rows["CPU time of a diagnosis, without its start and its page, median of 5"]
    assert spent.against["failed"] == 1 and spent.value == 3.0 and spent.against["LISDD"] == 1.0
    bias = rows["strength of what is named right, off over the true one, median of 1"]
    assert bias.value == pytest.approx(0.1) and bias.goal == "none" and bias.holds
    assert bias.against["all_parameters"] == pytest.approx(0.03)
    # Of a place by 1.5 and 2 standard deviations, of the stiffness by half of one.
    assert bias.against["standard_deviations"] == pytest.approx(1.5)
    assert bias.against["share_within_two"] == pytest.approx(2 / 3) and bias.against["interval"] == "-inf to inf"


@pytest.mark.parametrize("count", [6, 9, 40])
def test_a_median_s_interval_covers_it_as_often_as_it_says(count: int) -> None:
    rng = np.random.default_rng(count)
    ends = [
        [float(end) for end in median_interval(rng.exponential(size=count).tolist()).split(" to ")] for _ in range(2000)
    ]
    covered = np.mean([low <= math.log(2.0) <= high for low, high in ends])
    assert 0.94 < covered < 0.995
    assert median_interval([1.0, 2.0, math.nan]) == "-inf to inf"


def test_a_mean_s_interval_is_about_it_and_the_same_each_time() -> None:
    values = [*np.random.default_rng(1).normal(0.5, 0.1, 100).tolist(), math.nan]
    low, high = (float(end) for end in mean_interval(values).split(" to "))
    assert low < 0.5 < high and high - low == pytest.approx(4.0 * 0.1 / 10.0, rel=0.2)
    assert mean_interval(values) == mean_interval(values) and mean_interval([1.0]) == "-inf to inf"


def test_figures_are_drawn(tmp_path: Path) -> None:
    draw_all(many(), tmp_path)
    for name in ("figure", "p_values", "strength", "heldout"):
        assert (tmp_path / f"{name}.png").stat().st_size > 8_000
    assert confusion(many()[:1]).axes
