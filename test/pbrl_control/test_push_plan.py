"""Push plans: the shipped ones load, hostile ones are refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pbrl_control.errors import ControlError
from pbrl_control.push_plan import PushPlan, load_plan

GOOD = {
    "name": "p",
    "object": "table",
    "grips": [{"gripper": "left", "point": [-0.375, 0.4]}],
    "segments": [{"twist": [0.1, 0, 0], "duration": 2.0}],
}


def plan_file(folder: Path, **changes: object) -> Path:
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return path


def test_a_plan_that_says_little_has_defaults(tmp_path: Path) -> None:
    plan = load_plan(plan_file(tmp_path))
    assert plan.segments[0].frame == "gripper"
    assert plan.push_time == 2.0


def test_every_plan_of_the_workspace_loads_and_is_named_after_its_file(root: Path) -> None:
    paths = sorted((root / "config/params/pushes").glob("*.yaml"))
    assert {path.stem for path in paths} >= {"turn_table", "turn_table_heldout", "push_straight"}
    for path in paths:
        plan = load_plan(path)
        assert plan.name == path.stem
        assert plan.limits.force < 320.0, "rubber on laminate slips there"


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"segmnts": []}, "did you mean 'segments'?"),
        ({"segments": []}, "segments: "),
        ({"segments": [{"twist": [0.1, 0.0], "duration": 1.0}]}, "segments.0.twist.2"),
        ({"segments": [{"twist": [0.1, float("nan"), 0.0], "duration": 1.0}]}, "segments.0.twist.1"),
        ({"segments": [{"twist": [5.0, 0.0, 0.0], "duration": 1.0}]}, "expected at most 0.5 m/s"),
        ({"segments": [{"twist": [0.1, 0.0, 0.0], "duration": 0.0}]}, "segments.0.duration"),
        ({"segments": [{"twist": [0.1, 0, 0], "duration": 1, "frame": "world"}]}, "segments.0.frame"),
        ({"grips": []}, "grips: "),
        ({"grips": [{"gripper": "middle", "point": [0, 0]}]}, "grips.0.gripper"),
        ({"grips": [{"gripper": "left", "point": [0, 0]}] * 2}, "each gripper once"),
        ({"approach": {"speed": 3.0}}, "approach.speed"),
        ({"limits": {"force": float("inf")}}, "limits.force"),
        ({"acceleration": -1.0}, "acceleration: "),
    ],
)
def test_a_hostile_plan_is_refused_in_one_line(tmp_path: Path, changes: dict, complaint: str) -> None:
    with pytest.raises(ControlError) as caught:
        load_plan(plan_file(tmp_path, **changes))
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_plan_of_no_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ControlError, match="got 'turn_tabel'"):
        load_plan("turn_tabel")


def test_plans_do_not_change() -> None:
    plan = PushPlan.model_validate(GOOD)
    with pytest.raises(ValueError, match="frozen"):
        plan.name = "q"  # type: ignore[misc]
