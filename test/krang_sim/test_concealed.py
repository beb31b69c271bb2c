"""Krang in a scene with something concealed: its sensors have the faults, its topics tell nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bullet_sim.scene import Scene, load_scene
from krang_sim.known import known_scene
from krang_sim.observations import KnownScene, TagReading, WristReading
from krang_sim.session import KrangSession

SCENES = Path(__file__).resolve().parents[2] / "config" / "scenes"
BOX = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]


def scene_with(concealed: dict[str, Any]) -> Scene:
    scene = load_scene(SCENES / "tethered_table.yaml")
    return Scene.model_validate(scene.model_dump() | {"concealed": concealed})


def observed(scene: Scene, seconds: float = 0.5) -> list[Any]:
    with KrangSession(scene, seed=2) as session:
        return [seen for _ in range(round(seconds * 400)) for seen in session.step()]


@pytest.mark.parametrize(
    "concealed",
    [
        {"hidden_obstacle": [{"polygon": BOX, "pose": [3.0, 1.0, 0.0]}]},
        {"unseen_body": [{"polygon": BOX, "pose": [3.0, 1.0, 0.0]}]},
        {"payload_change": {"table_a": {"at": 0.1}}},
        {"caster_swivel": {"table_a": {}}},
    ],
)
def test_what_is_concealed_is_on_no_topic(concealed: dict[str, Any]) -> None:
    scene = scene_with(concealed)
    plain = known_scene(scene_with({}), 0.0)
    seen = observed(scene)
    (told,) = [each for each in seen if isinstance(each, KnownScene)]
    assert [body.name for body in told.bodies] == [body.name for body in plain.bodies] == ["table_a"]
    assert told.bodies[0].casters.size == 0
    assert {each.tag for each in seen if isinstance(each, TagReading)} == {"table_a", "left_gripper", "right_gripper"}


def test_sensor_faults_reach_krangs_sensors_and_no_others() -> None:
    faults = {
        "wrench_bias": {"left": {"force": [3.0, 0.0, 0.0]}},
        "time_offset": {"right": {"delay": 0.05}},
        "pose_bias": {"table_a": {"offset": [0.1, 0.0]}},
    }
    clean, faulty = observed(scene_with({})), observed(scene_with(faults))

    def wrists(seen: list[Any], side: str) -> list[WristReading]:
        return [each for each in seen if isinstance(each, WristReading) and each.side == side]

    gap = np.array([b.force - a.force for a, b in zip(wrists(clean, "left"), wrists(faulty, "left"), strict=True)])
    np.testing.assert_allclose(gap.mean(0), [3.0, 0.0, 0.0], atol=0.02)
    late = wrists(faulty, "right")
    for first, second in zip(wrists(clean, "right"), late, strict=False):
        assert second.time == pytest.approx(first.time + 0.05)
        np.testing.assert_array_equal(second.force, first.force)
    tags = [
        [each for each in seen if isinstance(each, TagReading) and each.tag == "table_a"] for seen in (clean, faulty)
    ]
    np.testing.assert_allclose(
        np.mean([b.position - a.position for a, b in zip(*tags, strict=True)], axis=0), [0.1, 0.0, 0.0], atol=5e-3
    )
