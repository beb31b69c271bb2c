"""The `concealed` part of a scene: every effect is an option, every fault of one is one line, nothing leaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bullet_sim.concealed.options import EFFECTS, SENSOR_EFFECTS, Concealed
from bullet_sim.errors import SimError
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import HandPath, HandPush
from bullet_sim.scene import load_scene

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0, 0, 0]}
BOX = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]
SELF_CROSSING = [[0, 0], [1, 1], [1, 0], [0, 1]]
PATH = HandPath(np.array([0.0, 0.7, 2.0, 2.5]), np.array([[0, 0, 0], [0.3, 0, 0.1], [0.3, 0, 0.1], [0, 0, 0]]))

ONE_OF_EACH: dict[str, Any] = {
    "second_wheel": {"table_a": {"position": [0.2, 0.4], "heading": 0.5}},
    "caster_swivel": {"table_a": {}},
    "ground_friction": {"table_a": {}},
    "breakaway_friction": {"table_a": {}},
    "viscous_drag": {"table_a": {}},
    "floor_patch": [{"polygon": [[0.5, -2], [3, -2], [3, 2], [0.5, 2]]}],
    "floor_slope": {"angle": 0.01},
    "com_offset": {"table_a": {"place": [0.2, 0.3]}},
    "payload_change": {"table_a": {"at": 2.0}},
    "sloshing_load": {"table_a": {}},
    "tether": {"table_a": {"anchor": [-0.5, 0.0, 0.5]}},
    "detent": {"table_a": {"place": [0.2, 0.0]}},
    "hidden_hinge": {"table_a": {"point": [0.3, 0.5]}},
    "hidden_obstacle": [{"polygon": BOX, "pose": [0.9, 0.2, 0.0]}],
    "unseen_body": [{"polygon": BOX, "pose": [0.8, 0.2, 0.0]}],
    "external_force": {"table_a": {"force": [3.0, 2.0], "period": 1.0}},
    "grasp_compliance": {"table_a": {}},
    "wrench_bias": {"left": {"force": [2.0, 0, 0], "start": 2.0}},
    "wrench_frame": {"left": {"scale": 1.2}},
    "time_offset": {"left": {"delay": 0.05}},
    "pose_bias": {"table_a": {"offset": [0.03, 0.0]}},
}
DESIGN = [
    "second_wheel",
    "caster_swivel",
    "ground_friction",
    "breakaway_friction",
    "viscous_drag",
    "floor_patch",
    "floor_slope",
    "com_offset",
    "payload_change",
    "sloshing_load",
    "tether",
    "detent",
    "hidden_hinge",
    "hidden_obstacle",
    "unseen_body",
    "external_force",
    "grasp_compliance",
    "wrench_bias",
    "wrench_frame",
    "time_offset",
    "pose_bias",
]


def test_the_effects_are_those_of_the_design() -> None:
    assert sorted(EFFECTS) == sorted(DESIGN) == sorted(ONE_OF_EACH)
    assert set(SENSOR_EFFECTS) < set(EFFECTS)


def test_nothing_is_concealed_by_default(lab: Any) -> None:
    assert lab.world(lab.scene({"table_a": PLAIN})).effects == []
    assert not any(getattr(Concealed(), key) for key in Concealed.model_fields)


@pytest.mark.parametrize("effect", DESIGN)
def test_each_effect_acts_in_a_push_and_says_when(lab: Any, effect: str) -> None:
    scene = lab.scene({"table_a": PLAIN}, concealed={effect: ONE_OF_EACH[effect]})
    recording = push_by_hand(scene, [HandPush("table_a", (-0.4, 0.3), PATH)], seed=1)
    assert recording.status == "done"
    (activity,) = recording.activities.values()
    assert activity.effect == effect
    assert len(activity.intervals()) > 0
    assert np.isfinite(activity.strength).all()
    assert np.isfinite(recording.wrench.force).all()
    assert set(recording.tags) == {"table_a", "left_gripper"}, "what is hidden wears no tag"
    assert set(recording.bodies) == {"table_a"}


@pytest.mark.parametrize("effect", [name for name in DESIGN if name != "caster_swivel"])
def test_each_effect_fits_a_table_on_casters_too(lab: Any, effect: str) -> None:
    scene = lab.scene({"table_a": lab.table}, concealed={effect: ONE_OF_EACH[effect]})
    world = lab.world(scene)
    lab.run(world, 0.3)
    assert [found.name for found in world.effects] == [effect]
    assert np.isfinite(world.truth("table_a").planar).all()
    assert world.effects[0].strength() >= 0


def test_effects_add_up(lab: Any) -> None:
    concealed = {key: ONE_OF_EACH[key] for key in ("ground_friction", "breakaway_friction", "floor_patch", "tether")}
    world = lab.world(lab.scene({"table_a": PLAIN}, concealed=concealed))
    lab.run(world, 0.2)
    assert [effect.name for effect in world.effects] == [
        "ground_friction",
        "breakaway_friction",
        "tether",
        "floor_patch",
    ]
    np.testing.assert_allclose(world.find("table_a").feet.coefficients, 0.1 + 0.12, atol=1e-3)


@pytest.mark.parametrize("effect", ["sloshing_load", "payload_change", "caster_swivel", "ground_friction"])
def test_same_seed_same_bytes(lab: Any, effect: str) -> None:
    def shown() -> bytes:
        scene = lab.scene({"table_a": PLAIN}, concealed={effect: ONE_OF_EACH[effect]})
        return push_by_hand(scene, [HandPush("table_a", (-0.4, 0.3), PATH)], seed=4).wrench.force.tobytes()

    assert shown() == shown()


HOSTILE = [
    ("tethr", {}, r"concealed\.tethr: unknown key; did you mean 'tether'\?"),
    ("tether", {"tabel_a": {"anchor": [1, 1, 0]}}, r"concealed\.tether: no body 'tabel_a' .* did you mean 'table_a'\?"),
    ("tether", {"table_a": {}}, r"concealed\.tether\.table_a\.anchor: expected a value, got none"),
    (
        "tether",
        {"table_a": {"anchor": [1, 1, 0], "stiffness": -5}},
        r"tether\.table_a\.stiffness: expected greater than",
    ),
    (
        "tether",
        {"table_a": {"anchor": [1, 1, 0], "point": [2, 0, 0]}},
        r"tether\.table_a\.point: expected a place on the",
    ),
    (
        "com_offset",
        {"table_a": {"mass": -3, "place": [0, 0]}},
        r"com_offset\.table_a\.mass: expected greater than 0, got -3",
    ),
    (
        "com_offset",
        {"table_a": {"mass": 25, "place": [0, 0]}},
        r"mass: expected at most 18\.0 kg \(0\.6 of the body's\)",
    ),
    ("sloshing_load", {"table_a": {"motion": "roll"}}, r"sloshing_load\.table_a\.motion: expected 'swing' or 'slide'"),
    ("payload_change", {"table_a": {"mass": 5}}, r"payload_change\.table_a\.at: expected a value, got none"),
    ("payload_change", {"table_a": {"at": -1}}, r"payload_change\.table_a\.at: expected greater than or equal to 0"),
    ("floor_patch", [{"polygon": SELF_CROSSING}], r"floor_patch\.0\.polygon: expected a polygon that does not cross"),
    ("floor_patch", {"polygon": BOX}, r"concealed\.floor_patch: expected a valid tuple"),
    ("floor_slope", {"angle": 1.0}, r"floor_slope\.angle: expected less than or equal to 0\.2, got 1\.0"),
    (
        "hidden_obstacle",
        [{"polygon": BOX, "pose": [0.3, 0, 0]}],
        r"hidden_obstacle\.0: expected a place of its own, it over",
    ),
    (
        "unseen_body",
        [{"polygon": BOX, "pose": [2, 0, 0], "nominal_mass": 0}],
        r"unseen_body\.0\.nominal_mass: expected",
    ),
    ("unseen_body", [{"polygon": BOX}], r"concealed\.unseen_body\.0\.pose: expected a value, got none"),
    ("breakaway_friction", {"table_a": {"static": 0.05}}, r"static: expected more than sliding, 0\.06, got 0\.05"),
    ("caster_swivel", {"crate": {}}, r"caster_swivel\.crate: expected a plain_table, got a block"),
    ("ground_friction", {"crate": {}}, r"ground_friction\.crate: expected a body with legs, got a block"),
    ("viscous_drag", {"wall": {}}, r"viscous_drag\.wall: expected a body that can move, got a fixture"),
    (
        "second_wheel",
        {"table_a": {"position": [0, 0], "load": 290}},
        r"second_wheel\.table_a\.load: expected at most 235 N",
    ),
    (
        "external_force",
        {"table_a": {"force": [float("nan"), 0]}},
        r"external_force\.table_a\.force\.0: expected a finite",
    ),
    (
        "hidden_hinge",
        {"table_a": {"point": [0, 0], "stiffness": 1e9}},
        r"stiffness: expected less than or equal to 100000",
    ),
    (
        "grasp_compliance",
        {"table_a": {"play": 1}},
        r"grasp_compliance\.table_a\.play: expected less than or equal to 0\.05",
    ),
    ("wrench_bias", {"table_a": {"force": [1, 0, 0]}}, r"wrench_bias: no gripper, tag or body 'table_a' .*left, right"),
    ("wrench_bias", {"left": {}}, r"wrench_bias\.left: expected an offset or a drift, got none"),
    (
        "wrench_frame",
        {"lefft": {"scale": 2}},
        r"wrench_frame: no gripper, tag or body 'lefft' .* did you mean 'left'\?",
    ),
    ("time_offset", {"left": {"delay": -0.1}}, r"time_offset\.left\.delay: expected greater than 0, got -0\.1"),
    (
        "pose_bias",
        {"left": {"offset": [0.1, 0]}},
        r"pose_bias: no gripper, tag or body 'left' .*did you mean 'left_gripper'",
    ),
    ("detent", {"table_a": {"place": [0, 0], "gap": 0}}, r"detent\.table_a\.gap: expected greater than 0, got 0"),
    (
        "wheel",
        {"table_a": {"position": [0, 0], "radius": 3}},
        r"wheel\.table_a\.radius: expected less than or equal to 0\.3",
    ),
]


@pytest.mark.parametrize(("effect", "told", "message"), HOSTILE, ids=[f"{row[0]}-{n}" for n, row in enumerate(HOSTILE)])
def test_a_fault_is_one_line_with_key_and_remedy(lab: Any, effect: str, told: Any, message: str) -> None:
    crate = {"kind": "block", "polygon": BOX, "height": 0.3, "nominal_mass": 5.0, "pose": [-3, 3, 0]}
    wall = {"kind": "fixture", "polygon": BOX, "height": 0.3, "pose": [3, -3, 0]}
    with pytest.raises(SimError, match=message) as caught:
        lab.scene({"table_a": PLAIN, "crate": crate, "wall": wall}, concealed={effect: told})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["carpet_edge", "tethered_table"])
def test_example_scenes_conceal_what_they_say(name: str) -> None:
    scene = load_scene(Path(__file__).resolve().parents[2] / "config" / "scenes" / f"{name}.yaml")
    assert {"carpet_edge": scene.concealed.floor_patch, "tethered_table": scene.concealed.tether}[name]
