"""A learned model's file becomes what a scene conceals, with the same physics in other words, or is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.concealed.detent import catch_force
from bullet_sim.concealed.from_model import MAKERS
from bullet_sim.concealed.options import EFFECTS
from bullet_sim.errors import SimError
from bullet_sim.model_file import concealed_of
from bullet_sim.scene import Scene, load_scene, with_model
from bullet_sim.settings import parse_settings

MASS = 25.0
ROOM = {"outline": [[-4, -4], [4, -4], [4, 4], [-4, 4]]}
TABLE = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [1.0, 0.0, 0.0]}
SCENE = {"room": ROOM, "bodies": {"table": TABLE}, "robot": {"pose": [-2.0, 0.0, 0.0]}}

NUMBERS: dict[str, dict[str, float]] = {
    "second_wheel": {"wheel2_x": -0.3, "wheel2_y": 0.2, "wheel2_theta": 0.4, "wheel2_mu_x": 0.01, "wheel2_mu_y": 0.2},
    "ground_friction": {"slide_mu": 0.06, "slide_extent": 1.0},
    "breakaway_friction": {"slide_mu": 0.05, "breakaway_mu": 0.04, "breakaway_speed": 0.02},
    "viscous_drag": {"drag_linear": 35.0, "drag_turn": 6.0},
    "floor_patch": {
        "patch_mu": 0.1, "patch_x": 1.5, "patch_y": 0.3, "patch_length": 0.5, "patch_width": 0.3, "patch_theta": 0.2
    },
    "floor_slope": {"slope_x": 0.006, "slope_y": -0.008},
    "com_offset": {"com_x": 0.05, "com_y": -0.1},
    "payload_change": {"payload_mass": 6.0, "payload_time": 9.0, "payload_x": 0.1, "payload_y": 0.2},
    "sloshing_load": {"slosh_mass": 4.0, "slosh_frequency": 0.9, "slosh_damping": 0.05},
    "tether": {
        "tether_stiffness": 50.0, "tether_x": 2.5, "tether_y": 1.0, "tether_length": 0.8,
        "tether_at_x": 0.2, "tether_at_y": 0.1,
    },
    "detent": {"detent_force": 15.0, "detent_x": 1.2, "detent_y": 0.1, "detent_width": 0.04},
    "hidden_hinge": {"pivot_stiffness": 20000.0, "pivot_x": 1.3, "pivot_y": 0.5},
    "hidden_obstacle": {
        "obstacle_stiffness": 15000.0, "obstacle_x": 2.5, "obstacle_y": 0.0, "obstacle_radius": 0.1,
        "obstacle_friction": 0.3,
    },
    "unseen_body": {"unseen_force": 12.0, "unseen_x": 2.5, "unseen_y": 0.0, "unseen_radius": 0.2},
    "external_force": {"periodic_x": 3.0, "periodic_y": 1.0, "periodic_frequency": 0.5, "periodic_phase": 0.3},
    "grasp_compliance": {"grip_compliance": 5e-4, "grip_play": 2e-3},
    "pose_bias": {"tag_x": 0.02, "tag_y": -0.01, "tag_theta": 0.1},
    "caster_swivel": {
        "caster_trail": 0.03, "caster_roll": 0.02, "caster_scrub": 0.022, "caster_twist": 0.05, "caster_heading": 1.0,
    },
    "wrench_bias": {"bias_x": 2.0, "bias_y": -1.0, "bias_torque": 0.3, "bias_start": 4.0},
    "wrench_frame": {"force_scale": 1.2, "sensor_turn": 0.3, "torque_scale": -1.0},
    "time_offset": {"time_offset": -0.2},
}  # fmt: skip


QUARTER = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
"""From the sensor's axes to the body's: its x is the body's y."""


def told(values: Mapping[str, float]) -> dict[str, Any]:
    return {
        name: {"unit": "?", "mean": value, "sd": 0.0, "best": value, "draws": [value]} for name, value in values.items()
    }


def write(
    folder: Path, effects: Mapping[str, Mapping[str, float]], body: Mapping[str, float] | None = None, **fixed: float
) -> Path:
    data = {
        "format": "pbrl_model/model/1",
        "object": "table",
        "shape": {"footprint": []},
        "parameters": told({"mass": MASS, "inertia_factor": 1.0, **(body or {})}),
        "fixed": fixed,
        "effects": [{"effect": name, "parameters": told(values), "fixed": {}} for name, values in effects.items()],
        "clock": [1.5, 20.0],
        "sensor": {"gripper": "left", "turn": QUARTER},
        "notes": [],
    }
    path = folder / "model_table.json"
    path.write_text(json.dumps(data))
    return path


def scene() -> Scene:
    return parse_settings(SCENE, Scene, "test")


def concealed(folder: Path, effect: str) -> Any:
    made = with_model(scene(), write(folder, {effect: NUMBERS[effect]}))
    assert made.concealed.mass["table"] == pytest.approx(MASS)
    setting = getattr(made.concealed, effect)
    return next(iter(setting.values())) if isinstance(setting, dict) else setting


@pytest.mark.parametrize("effect", sorted(NUMBERS))
def test_every_effect_that_can_be_made_fits_a_scene(tmp_path: Path, effect: str) -> None:
    assert concealed(tmp_path, effect)


def test_every_effect_of_a_scene_can_be_made(tmp_path: Path) -> None:
    assert set(NUMBERS) == set(MAKERS) == set(EFFECTS)


def test_what_cannot_be_made_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(SimError, match=r"^[^\n]*model_table.json: my_law: expected an effect[^\n]*does not know$"):
        with_model(scene(), write(tmp_path, {"my_law": {}}))


@pytest.mark.parametrize(
    ("effect", "spoil", "said"),
    [
        ("wrench_bias", {"sensor": None}, "write concealed.wrench_bias into the scene"),
        ("wrench_frame", {"sensor": {"gripper": "claw", "turn": QUARTER}}, "left or right, got that of 'claw'"),
        ("wrench_frame", {"sensor": {"gripper": "left", "turn": [[2.0, 0, 0], [0, 1, 0], [0, 0, 1]]}}, "a rotation"),
        ("time_offset", {"sensor": None}, "which sensor"),
        ("caster_swivel", {"object": "desk"}, "caster_swivel.desk: expected a plain_table, got a office_table"),
    ],
)
def test_a_fault_of_nobody_s_sensor_and_casters_on_casters_are_refused(
    tmp_path: Path, effect: str, spoil: Mapping[str, Any], said: str
) -> None:
    path = write(tmp_path, {effect: NUMBERS[effect]})
    path.write_text(json.dumps({**json.loads(path.read_text()), **spoil}))
    desk = {"kind": "office_table", "size": [0.8, 1.4], "height": 0.7, "nominal_mass": 30.0, "pose": [-1.0, 2.0, 0.0]}
    with pytest.raises(SimError) as caught:
        with_model(parse_settings({**SCENE, "bodies": {"table": TABLE, "desk": desk}}, Scene, "test"), path)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_sensor_shows_the_opposite_of_what_acts_in_its_own_axes(tmp_path: Path) -> None:
    offset = concealed(tmp_path, "wrench_bias")
    assert np.allclose(offset.force, [1.0, 2.0, 0.0]) and np.allclose(offset.torque, [0.0, 0.0, -0.3])
    assert offset.start + 0.5 * offset.rise == pytest.approx(4.0)
    always = {name: value for name, value in NUMBERS["wrench_bias"].items() if name != "bias_start"}
    made = with_model(scene(), write(tmp_path, {"wrench_bias": always})).concealed.wrench_bias["left"]
    assert made.start == 1.5 and made.rise == 0.0, "after the sensor was read at rest"
    drift = {"wrench_bias": {"drift_x": 0.0, "drift_y": 0.4, "drift_torque": 0.0}}
    made = with_model(scene(), write(tmp_path, drift)).concealed.wrench_bias["left"]
    assert np.allclose(made.force_drift, [-0.4, 0.0, 0.0]) and made.start == 0.0
    frame = concealed(tmp_path, "wrench_frame")
    assert np.allclose(frame.turn, [0.0, 0.0, -0.3]) and frame.scale == 1.2 and frame.torque_scale is None


def test_poses_that_come_late_are_the_tag_s_and_ones_that_come_early_are_a_late_force(tmp_path: Path) -> None:
    for late, stream in ((0.2, "table"), (-0.2, "left")):
        made = with_model(scene(), write(tmp_path, {"time_offset": {"time_offset": late}})).concealed
        assert {name: each.delay for name, each in made.time_offset.items()} == {stream: 0.2}
    assert not with_model(scene(), write(tmp_path, {"time_offset": {"time_offset": 0.0}})).concealed.time_offset


def test_casters_resist_as_was_found(tmp_path: Path) -> None:
    made, found = concealed(tmp_path, "caster_swivel"), NUMBERS["caster_swivel"]
    load = MASS * GRAVITY / 4
    assert made.rolling_resistance / made.radius == pytest.approx(found["caster_roll"])
    assert made.swivel_friction / made.trail == pytest.approx(found["caster_scrub"] * load)
    assert made.sliding_friction * made.contact_width / 4 / made.trail == pytest.approx(found["caster_twist"])
    assert made.scrub_length is None
    laid = {"caster_swivel": {**found, "caster_lay": 0.02}, "ground_friction": NUMBERS["ground_friction"]}
    both = with_model(scene(), write(tmp_path, laid)).concealed
    casters, glides = both.caster_swivel["table"], both.ground_friction["table"]
    assert casters.scrub_length == 0.02
    assert casters.rolling_resistance / casters.radius * (1 - glides.load_share) == pytest.approx(found["caster_roll"])
    assert glides.friction * glides.load_share == pytest.approx(0.06), "the sum is that of the whole weight"


def test_a_wheel_has_the_friction_that_was_found_whichever_way_it_is_described(tmp_path: Path) -> None:
    for theta, mu_x, mu_y in ((0.4, 0.01, 0.2), (0.4 - 0.5 * math.pi, 0.2, 0.01)):
        numbers = {"wheel_x": -0.3, "wheel_y": 0.2, "wheel_theta": theta, "mu_x": mu_x, "mu_y": mu_y}
        wheel = with_model(scene(), write(tmp_path, {}, numbers)).concealed.wheel["table"]
        assert wheel.heading == pytest.approx(0.4)
        assert wheel.sliding_friction * wheel.load / (MASS * GRAVITY) == pytest.approx(0.2)
        assert wheel.rolling_resistance * wheel.load / (wheel.radius * MASS * GRAVITY) == pytest.approx(0.01)


def test_a_carpet_holds_a_wheel_back_by_what_was_found(tmp_path: Path) -> None:
    numbers = {"wheel_x": -0.3, "wheel_y": 0.2, "wheel_theta": 0.4, "mu_x": 0.001, "mu_y": 0.2}
    patch = {**NUMBERS["floor_patch"], "patch_roll": 0.03}
    made = with_model(scene(), write(tmp_path, {"floor_patch": patch}, numbers)).concealed
    wheel, tile = made.wheel["table"], made.floor_patch[0]
    assert tile.rolling_resistance * wheel.load / wheel.radius == pytest.approx(0.03 * MASS * GRAVITY)


def test_a_caster_that_holds_alike_in_every_direction_is_locked(tmp_path: Path) -> None:
    numbers = {"wheel_x": -0.3, "wheel_y": 0.2, "mu_x": 0.15}
    wheel = with_model(scene(), write(tmp_path, {}, numbers, mu_y=-1.0, cone=1.0)).concealed.wheel["table"]
    assert wheel.locked and wheel.sliding_friction * wheel.load == pytest.approx(0.15 * MASS * GRAVITY)


def test_places_and_strengths_are_those_of_the_file(tmp_path: Path) -> None:
    cord = concealed(tmp_path, "tether")
    assert cord.anchor[:2] == (2.5, 1.0) and cord.point[:2] == (0.2, 0.1) and cord.stiffness == 50.0
    assert cord.anchor[2] == pytest.approx(scene().bodies["table"].levels[1] + cord.point[2]), "the cord is level"
    slope = concealed(tmp_path, "floor_slope").gravity
    assert np.allclose(slope[:2], np.multiply(GRAVITY, [0.006, -0.008]))
    ballast = concealed(tmp_path, "com_offset")
    assert np.allclose(np.multiply(ballast.mass / MASS, ballast.place), [0.05, -0.1])
    load = concealed(tmp_path, "sloshing_load")
    assert math.sqrt(GRAVITY / load.length) / (2 * math.pi) == pytest.approx(0.9)
    catch = concealed(tmp_path, "detent")
    around = [catch_force(0.04 + step, catch.gap) for step in (-0.002, 0.0, 0.002)]
    assert max(around) == around[1], "the catch pulls hardest where it was found to"
    tile = concealed(tmp_path, "floor_patch")[0]
    assert np.allclose(np.mean(tile.polygon, axis=0), [1.5, 0.3])
    pin = concealed(tmp_path, "hidden_hinge")
    assert np.allclose(pin.point, [0.3, 0.5]), "in the body's frame"
    crate = concealed(tmp_path, "unseen_body")[0]
    assert crate.friction * crate.nominal_mass * GRAVITY == pytest.approx(12.0)
    push = concealed(tmp_path, "external_force")
    assert push.period == 2.0 and push.force == (3.0, 1.0)
    hold = concealed(tmp_path, "grasp_compliance")
    assert hold.stiffness == pytest.approx(2000.0) and hold.play == 2e-3


@pytest.mark.parametrize(("found", "given"), [(0.1, 0.1), (0.5, 0.9 * 0.2 / 0.8)])
def test_a_crate_weighs_what_was_found_unless_it_would_tip(tmp_path: Path, found: float, given: float) -> None:
    numbers = {**NUMBERS["unseen_body"], "unseen_friction": found}
    crate = with_model(scene(), write(tmp_path, {"unseen_body": numbers})).concealed.unseen_body[0]
    assert crate.friction == pytest.approx(given)
    assert crate.nominal_mass == pytest.approx(12.0 / (given * GRAVITY))


def test_a_post_is_as_square_as_it_was_found(tmp_path: Path) -> None:
    numbers = {**NUMBERS["hidden_obstacle"], "obstacle_angle": 0.3}
    numbers.pop("obstacle_friction")
    post = with_model(scene(), write(tmp_path, {"hidden_obstacle": numbers})).concealed.hidden_obstacle[0]
    assert len(post.polygon) == 4 and np.allclose(np.abs(post.polygon), 0.1)
    assert np.allclose(post.pose, [2.5, 0.0, 0.3])


def test_feet_beside_a_wheel_slide_with_the_whole_friction(tmp_path: Path) -> None:
    wheel = {"wheel_x": -0.3, "wheel_y": 0.2, "mu_x": 0.14}
    made = with_model(scene(), write(tmp_path, {"ground_friction": {"slide_mu": 0.06}}, wheel, mu_y=-1.0)).concealed
    on_feet = MASS * GRAVITY - made.wheel["table"].load
    assert made.ground_friction["table"].friction * on_feet == pytest.approx(0.06 * MASS * GRAVITY)


def test_what_was_taken_off_was_part_of_the_mass_before(tmp_path: Path) -> None:
    numbers = {**NUMBERS["payload_change"], "payload_mass": -6.0}
    made = with_model(scene(), write(tmp_path, {"payload_change": numbers})).concealed
    assert made.payload_change["table"].taken_off and made.payload_change["table"].mass == 6.0
    assert made.mass["table"] == pytest.approx(MASS - 6.0)


def test_a_scene_names_the_file_by_its_body(tmp_path: Path) -> None:
    write(tmp_path, {"tether": NUMBERS["tether"]})
    file = tmp_path / "room.yaml"
    file.write_text(json.dumps({**SCENE, "models": {"table": "model_table.json"}}))
    assert load_scene(file).concealed == with_model(scene(), tmp_path / "model_table.json").concealed


def test_what_the_scene_conceals_already_is_not_overwritten(tmp_path: Path) -> None:
    cord = {"tether": {"table": {"anchor": [2.0, 0.0, 0.5]}}}
    tied = parse_settings({**SCENE, "concealed": cord}, Scene, "test")
    with pytest.raises(SimError, match=r"concealed\.tether\.table: expected a scene that does not say it"):
        with_model(tied, write(tmp_path, {"tether": NUMBERS["tether"]}))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda text: text[:40], "expected JSON"),
        (lambda text: text.replace("model/1", "model/2"), "format"),
        (lambda text: text.replace('"table"', '"tabel"'), "did you mean 'table'?"),
        (lambda text: text.replace('"tether_x"', '"tether_z"'), "expected a parameter 'tether_x'"),
        (lambda text: text.replace("50.0", "-50.0"), "stiffness"),
        (lambda text: text.replace("50.0", "NaN"), "finite"),
        (lambda text: text.replace('"wheel_x"', '"hinge_x"'), "one on a hinge"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(tmp_path: Path, spoil: Any, said: str) -> None:
    wheel = {"wheel_x": -0.3, "wheel_y": 0.2, "mu_x": 0.15}
    path = write(tmp_path, {"tether": NUMBERS["tether"]}, wheel)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(SimError) as caught:
        with_model(scene(), path)
    assert said in str(caught.value) and str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(SimError, match="expected a model's file"):
        concealed_of(tmp_path / "none.json", scene().bodies)
