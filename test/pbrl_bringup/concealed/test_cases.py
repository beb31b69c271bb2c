"""Concealed cases: made alike from one seed, every effect can be drawn, the recording holds nothing of the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import Activity, HandPath, HandPush
from pbrl_bag import read_recording, write_recording
from pbrl_bringup.concealed.cases import Case, make, not_read_away
from pbrl_bringup.concealed.draws import DRAWS, between
from pbrl_bringup.concealed.stage import NAME, SOFT, TURNING, Stage, about_pin, draw_stage, play


@pytest.fixture(scope="module", autouse=True)
def short() -> Iterator[None]:
    """One push of some seconds: what is drawn of it is drawn as ever."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pbrl_bringup.concealed.stage.PUSHES", 1)
        patch.setattr("pbrl_bringup.concealed.stage.SECONDS", 10.0)
        yield


@pytest.fixture(scope="module")
def stage() -> Stage:
    return draw_stage(np.random.default_rng(3))


@pytest.mark.parametrize("strength", [0.0, 1.0])
@pytest.mark.parametrize("effect", DRAWS)
def test_every_draw_is_a_scene_that_conceals_just_that(stage: Stage, effect: str, strength: float) -> None:
    drawn = DRAWS[effect](np.random.default_rng(5), stage, strength)
    # A second wheel comes with a first one, without which it would be of the baseline class.
    assert {effect} <= set(drawn) <= {effect, "wheel"}
    assert "wheel" not in drawn or (effect == "second_wheel" and "wheel" not in stage.scene["concealed"])
    scene = stage.with_concealed(drawn)
    told = {name for name in type(scene.concealed).model_fields if getattr(scene.concealed, name)}
    assert told - {"wheel"} == {effect}


def test_a_stage_is_of_the_baseline_class(stage: Stage) -> None:
    scene = stage.with_concealed({})
    assert {name for name in type(scene.concealed).model_fields if getattr(scene.concealed, name)} <= {"wheel"}
    assert len(stage.moving()) > 0.5 * len(stage.track.time)


def test_the_same_case_is_the_same_and_another_seed_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Whether an oracle sees the effect is a long fit, of the same bytes as well.
    monkeypatch.setattr("pbrl_bringup.concealed.cases.seen", lambda laid_out, truth: object())
    made = [make(Case(("ground_friction",), seed)) for seed in (0, 0, 2)]
    assert made[0].truth.seal() == made[1].truth.seal() != made[2].truth.seal()
    bags = [
        write_recording(one.recording, tmp_path / str(k) / "bag") for k, one in enumerate(made) if _folder(tmp_path, k)
    ]
    contents = [next(bag.glob("*.mcap")).read_bytes() for bag in bags]
    assert contents[0] == contents[1] != contents[2]


def _folder(parent: Path, number: int) -> bool:
    (parent / str(number)).mkdir()
    return True


def test_the_recording_is_the_contract_s_and_holds_nothing_of_the_truth(tmp_path: Path) -> None:
    made = make(Case(("tether",), 1))
    truth = made.truth
    bag = write_recording(made.recording, tmp_path / "bag")
    read = read_recording(bag)
    assert set(read.bodies) == {"table"} and {grasp.object for grasp in read.grasps} == {"table"}
    assert truth.effects == ("tether",) and 0.0 < truth.share["tether"] < 1.0
    assert all(start < end for start, end in truth.when["tether"])
    assert made.oracle is not None and made.oracle.times_detectable >= 1.0
    assert b"tether" not in next(bag.glob("*.mcap")).read_bytes()
    assert replace(truth, strength=truth.strength + 1e-9).seal() != truth.seal()


def test_what_is_clean_is_the_stage_s_own_recording(stage: Stage) -> None:
    again = push_by_hand(stage.with_concealed({}), stage.pushes, seed=stage.seed)
    kept = play(stage, {})
    np.testing.assert_array_equal(kept.wrench.force, again.wrench.force)
    np.testing.assert_array_equal(kept.bodies[NAME].pose, again.bodies[NAME].pose)


@pytest.mark.parametrize("contact", [(0.2, 0.5), (-0.3, 0.1), (0.1, -0.5), (0.3, 0.0)])
def test_a_push_about_a_pin_leaves_the_pin_where_it_is(contact: tuple[float, float]) -> None:
    half, pin = np.array([0.3, 0.5]), np.array([0.12, -0.2])
    time = np.linspace(0.0, 4.0, 41)
    straight = np.column_stack([0.1 * np.sin(time), np.zeros(41), 0.3 * np.cos(time)])
    push = about_pin(HandPush(NAME, contact, HandPath(time, straight, "hand")), half, pin)
    normal = np.where(np.abs(np.array(contact)) == half, -np.sign(contact), 0.0)
    held = np.array(contact) + 0.5 * SOFT.depth * normal
    # Rigid body in its own axes: the velocity at the pin is that of the hand and the turning about it.
    axes = np.column_stack([normal, [-normal[1], normal[0]]])
    velocity, turn = push.path.twist[:, :2] @ axes.T, push.path.twist[:, 2]
    arm = pin - held
    at_pin = velocity + turn[:, None] * np.array([-arm[1], arm[0]])
    np.testing.assert_allclose(at_pin, 0.0, atol=1e-12)
    assert np.abs(turn).max() <= TURNING and np.abs(turn).max() > 0.1


def test_a_pin_is_where_a_wheel_lets_the_table_turn() -> None:
    rng = np.random.default_rng(8)
    wheel = {"position": [0.1, 0.2], "heading": 0.4, "load": 50.0}
    table = {"size": [0.8, 1.2], "nominal_mass": 20.0}
    scene: dict[str, object] = {"bodies": {NAME: table}, "concealed": {"wheel": {NAME: wheel}}}
    away = []
    for _ in range(50):
        drawn: Any = DRAWS["hidden_hinge"](rng, SimpleNamespace(scene=scene, half=np.array([0.4, 0.6])), 0.5)  # type: ignore[arg-type]
        off = np.array(drawn["hidden_hinge"][NAME]["point"]) - wheel["position"]
        away.append(abs(off @ [math.cos(0.4), math.sin(0.4)]))
    assert np.median(away) < 0.02


def test_strength_is_even_in_the_logarithm() -> None:
    assert between(2.0, 8.0, 0.0) == 2.0
    assert between(2.0, 8.0, 0.5) == pytest.approx(4.0)
    assert between(8.0, 2.0, 1.0) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("offset", "until"),
    [
        (lambda time: np.clip((time - 8.0) / 0.3, 0.0, 1.0), 20.0),
        (lambda time: np.maximum(time - 8.0, 0.0) / 60.0, 41.0),
    ],
)
def test_an_offset_that_was_read_before_a_grasp_does_not_act_in_it(offset: Any, until: float) -> None:
    time = np.linspace(0.0, 40.0, 4001)
    strength = offset(time)
    grasps = [SimpleNamespace(time=at, body=body) for at, body in ((1.0, NAME), (19.0, None), (20.0, NAME))]
    made: Any = SimpleNamespace(grasps=grasps)
    acts = not_read_away(made, Activity("wrench_bias", "left", "1", time, strength > 0.0, strength))
    np.testing.assert_array_equal(acts, (time > 8.0) & (time < until) & (time != 20.0))
