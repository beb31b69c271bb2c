"""Concealed cases: made alike from one seed, every effect can be drawn, the recording holds nothing of the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import read_recording, write_recording
from pbrl_bringup.concealed.cases import Case, make
from pbrl_bringup.concealed.draws import DRAWS, between
from pbrl_bringup.concealed.stage import Stage, draw_stage


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


def test_the_same_case_is_the_same_and_another_seed_is_not(tmp_path: Path) -> None:
    made = [make(Case(("ground_friction",), seed)) for seed in (0, 0, 2)]
    assert made[0][1].seal() == made[1][1].seal() != made[2][1].seal()
    bags = [write_recording(one[0], tmp_path / str(k) / "bag") for k, one in enumerate(made) if _folder(tmp_path, k)]
    contents = [next(bag.glob("*.mcap")).read_bytes() for bag in bags]
    assert contents[0] == contents[1] != contents[2]


def _folder(parent: Path, number: int) -> bool:
    (parent / str(number)).mkdir()
    return True


def test_the_recording_is_the_contract_s_and_holds_nothing_of_the_truth(tmp_path: Path) -> None:
    recording, truth = make(Case(("tether",), 1))
    bag = write_recording(recording, tmp_path / "bag")
    read = read_recording(bag)
    assert set(read.bodies) == {"table"} and {grasp.object for grasp in read.grasps} == {"table"}
    assert truth.effects == ("tether",) and truth.active and 0.0 < truth.share["tether"] < 1.0
    assert all(start < end for start, end in truth.when["tether"])
    assert b"tether" not in next(bag.glob("*.mcap")).read_bytes()
    assert replace(truth, strength=truth.strength + 1e-9).seal() != truth.seal()


def test_strength_is_even_in_the_logarithm() -> None:
    assert between(2.0, 8.0, 0.0) == 2.0
    assert between(2.0, 8.0, 0.5) == pytest.approx(4.0)
    assert between(8.0, 2.0, 1.0) == pytest.approx(2.0)
