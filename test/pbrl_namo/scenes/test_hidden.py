"""What is hidden is drawn as often as asked, and a simulator takes scenes with it."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
import yaml

from bullet_sim.placing import placed_footprint
from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes.hidden import CASTERS, KINDS, body_kind, draw_hidden, nominal_mass, scene_yaml
from pbrl_namo.scenes.office import random_office
from pbrl_namo.scenes.settings import HiddenSettings

ROOM = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]])
TRIANGLE = np.array([[-0.5, -0.4], [0.5, -0.4], [0.0, 0.6]])


@pytest.mark.parametrize(("count", "seed"), [(5, 0), (20, 1), (80, 2)])
def test_a_simulator_takes_an_office_with_what_is_hidden(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = random_office(count, rng, move_needed=True)
    hidden = draw_hidden(scene, rng)
    text = yaml.safe_dump(scene_yaml(scene, hidden))
    read = parse_settings(yaml.safe_load(text), Scene, "office")
    assert set(read.bodies) == {*scene.movable, *scene.fixed}
    assert read.robot.pose == pytest.approx(scene.start)
    for name, outline in [*scene.outlines.items(), *scene.fixed.items()]:
        assert placed_footprint(read.bodies[name]).symmetric_difference(outline).area < 1e-9
    for name, told in hidden.items():
        assert set(read.concealed.locked_casters.get(name, ())) == set(told["locked_casters"])
        assert read.concealed.mass.get(name, nominal_mass(scene.movable[name])) == pytest.approx(told["mass"])
        assert read.bodies[name].nominal_mass == scene.movable[name].mass
        assert read.bodies[name].height == scene.movable[name].height


def test_kinds_come_as_often_as_asked_and_are_what_their_names_say() -> None:
    scene = random_office(80, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    told = [(name, thing) for _ in range(10) for name, thing in draw_hidden(scene, rng).items()]
    shares = {kind: count / len(told) for kind, count in Counter(thing["kind"] for _, thing in told).items()}
    asked = HiddenSettings()
    expected = {"locked_caster": asked.locked_caster, "static": asked.static, "heavy": asked.heavy}
    for kind, share in {**expected, "free": 1.0 - sum(expected.values())}.items():
        assert shares[kind] == pytest.approx(share, abs=4.0 * math.sqrt(share * (1 - share) / len(told)))
    for name, thing in told:
        locked = thing["locked_casters"]
        assert len(locked) == len(set(locked)) == {"locked_caster": 1, "static": 2}.get(thing["kind"], 0)
        assert set(locked) <= set(CASTERS) and thing["kind"] in KINDS
        factor = thing["mass"] / scene.movable[name].mass
        heavy = thing["kind"] == "heavy"
        assert (asked.heavier[0] - 1e-3 <= factor <= asked.heavier[1] + 1e-3) if heavy else factor == pytest.approx(1.0)


def test_one_seed_hides_one_thing() -> None:
    scene = random_office(20, np.random.default_rng(0))
    one, two, other = (draw_hidden(scene, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert one == two != other


def test_a_thing_that_is_no_rectangle_is_a_block_without_casters() -> None:
    things = {"wedge": Movable(TRIANGLE), "mat": Movable(0.1 * ROOM - [0.3, 0.2]), "off": Movable(0.1 * ROOM)}
    poses = {name: np.array([1.0 + 1.5 * number, 1.0, 0.3]) for number, name in enumerate(things)}
    scene = NamoScene.of(ROOM, {}, things, poses, np.array([1.0, 3.0, 0.0]), np.array([5.0, 3.0, 0.0]))
    assert [body_kind(thing) for thing in things.values()] == ["block", "office_table", "block"]
    assert nominal_mass(things["wedge"]) == pytest.approx(15.0)
    always = draw_hidden(scene, np.random.default_rng(0), HiddenSettings(locked_caster=0.0, static=1.0, heavy=0.0))
    assert [always[name]["kind"] for name in things] == ["free", "static", "free"]
    read = parse_settings(scene_yaml(scene, always), Scene, "blocks")
    assert [read.bodies[name].kind for name in things] == ["block", "office_table", "block"]
    wrong = {"wedge": {"kind": "locked_caster", "locked_casters": ["front_left"], "mass": 15.0}}
    with pytest.raises(NamoError, match="expected no casters under 'wedge'"):
        scene_yaml(scene, wrong)


def test_what_is_hidden_in_nothing_is_refused() -> None:
    scene = random_office(5, np.random.default_rng(0))
    with pytest.raises(NamoError, match="expected one of"):
        scene_yaml(scene, {"sofa": {"kind": "free", "locked_casters": [], "mass": 1.0}})


def test_shares_of_more_than_everything_are_refused() -> None:
    scene = random_office(5, np.random.default_rng(0))
    with pytest.raises(NamoError, match=r"at most 1 together, got 1\.5"):
        draw_hidden(scene, np.random.default_rng(0), HiddenSettings(locked_caster=0.5, static=0.5, heavy=0.5))


def test_a_scene_with_nothing_hidden_conceals_nothing() -> None:
    scene = random_office(5, np.random.default_rng(0))
    assert scene_yaml(scene, {})["concealed"] == {}
