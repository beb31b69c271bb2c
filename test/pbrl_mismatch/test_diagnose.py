"""From a recording to a report: what is named, in what form, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from concealed_cases import concealed

from pbrl_bag import read_recording, write_recording
from pbrl_bag.types import Recording, WrenchStream
from pbrl_mismatch import DiagnoseOptions, Diagnosis, MismatchError, diagnose, track_of
from pbrl_mismatch.diagnose import NOTHING_HELD_OUT
from pbrl_mismatch.report import NOTHING_TRIED
from pbrl_mismatch.search.grip import GripEvidence, grip_evidence
from pbrl_model.errors import ModelError

QUICK = {"draws": 60, "shortlist": 4, "survivors": (2,)}
FEW = ("viscous_drag", "floor_slope", "time_offset", "wrench_bias")


def without_all_but(*names: str) -> tuple[str, ...]:
    return tuple(name for name in DiagnoseOptions().effects if name not in names)


@pytest.fixture(scope="module")
def dragged(concealed_recording: Callable[..., Recording]) -> Recording:
    return concealed_recording("viscous_drag", 1)


@pytest.fixture(scope="module")
def found(dragged: Recording) -> Diagnosis:
    return diagnose(dragged, DiagnoseOptions(without=without_all_but(*FEW), baseline=("free",), **QUICK))


def test_what_was_left_out_is_named_and_the_repair_predicts_better(found: Diagnosis) -> None:
    one = found.objects["table"]
    assert one.mismatch and one.verdict.p_value < 1e-6
    assert [finding.effect for finding in one.effects] == ["viscous_drag"]
    assert one.unexplained_fraction < 0.2 and not one.unknown
    heldout = one.report["heldout"]
    assert heldout["rmse_position_m"]["repaired"] < heldout["rmse_position_m"]["baseline"]
    assert heldout["log_score"]["repaired"] > heldout["log_score"]["baseline"] + 10.0


def test_a_bag_is_diagnosed_as_what_was_written_into_it(dragged: Recording, found: Diagnosis, tmp_path: Path) -> None:
    bag = write_recording(dragged, tmp_path / "dragged")
    options = DiagnoseOptions(without=without_all_but(*FEW), baseline=("free",), **QUICK)
    again, before = diagnose(read_recording(bag), options).objects["table"], found.objects["table"]
    # A bag's stamps are whole nanoseconds and the rest is as it was: nothing but rounding may differ.
    assert [each.effect for each in again.effects] == [each.effect for each in before.effects]
    assert again.hypotheses[0].fitted.evidence == pytest.approx(before.hypotheses[0].fitted.evidence, abs=0.5)
    for one, other in zip(again.effects, before.effects, strict=True):
        for name, told in other.parameters.items():
            assert one.parameters[name]["mean"] == pytest.approx(told["mean"], abs=0.5 * float(told["sd"]))


def test_the_report_has_the_contract_s_form(found: Diagnosis) -> None:
    report = json.loads(json.dumps(found.to_report(), allow_nan=False))
    assert set(report) == {"recording", "objects", "next_experiment", "seconds"}
    assert report["next_experiment"] is None  # one hypothesis has all the odds: no push would tell more
    table = report["objects"]["table"]
    assert set(table) == {
        "mismatch", "p_value", "effects", "alternatives", "unexplained_fraction", "unknown", "heldout", "not_shown",
        "unknown_description", "localisation", "notes",
    }  # fmt: skip
    assert table["notes"] == list(found.objects["table"].notes)
    assert table["unknown_description"] is None
    assert table["localisation"]["sentences"] and len(table["localisation"]["holds"]) == 1
    for entry in table["not_shown"]:
        assert set(entry) == {"effect", "smallest", "plausible", "unit", "chance", "motion"}
        assert entry["effect"] != "viscous_drag"
    for entry in (*table["effects"], *table["alternatives"]):
        assert set(entry) == {"effect", "probability", "parameters", "where", "when", "direction"}
        for values in entry["parameters"].values():
            assert set(values) == {"mean", "sd", "unit"}
    assert set(table["heldout"]) == {"rmse_position_m", "rmse_yaw_rad", "rmse_position_retold_m", "log_score"}
    assert set(table["heldout"]["rmse_position_m"]) == {"baseline", "repaired", "noise_floor"}
    assert 0.0 <= sum(entry["probability"] for entry in table["effects"]) <= 1.0 + 1e-9


def test_the_same_seed_gives_the_same_report_whatever_the_threads(dragged: Recording, found: Diagnosis) -> None:
    options = DiagnoseOptions(without=without_all_but(*FEW), baseline=("free",), workers=1, **QUICK)
    again = diagnose(dragged, options).to_report()["objects"]
    assert json.dumps(again) == json.dumps(found.to_report()["objects"])


@pytest.mark.parametrize(("left", "said"), [(("floor_slope", "time_offset"), "noise floor"), ((), NOTHING_TRIED)])
def test_a_withheld_effect_is_unknown_rather_than_a_wrong_name(
    dragged: Recording, left: tuple[str, ...], said: str
) -> None:
    options = DiagnoseOptions(without=without_all_but(*left), baseline=("free",), **QUICK)
    one = diagnose(dragged, options).objects["table"]
    assert one.mismatch and one.unknown and not one.effects
    assert any(said in note for note in one.notes)
    described = json.loads(json.dumps(one.report["unknown_description"], allow_nan=False))
    assert described["sentences"] and described["share_explained"] > 0.5
    if one.next_push is not None:
        push = one.next_push.to_report()
        assert set(push) == {"object", "contact_point", "direction", "speed", "duration", "expected_bits"}
        assert push["expected_bits"] >= 0.0


def test_a_clean_recording_is_clean(concealed_recording: Callable[..., Recording]) -> None:
    one = diagnose(concealed_recording("clean", 1), DiagnoseOptions(baseline=("free",), **QUICK)).objects["table"]
    assert not one.mismatch and not one.effects and not one.unknown
    assert "agree" in one.notes[0]


def test_where_only_gripper_and_body_part_no_wrench_is_placed_or_described(
    concealed_recording: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    def apart(*told: Any) -> GripEvidence:
        return replace(grip_evidence(*told), p_value=1e-9)

    # The package's `diagnose` is the function.
    monkeypatch.setattr(import_module("pbrl_mismatch.diagnose"), "grip_evidence", apart)
    options = DiagnoseOptions(without=without_all_but("floor_slope"), baseline=("free",), **QUICK)
    one, dragged = (
        diagnose(concealed_recording(effect, 1), options).objects["table"] for effect in ("clean", "viscous_drag")
    )
    assert one.mismatch and one.unknown and one.hold_alone
    assert one.report["localisation"] is None and one.report["unknown_description"] is None
    assert dragged.unknown and not dragged.hold_alone and dragged.report["localisation"] is not None
    for each in (one, dragged):
        assert any("gripper and body are not seen" in note for note in each.notes)


def test_what_could_not_have_shown_is_told_at_the_level_of_the_test(dragged: Recording) -> None:
    few, told = without_all_but("detent"), []
    for level in (0.05, 1e-6):
        options = DiagnoseOptions(without=few, baseline=("free",), level=level, **QUICK)
        told.append(diagnose(dragged, options).objects["table"].report["not_shown"])
    # A test that alarms more seldom notices less; of what does nothing, one at 5 % notices one in twenty.
    (often,), (seldom,) = told
    assert often["effect"] == seldom["effect"] == "detent" and seldom["chance"] < often["chance"] - 0.04


def test_a_hold_that_was_under_way_when_recording_began_is_left_out_and_said(
    concealed_recording: Callable[..., Recording], held_twice: Callable[..., Recording]
) -> None:
    first, second = (concealed_recording("clean", seed) for seed in (3, 1))
    whole, late = held_twice(first, second, 40.0), held_twice(first, second, 40.0, heard_since=6.0)
    assert track_of(whole, "table").unheard == 0
    track = track_of(late, "table")
    assert track.unheard == 1 and len(track.motions) == 1
    assert track.clock[0] >= 40.0
    options = DiagnoseOptions(without=without_all_but("viscous_drag"), baseline=("free",), **QUICK)
    one = diagnose(late, options).objects["table"]
    assert not one.mismatch
    assert any("a hold was under way" in note and "start recording" in note for note in one.notes)


def test_an_object_that_cannot_be_diagnosed_is_refused_beside_one_that_can(
    concealed_recording: Callable[..., Recording], held_twice: Callable[..., Recording]
) -> None:
    whole = held_twice(concealed_recording("clean", 3), concealed_recording("clean", 1), 40.0)
    poses, (first, second) = whole.object_poses["table"], whole.grasps
    still = np.zeros(len(poses.time), dtype=int)
    lost = replace(poses, position=poses.position[still], quaternion=poses.quaternion[still])
    two = replace(
        whole,
        bodies={**whole.bodies, "chair": replace(whole.bodies["table"], name="chair")},
        object_poses={**whole.object_poses, "chair": lost},
        grasps=(replace(first, object="chair"), second),
    )
    options = DiagnoseOptions(without=without_all_but("viscous_drag"), baseline=("free",), **QUICK)
    found = diagnose(two, options)
    assert set(found.objects) == {"table"} and set(found.refused) == {"chair"}
    assert found.to_report()["refused"]["chair"] == found.refused["chair"]
    assert "chair: expected poses that change" in found.refused["chair"]
    with pytest.raises((MismatchError, ModelError), match="chair"):
        diagnose(two, options.model_copy(update={"objects": ("chair", "table")}))


def test_a_name_that_no_forecast_was_put_to_says_so(dragged: Recording, found: Diagnosis) -> None:
    options = DiagnoseOptions(without=without_all_but(*FEW), baseline=("free",), block=12.0, **QUICK)
    one = diagnose(dragged, options).objects["table"]
    assert one.effects and one.report["heldout"]["rmse_position_m"]["baseline"] is None
    assert NOTHING_HELD_OUT in one.notes and NOTHING_HELD_OUT not in found.objects["table"].notes


def test_a_soft_hold_is_named_though_the_motion_does_not_show_it(concealed_recording: Callable[..., Recording]) -> None:
    recording = concealed_recording("grasp_compliance", 1)
    few = without_all_but("grasp_compliance", "time_offset", "viscous_drag")
    one = diagnose(recording, DiagnoseOptions(without=few, baseline=("free",), **QUICK)).objects["table"]
    assert [finding.effect for finding in one.effects] == ["grasp_compliance"]
    found = one.effects[0].parameters["grip_compliance"]
    give = concealed("grasp_compliance", np.random.default_rng([1, 7]))["give"]
    assert abs(found["mean"] - give) < 3.5 * found["sd"] < give
    assert not any("not seen as one that holds" in note for note in one.notes)
    without = without_all_but("floor_slope", "viscous_drag")
    one = diagnose(recording, DiagnoseOptions(without=without, baseline=("free",), **QUICK)).objects["table"]
    assert one.unknown and "not seen as one that holds" in one.notes[1]
    assert "how it moves goes with the model" in one.notes[1]


def test_bad_input_is_refused_in_one_line(dragged: Recording) -> None:
    silent = WrenchStream(
        dragged.wrenches["left"].time,
        np.zeros((len(dragged.wrenches["left"].time), 3)),
        np.zeros((len(dragged.wrenches["left"].time), 3)),
    )
    still = dragged.object_poses["table"]
    still = replace(
        still,
        position=np.repeat(still.position[:1], len(still.time), 0),
        quaternion=np.repeat(still.quaternion[:1], len(still.time), 0),
    )
    cases = (
        (replace(dragged, grasps=()), DiagnoseOptions(), "grasp"),
        (dragged, DiagnoseOptions(objects=("chair",)), "chair"),
        (replace(dragged, wrenches={"left": silent}), DiagnoseOptions(), "sensor"),
        (replace(dragged, wrenches={}), DiagnoseOptions(), "left"),
        (replace(dragged, object_poses={"table": still}), DiagnoseOptions(), "change"),
    )
    for recording, options, word in cases:
        with pytest.raises((MismatchError, ModelError, KeyError), match=word) as error:
            diagnose(replace(recording, path=Path("a bag")), options)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "options",
    [
        {"level": 0.0},
        {"windows": (2.0, 1.0)},
        {"without": ("teter",)},
        {"baseline": ("wheels",)},
        {"levl": 0.1},
        {"candidates": 0},
        {"iterations": (3, 5, 8)},
        {"most_together": 4},
        {"models": 3},
        {"grasp_spread": -0.1},
        {"outline_spread": float("nan")},
        {"baseline": ()},
    ],
)
def test_bad_options_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(MismatchError, match=r"expected|did you mean|greater|less|valid|finite"):
        DiagnoseOptions(**options)
