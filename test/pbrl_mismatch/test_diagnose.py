"""From a recording to a report: what is named, in what form, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag.types import Recording, WrenchStream
from pbrl_mismatch import DiagnoseOptions, Diagnosis, MismatchError, diagnose
from pbrl_model.errors import ModelError

QUICK = {"keep": (3, 2, 1), "draws": 60, "survivors": (4, 2)}
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


def test_the_report_has_the_contract_s_form(found: Diagnosis) -> None:
    report = json.loads(json.dumps(found.to_report(), allow_nan=False))
    assert set(report) == {"recording", "objects", "next_experiment", "seconds"}
    assert report["next_experiment"] is None
    table = report["objects"]["table"]
    assert set(table) == {
        "mismatch", "p_value", "effects", "alternatives", "unexplained_fraction", "unknown", "heldout"
    }  # fmt: skip
    for entry in (*table["effects"], *table["alternatives"]):
        assert set(entry) == {"effect", "probability", "parameters", "where", "when", "direction"}
        for values in entry["parameters"].values():
            assert set(values) == {"mean", "sd", "unit"}
    assert set(table["heldout"]) == {"rmse_position_m", "rmse_yaw_rad", "log_score"}
    assert set(table["heldout"]["rmse_position_m"]) == {"baseline", "repaired", "noise_floor"}
    assert 0.0 <= sum(entry["probability"] for entry in table["effects"]) <= 1.0 + 1e-9


def test_the_same_seed_gives_the_same_report_whatever_the_threads(dragged: Recording, found: Diagnosis) -> None:
    options = DiagnoseOptions(without=without_all_but(*FEW), baseline=("free",), workers=1, **QUICK)
    again = diagnose(dragged, options).to_report()["objects"]
    assert json.dumps(again) == json.dumps(found.to_report()["objects"])


def test_a_withheld_effect_is_unknown_rather_than_a_wrong_name(dragged: Recording) -> None:
    options = DiagnoseOptions(without=without_all_but("floor_slope", "time_offset"), baseline=("free",), **QUICK)
    one = diagnose(dragged, options).objects["table"]
    assert one.mismatch and one.unknown and not one.effects
    assert any("noise floor" in note for note in one.notes)


def test_a_clean_recording_is_clean(concealed_recording: Callable[..., Recording]) -> None:
    one = diagnose(concealed_recording("clean", 1), DiagnoseOptions(baseline=("free",), **QUICK)).objects["table"]
    assert not one.mismatch and not one.effects and not one.unknown
    assert "agree" in one.notes[0]


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
        {"baseline": ()},
    ],
)
def test_bad_options_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(MismatchError, match=r"expected|did you mean|greater"):
        DiagnoseOptions(**options)
