from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bullet_sim.catalogue import OfficeTable, UtilityCart
from bullet_sim.errors import SimError
from bullet_sim.scene import Scene, load_scene, placed_footprint
from bullet_sim.settings import parse_settings

SCENES = Path(__file__).resolve().parents[2] / "config" / "scenes"
SHIPPED = sorted(path.stem for path in SCENES.glob("*.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scene_loads_under_its_own_name(name: str) -> None:
    scene = load_scene(SCENES / f"{name}.yaml")
    assert scene.name == name
    assert load_scene(str(SCENES / f"{name}.yaml")) == scene


def test_shipped_scenes_are_the_promised_ones() -> None:
    assert {"locked_caster", "free_table", "three_tables", "heavy_table", "utility_cart"} <= set(SHIPPED)


@pytest.mark.parametrize("name", ["locked_caster", "free_table", "three_tables", "heavy_table"])
def test_table_in_front_has_its_edge_at_the_height_and_ahead_of_the_left_gripper(name: str) -> None:
    # In the posture square_table_push the left plates end at (0.6645, 0.1011), their middle at z 0.7656.
    table = load_scene(SCENES / f"{name}.yaml").bodies["table_a"]
    assert isinstance(table, OfficeTable)
    assert table.height - table.slab / 2 == pytest.approx(0.7656, abs=0.002)
    near = placed_footprint(table).bounds[0]
    assert 0.10 < near - 0.6645 < 0.20
    assert abs(0.1011 - table.pose[1]) > 0.2, "the grasp is off the middle"
    assert abs(0.1011 - table.pose[1]) < table.size[1] / 2 - 0.05


def test_free_and_locked_table_differ_in_what_is_concealed_alone() -> None:
    free, locked = (load_scene(SCENES / f"{name}.yaml") for name in ("free_table", "locked_caster"))
    assert free.bodies == locked.bodies
    assert (free.room, free.robot, free.sensors) == (locked.room, locked.robot, locked.sensors)
    assert free.concealed != locked.concealed


def test_cart_has_its_rim_at_the_height_and_ahead_of_the_left_gripper() -> None:
    # In the posture steel_cart_push the left plates end at (0.602, 0.117), their middle at z 0.896.
    scene = load_scene(SCENES / "utility_cart.yaml")
    cart = scene.bodies["cart_a"]
    assert isinstance(cart, UtilityCart)
    assert scene.robot.posture == "steel_cart_push"
    assert cart.height - cart.bar / 2 == pytest.approx(0.896, abs=0.002)
    assert 0.10 < placed_footprint(cart).bounds[0] - 0.602 < 0.20


def test_outlines_come_out_counter_clockwise() -> None:
    plain = valid()
    plain["room"]["outline"].reverse()
    assert parse_settings(plain, Scene, "s").room == parse_settings(valid(), Scene, "s").room


def valid() -> dict[str, Any]:
    return copy.deepcopy(yaml.safe_load((SCENES / "three_tables.yaml").read_text()))


SELF_CROSSING = [[-1, -1], [5, 5], [5, -1], [-1, 5]]
SEVEN = [0.0] * 7
CART = {"kind": "utility_cart", "size": [0.9, 0.6], "height": 0.9, "nominal_mass": 30.0, "pose": [1.2, 0.0, 0.0]}
HOSTILE = [
    ("rooom", {}, r"rooom: unknown key; did you mean 'room'\?"),
    ("bodies.table_a.heigth", 1.0, r"bodies\.table_a\.heigth: unknown key; did you mean 'height'\?"),
    ("bodies.table_a.casters", {"radus": 1}, r"bodies\.table_a\.casters\.radus: unknown key; did you mean 'radius'"),
    ("concealed.locked_caster", {}, r"concealed\.locked_caster: unknown key; did you mean 'locked_casters'\?"),
    ("sensors.tags.sigma_x", 1.0, r"sensors\.tags\.sigma_x: unknown key; did you mean 'sigma_xy'\?"),
    ("robot.posture", {"waist": 1, "lefft": SEVEN}, r"robot\.posture\.lefft: unknown key; did you mean 'left'\?"),
    ("robot.posture", {"waist": 1, "left": [1, 2]}, r"robot\.posture\.left\.2: expected a value, got none"),
    ("bodies.table_a.kind", "office_tabel", r"table_a\.kind: unknown kind 'office_tabel'; did you mean 'office_table'"),
    ("bodies.table_a.height", math.nan, r"bodies\.table_a\.height: expected a finite number, got nan"),
    ("bodies.table_a.pose", [0, math.inf, 0], r"bodies\.table_a\.pose\.1: expected a finite number, got inf"),
    ("bodies.table_a.nominal_mass", -33, r"bodies\.table_a\.nominal_mass: expected greater than 0, got -33"),
    ("bodies.table_a.nominal_mass", 2.0, r"nominal_mass: expected over twice its casters'"),
    ("bodies.table_a.height", "tall", r"bodies\.table_a\.height: expected a valid number.*got 'tall'"),
    ("bodies.table_a.height", 0.1, r"bodies\.table_a: expected a height above casters and slab"),
    ("bodies.table_a.casters", {"height": 0.05}, r"casters: expected a caster height of at least the wheel's diameter"),
    ("bodies.table_a.caster_positions", {"one": [0, 0]}, r"expected at least three casters around the table's middle"),
    ("bodies.table_a.pose", [0, 0], r"bodies\.table_a\.pose\.2: expected a value, got none; add it"),
    ("bodies.table_a", None, r"bodies\.table_a: .*got None"),
    ("bodies.table_b.pose", [1.2, 0.0, 0.0], r"bodies\.table_b: expected a place of its own, got one that overlaps"),
    ("bodies.table_b.pose", [9.0, 0.0, 0.0], r"bodies\.table_b: expected a place inside the room"),
    ("bodies.pillar.polygon", SELF_CROSSING, r"bodies\.pillar\.polygon: expected a polygon that does not cross"),
    ("room.outline", SELF_CROSSING, r"room\.outline: expected a polygon that does not cross itself"),
    ("room.outline", [[0, 0], [1, 1]], r"room\.outline: expected a polygon of at least 3 corners, got 2"),
    ("room.outline", [[0, 0], [1, 1], [2, 2]], r"room\.outline: expected a polygon"),
    ("room.floor_friction", 0, r"room\.floor_friction: expected greater than 0, got 0"),
    ("robot.pose", [9, 0, 0], r"robot\.pose: expected a start in the room"),
    ("goal.object", "tabel_a", r"goal\.object: no body 'tabel_a' in this scene; did you mean 'table_a'\?"),
    ("sensors.tags.dropout", 1.0, r"sensors\.tags\.dropout: expected less than 1, got 1\.0"),
    ("sensors.tags.rate", 0, r"sensors\.tags\.rate: expected greater than or equal to 0\.1, got 0"),
    ("sensors.wrist_ft.rate", 1e-12, r"sensors\.wrist_ft\.rate: expected greater than or equal to 0\.1"),
    ("sensors.wrist_ft.force_resolution", 1e300, r"force_resolution: expected less than or equal to 10000"),
    ("bodies.table_a.nominal_mass", 1e308, r"bodies\.table_a\.nominal_mass: expected less than or equal to 10000"),
    ("bodies.table_a.height", 1e12, r"bodies\.table_a\.height: expected less than or equal to 10000"),
    ("bodies.table_a.pose", [1.0, 0.0, 1e300], r"bodies\.table_a\.pose\.2: expected less than or equal to 10000"),
    ("room.outline", [[0, 0], [1e300, 0], [0, 1e300]], r"room\.outline\.1\.0: expected less than or equal to 10000"),
    ("sensors.wrist_ft.force_noise", [0.1, -0.1, 0.1], r"sensors\.wrist_ft\.force_noise\.1: expected greater than"),
    ("concealed.locked_casters", {"table_a": ["rear_rigth"]}, r"no caster 'rear_rigth'; did you mean 'rear_right'\?"),
    ("concealed.locked_casters", {"pillar": ["rear"]}, r"pillar: expected a body on casters, got a fixture"),
    ("concealed.fixed_wheels", {"table_a": ["rear_rigth"]}, r"no caster 'rear_rigth'; did you mean 'rear_right'\?"),
    (
        "concealed.fixed_wheels",
        {"pillar": ["rear"]},
        r"fixed_wheels\.pillar: expected a body on casters",
    ),
    (
        "bodies.table_a",
        CART | {"lower_shelf": 0.1},
        r"lower_shelf: expected a height between casters and top",
    ),
    ("bodies.table_a", CART | {"size": [0.9, 0.1]}, r"expected shelves of more than two caster insets, got \[0\.7"),
    ("bodies.table_a", CART | {"nominal_mass": 7.0}, r"nominal_mass: expected over twice its casters' 4\.00 kg, got 7"),
    ("concealed.mass", {"tabel_a": 3.0}, r"concealed\.mass: no body 'tabel_a' in this scene; did you mean 'table_a'"),
]


@pytest.mark.parametrize("name", ["", "../table", "a table", "3rd", "tisch\u00e9"])
def test_a_body_s_name_has_to_fit_into_a_topic(name: str) -> None:
    plain = valid()
    plain["bodies"][name] = {"kind": "block", "polygon": [[0, 0], [0.1, 0], [0, 0.1]], "height": 1, "nominal_mass": 1}
    plain["bodies"][name]["pose"] = [3.0, 0.0, 0.0]
    with pytest.raises(SimError, match="letters, digits and underscores"):
        parse_settings(plain, Scene, "scene")


@pytest.mark.parametrize("text", ["[" * 3000, "name: " + "9" * 5000], ids=["deep", "digits"])
def test_what_no_yaml_reader_takes_is_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "odd.yaml"
    file.write_text(text)
    with pytest.raises(SimError, match="expected YAML, got") as caught:
        load_scene(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"), HOSTILE, ids=[f"{key}-{n}" for n, (key, _, _) in enumerate(HOSTILE)]
)
def test_a_fault_is_one_line_with_file_key_and_remedy(key: str, value: Any, message: str, tmp_path: Path) -> None:
    plain = valid()
    *parents, last = key.split(".")
    place = plain
    for parent in parents:
        place = place.setdefault(parent, {})
    place[last] = value
    file = tmp_path / "odd.yaml"
    file.write_text(yaml.safe_dump(plain))
    with pytest.raises(SimError, match=message) as caught:
        load_scene(file)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{file}: ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected keys .*room.*, got NoneType"),
        (b"- a\n- b\n", "expected keys .*, got list"),
        (b"room: [1, 2", "expected YAML, got"),
        (b"name: a\nname: b\n", "key 'name' is there twice"),
        (b"? [1, 2]\n: 3\n", "odd.yaml: "),
        (b"\xff\xfe\x00x", "expected a readable YAML file"),
        (b"room: !!python/object:os.system {}\n", "expected YAML, got"),
        (b"name: 3\n", "room: expected a value, got none|name: expected a valid string"),
    ],
)
def test_a_file_that_is_no_scene_is_refused_in_one_line(content: bytes, message: str, tmp_path: Path) -> None:
    file = tmp_path / "odd.yaml"
    file.write_bytes(content)
    with pytest.raises(SimError, match=message) as caught:
        load_scene(file)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SimError, match=r"nowhere\.yaml: expected a readable YAML file, got FileNotFoundError"):
        load_scene(tmp_path / "nowhere.yaml")


def test_a_scene_never_changes() -> None:
    scene = load_scene(SCENES / "free_table.yaml")
    with pytest.raises(ValueError, match="frozen"):
        scene.name = "other"  # type: ignore[misc]


def test_footprint_is_turned_and_moved_with_the_pose() -> None:
    table = load_scene(SCENES / "free_table.yaml").bodies["table_a"]
    turned = table.model_copy(update={"pose": (1.0, 2.0, math.pi / 2)})
    np.testing.assert_allclose(placed_footprint(turned).bounds, [1 - 0.75, 2 - 0.375, 1 + 0.75, 2 + 0.375], atol=1e-12)
