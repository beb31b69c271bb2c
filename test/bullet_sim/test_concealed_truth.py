"""The truth in numbers: what is told to whoever scores is what was built."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.concealed.truth import baseline_truth, effect_truth
from bullet_sim.errors import SimError

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [1.0, 2.0, 0.5]}
BOX = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]
WHEEL = {"position": [0.1, 0.3], "heading": 0.2, "load": 60.0, "sliding_friction": 0.5, "rolling_resistance": 0.002}


def test_a_body_is_told_in_the_models_terms(lab: Any) -> None:
    scene = lab.scene({"table_a": PLAIN}, concealed={"mass": {"table_a": 25.0}, "wheel": {"table_a": WHEEL}})
    truth = baseline_truth(scene, "table_a")
    weight = 25 * GRAVITY
    assert truth == pytest.approx(
        {
            "mass": 25.0,
            "wheel_x": 0.1,
            "wheel_y": 0.3,
            "wheel_theta": 0.2,
            "mu_x": 0.002 / 0.05 * 60 / weight,
            "mu_y": 0.5 * 60 / weight,
        }
    )
    assert baseline_truth(lab.scene({"table_a": PLAIN}), "table_a") == {"mass": 30.0}


def test_every_effect_is_told_under_the_key_of_its_activity(lab: Any) -> None:
    concealed = {
        "second_wheel": {"table_a": WHEEL},
        "com_offset": {"table_a": {"mass": 6.0, "place": [0.2, -0.1]}},
        "hidden_hinge": {"table_a": {"point": [0.3, 0.4]}},
        "floor_slope": {"angle": 0.02, "heading": math.pi / 2},
        "hidden_obstacle": [{"polygon": BOX, "pose": [4.0, 0.0, 0.0]}],
        "wrench_bias": {"left": {"force": [1.0, 0.0, 0.0]}},
    }
    scene = lab.scene({"table_a": PLAIN}, concealed=concealed)
    truth, world = effect_truth(scene), lab.world(scene)
    assert set(truth) == {effect.key for effect in world.effects}
    assert truth["second_wheel.table_a"]["mu_y"] == pytest.approx(0.5 * 60 / (30 * GRAVITY))
    assert truth["com_offset.table_a"]["com_x"] == pytest.approx(0.04)
    hinge = next(effect for effect in world.effects if effect.name == "hidden_hinge")
    told = truth["hidden_hinge.table_a"]
    assert (told["hinge_x"], told["hinge_y"]) == pytest.approx(hinge.pivot, abs=1e-6)
    assert truth["floor_slope.room"]["slope_y"] == pytest.approx(math.tan(0.02))
    assert truth["hidden_obstacle.0"]["pose"] == (4.0, 0.0, 0.0)


def test_what_is_not_there_is_a_one_line_error(lab: Any) -> None:
    fixture = {"kind": "fixture", "polygon": BOX, "height": 1.0, "pose": [4.0, 0.0, 0.0]}
    scene = lab.scene({"table_a": PLAIN, "pillar": fixture})
    with pytest.raises(SimError, match="'table_b' is not in the scene; did you mean 'table_a'"):
        baseline_truth(scene, "table_b")
    with pytest.raises(SimError, match="'pillar': expected one that can move"):
        baseline_truth(scene, "pillar")
