"""What the page is told: the recording's own numbers, whatever part of it is missing, and strict JSON."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pbrl_bringup.errors import BringupError
from pbrl_bringup.view.decorate import decorated
from pbrl_bringup.view.diagnosed import Diagnosed, Found, Lacking, read_diagnosed
from pbrl_bringup.view.extras import LINE_LIST, LINE_STRIP, Extras
from pbrl_bringup.view.models import told_model
from pbrl_bringup.view.shown import shown_of

sys.path.insert(0, str(Path(__file__).parent))
from view_kit import recorded


def strict(value: object) -> object:
    return json.loads(json.dumps(value, allow_nan=False))


def test_poses_are_those_of_the_bag() -> None:
    recording = recorded()
    shown = shown_of(recording, "bag")
    names = [each["name"] for each in shown.still["objects"]]
    assert names == ["pillar", "still", "table"] and shown.origin == 100.0
    stream = recording.object_poses["table"]
    told = shown.detail(0.0, 1e9, 10_000)["objects"][2]
    assert np.allclose(told["time"], stream.time - 100.0, atol=1e-4)
    assert np.allclose(told["x"], stream.position[:, 0], atol=1e-4)
    assert np.allclose(told["theta"], 0.5 * stream.position[:, 0], atol=1e-4)
    coarse = shown.detail(0.0, 1e9, 30)["objects"][2]
    assert set(zip(coarse["time"], coarse["x"], strict=True)) <= set(zip(told["time"], told["x"], strict=True))


def test_one_sample_among_thousands_is_not_lost() -> None:
    coarse = shown_of(recorded(), "bag").detail(0.0, 12.0, 20)["wrenches"][0]
    assert len(coarse["time"]) == 20 and max(coarse["high"][1]) == 77.0 and min(coarse["low"][0]) == -20.0


def test_the_force_on_the_object_is_the_negative_of_what_the_gripper_feels_in_world_axes() -> None:
    recording = recorded()
    turned = recording.gripper_poses["left"]
    quarter = np.tile([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], (len(turned.time), 1))
    shown = shown_of(replace(recording, gripper_poses={"left": replace(turned, quaternion=quarter)}), "bag")
    x, y = (np.array(column) for column in shown.detail(5.0, 5.1, 1000)["forces"][0]["low"])
    assert np.allclose(y, 20.0, atol=0.01), "it feels -20 N along its x axis, which points along y"
    assert np.all(np.abs(x) <= 1.01)


@pytest.mark.parametrize("missing", ["bodies", "object_poses", "gripper_poses", "wrenches", "grasps"])
def test_what_is_missing_is_left_out(missing: str) -> None:
    whole = recorded()
    shown = shown_of(replace(whole, **{missing: () if missing == "grasps" else {}}), "bag")
    data = strict(shown.data())
    assert len(data["objects"]) == len(data["streams"]["objects"])  # type: ignore[index, call-overload]
    assert len(data["grippers"]) == len(data["streams"]["wrenches"])  # type: ignore[index, call-overload]


def test_numbers_that_are_none_are_null() -> None:
    recording = recorded()
    stream = recording.object_poses["table"]
    unseen = replace(
        recording, object_poses={"table": replace(stream, quaternion=np.full((len(stream.time), 4), np.nan))}
    )
    data = strict(shown_of(unseen, "bag").data())
    table = data["streams"]["objects"][2]  # type: ignore[index, call-overload]
    assert set(table["theta"]) == {None} and None not in table["x"]


def lacking() -> dict[str, object]:
    return {"time": [100.0, 101.0], "wrench": [[3.0, 4.0, 0.1], [0.0, 0.0, 0.0]], "sd": [[1.0] * 3] * 2}


def patch(frame: str) -> Found:
    where = {"frame": frame, "shape": [[0, 0], [1, 0], [1, 1]], "uncertainty": [[0.4, 0.4], [0.6, 0.4], [0.5, 0.6]]}
    named = {"effect": "floor_patch", "probability": 0.98, "where": where, "when": [[103.0, 105.0]]}
    return Found.model_validate({"mismatch": True, "effects": [named], "more": "of it"})


def test_a_diagnosis_is_drawn_where_it_belongs() -> None:
    named = {"table": patch("world"), "still": patch("still"), "gone": patch("world"), "pillar": patch("joint")}
    found = Diagnosed(named, {"table": Lacking.model_validate(lacking())})
    data = decorated(shown_of(recorded(), "bag"), Extras(), {}, found).data()
    strict(data)
    assert [region["object"] for region in data["regions"]] == [None, 1], "what stays, and what moves with the body"
    assert data["regions"][0]["when"] == [[3.0, 5.0]], "on the page's clock"
    assert data["residuals"] == [{"object": 2, "largest": 5.0, "when": [[3.0, 5.0]]}]
    assert data["streams"]["residuals"][0]["low"][0] == [3.0, 0.0]
    assert any("gone" in note for note in data["notes"]) and any("floor_patch (98 %)" in told for told in data["told"])


@pytest.mark.parametrize(
    "found",
    [
        {"effects": [{"effect": "external_force", "probability": 0.9, "when": [[103.0, 105.0]]}]},
        {"unknown": True, "unknown_description": {"when": [[103.0, 105.0]], "sentences": ["a push"]}},
        {"effects": [{"effect": "pose_bias", "probability": 0.9, "when": None}], "unknown_description": None},
    ],
)
def test_what_has_no_place_or_no_name_is_shaded_when_it_acts(found: dict[str, object]) -> None:
    named = {"table": Found.model_validate({"mismatch": True, **found})}
    diagnosed = Diagnosed(named, {"table": Lacking.model_validate(lacking())})
    data = decorated(shown_of(recorded(), "bag"), Extras(), {}, diagnosed).data()
    acts = [] if "pose_bias" in str(found) else [[3.0, 5.0]]
    assert not data["regions"] and data["residuals"] == [{"object": 2, "largest": 5.0, "when": acts}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        ("[]", "expected a report of diagnose"),
        ('{"objects": {"a": {"mismatch": true, "effects": [{"effect": "x", "probability": NaN}]}}}', "probability"),
        ('{"objects": {"a": {}}}', "objects.a.mismatch"),
    ],
)
def test_a_file_that_is_no_report_is_told_in_a_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(BringupError, match=said) as raised:
        read_diagnosed(path)
    assert "\n" not in str(raised.value)


def test_a_wheel_s_cloud_is_that_of_its_draws() -> None:
    draws = np.random.default_rng(1).normal([0.5, 0.3], 0.01, (1000, 2))
    told = told_model("wheel", [("mass", 31.2, 2.0, "kg")], {"wheel_x": draws[:, 0], "wheel_y": draws[:, 1]})
    assert told["told"] == "wheel: mass 31.2 ± 2 kg" and told["hinge"] is None
    assert len(told["wheel"]["draws"]) == 150 and np.allclose(told["wheel"]["mean"], [0.5, 0.3], atol=0.002)
    single = {"wheel_x": np.array([0.5]), "wheel_y": np.array([0.1])}
    assert told_model("wheel", [], single)["wheel"] is None, "one draw is no cloud"


def header(time: float, frame: str = "world") -> SimpleNamespace:
    return SimpleNamespace(stamp=SimpleNamespace(sec=int(time), nanosec=round(time % 1 * 1e9)), frame_id=frame)


def marker(
    kind: int, time: float, xs: list[float], *, action: int = 0, ns: str = "plan", turned: float = 0.0
) -> SimpleNamespace:
    pose = SimpleNamespace(
        position=SimpleNamespace(x=0.0, y=0.0, z=0.0),
        orientation=SimpleNamespace(x=0.0, y=0.0, z=np.sin(turned / 2), w=np.cos(turned / 2)),
    )
    points = [SimpleNamespace(x=x, y=0.0, z=0.0) for x in xs]
    return SimpleNamespace(header=header(time), ns=ns, id=0, type=kind, action=action, points=points, pose=pose)


def test_plans_hold_until_the_next_one() -> None:
    extras = Extras()
    hear = extras.hearers()
    steps = [SimpleNamespace(pose=SimpleNamespace(position=SimpleNamespace(x=x, y=1.0))) for x in (0.0, 1.0)]
    hear["/plan"](SimpleNamespace(header=header(101.5, "map"), poses=steps))
    for k in range(50):  # the same line ten times a second is one plan
        hear["/markers"](SimpleNamespace(markers=[marker(LINE_STRIP, 102 + 0.1 * k, [0.0, 2.0], turned=np.pi / 2)]))
    hear["/markers"](SimpleNamespace(markers=[marker(LINE_LIST, 108.0, [0.0, 3.0])]))
    hear["/markers"](SimpleNamespace(markers=[marker(LINE_LIST, 109.0, [], action=3)]))
    hear["/markers"](SimpleNamespace(markers=[marker(LINE_STRIP, 109.0, [0.0, 3.0], ns="bodies")]))
    plans = extras.plans_since(100.0)
    assert [(each["time"], each["until"], each["pairs"]) for each in plans] == [
        (1.5, None, False),
        (2.0, 8.0, False),
        (8.0, 9.0, True),
    ]
    assert np.allclose(plans[1]["points"], [[0.0, 0.0], [0.0, 2.0]]), "turned as its pose says"


def test_models_and_mismatches_of_a_graph_are_heard() -> None:
    extras, draws = Extras(), np.random.default_rng(0).normal(size=(40, 3))
    fields = {"object": "table", "model_class": "wheel", "parameters": ["mass", "wheel_x", "wheel_y"], "draws": 40}
    numbers = {"units": ["kg", "m", "m"], "mean": [1.0, 2.0, 3.0], "sd": [0.1, 0.1, 0.1]}
    good = SimpleNamespace(**fields, **numbers, samples=draws.ravel())
    cut = SimpleNamespace(**{**fields, "object": "still"}, **numbers, samples=draws.ravel()[:-1])
    extras.hearers()["/object_models"](SimpleNamespace(models=[good, cut]))
    where = [SimpleNamespace(x=0.0, y=0.0, z=0.0)]
    effect = SimpleNamespace(effect="hidden_hinge", probability=0.7, where_frame="world", where=where)
    mismatch = SimpleNamespace(object="table", unknown=False, effects=[effect], report="{broken")
    extras.hearers()["/mismatches"](SimpleNamespace(mismatches=[mismatch]))
    data = decorated(shown_of(recorded(), "bag"), extras).data()
    assert data["objects"][2]["model"]["wheel"] and data["objects"][1]["model"] is None
    assert data["regions"][0]["effect"] == "hidden_hinge 70 %" and any("'still'" in note for note in data["notes"])
