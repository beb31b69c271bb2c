"""A model's file gives back what was written, and becomes an ordinary posterior where it is one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrl_model.agents.domain import ActionSet, Thing
from pbrl_model.agents.models import LearnedModel, TrueModel
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, load_model, posterior_of, save_model
from pbrl_model.parameters import BodyParameters

SQUARE = ((-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4))
SHAPE = Shape(footprint=SQUARE, feet=SQUARE, com=(0.0, 0.0), inertia_per_mass=0.64 / 6, nominal_mass=20.0)
DRAWS = 40


def column(unit: str, centre: float, *, positive: bool = False, spread: float = 0.1) -> Any:
    rng = np.random.default_rng(int(1000 * abs(centre)))
    return learned(unit, centre * np.exp(spread * rng.standard_normal(DRAWS)), centre, positive=positive)


def model(**changes: Any) -> SavedModel:
    known: dict[str, Any] = {"object": "table", "shape": SHAPE, "parameters": {"mass": column("kg", 20.0)}}
    return SavedModel(**{**known, **changes})


def wheel(along: str = "") -> dict[str, Any]:
    return {
        f"wheel{along}_x": column("m", -0.3),
        f"wheel{along}_y": column("m", 0.2),
        f"wheel{along}_mu_x" if along else "mu_x": column("1", 0.11, positive=True),
    }


TETHER = LearnedEffect(effect="tether", parameters={"tether_stiffness": column("N/m", 60.0, positive=True)})


def test_what_is_written_is_read_and_the_same_model_makes_the_same_bytes(tmp_path: Path) -> None:
    made = model(effects=(TETHER,), fixed={"cone": 1.0}, clock=(3.0, 9.5), notes=("a note",))
    for name in ("a.json", "deeper/b.json"):
        save_model(made, tmp_path / name)
    assert load_model(tmp_path / "a.json") == made
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "deeper" / "b.json").read_bytes()


def test_a_model_without_effects_is_a_posterior_with_the_same_draws(tmp_path: Path) -> None:
    made = model(parameters={"mass": column("kg", 20.0), **wheel(), "mu_y": column("1", 0.4, positive=True)})
    save_model(made, tmp_path / "model.json")
    posterior = load_posterior(tmp_path / "model.json")
    assert posterior.model_class == "wheel"
    for name, told in made.parameters.items():
        assert np.array_equal(posterior.column(name)[0], told.draws)


def test_a_locked_caster_has_the_same_friction_along_and_across() -> None:
    posterior = posterior_of(model(parameters={"mass": column("kg", 20.0), **wheel()}, fixed={"mu_y": -1.0}))
    assert np.array_equal(posterior.column("mu_x"), posterior.column("mu_y"))


def test_a_second_wheel_is_the_wheel_of_a_body_without_one() -> None:
    effect = LearnedEffect(effect="second_wheel", parameters=wheel("2"), fixed={"wheel2_mu_y": -1.0})
    posterior = posterior_of(model(effects=(effect,)))
    assert posterior.model_class == "wheel"
    assert np.array_equal(posterior.column("wheel_x")[0], effect.parameters["wheel2_x"].draws)
    assert np.array_equal(posterior.column("mu_y")[0], effect.parameters["wheel2_mu_x"].draws)
    with pytest.raises(ModelError, match=r"expected one wheel.*pbrl_mismatch"):
        posterior_of(model(parameters={"mass": column("kg", 20.0), **wheel()}, effects=(effect,)))


def test_friction_of_feet_is_friction_of_the_whole_body_and_the_note_says_so() -> None:
    effect = LearnedEffect(effect="ground_friction", parameters={"slide_mu": column("1", 0.05, positive=True)})
    posterior = posterior_of(model(effects=(effect,)))
    assert np.array_equal(posterior.column("mu_ground")[0], effect.parameters["slide_mu"].draws)
    assert any("feet" in note for note in posterior.notes)


def test_what_cannot_be_simulated_is_refused_in_one_line_that_says_what_can(tmp_path: Path) -> None:
    save_model(model(effects=(TETHER,)), tmp_path / "model.json")
    with pytest.raises(ModelError) as caught:
        load_posterior(tmp_path / "model.json")
    said = str(caught.value)
    assert "\n" not in said and "model.json" in said
    assert "tether" in said and "second_wheel or ground_friction" in said and "pbrl_mismatch.repaired" in said


def test_the_planner_expects_of_certain_draws_what_is_true() -> None:
    thing = Thing("table", np.array(SQUARE), np.zeros(3))
    actions = ActionSet(np.array([[30.0, 0.0, 0.0], [0.0, 25.0, 2.0]]), np.array([0.5, 0.5]))
    sure = {
        "mass": learned("kg", np.full(DRAWS, 18.0), 18.0),
        "mu_ground": learned("1", np.full(DRAWS, 0.1), 0.1, positive=True),
    }
    known = LearnedModel(thing, posterior_of(model(parameters=sure)))
    truth = TrueModel(thing, BodyParameters(mass=18.0, mu_ground=0.1))
    assert np.allclose(known.ends(actions), truth.ends(actions), atol=1e-12)


def cut_off(text: str) -> str:
    return text[: len(text) // 2]


def other_format(text: str) -> str:
    return text.replace("pbrl_model/model/1", "pbrl_model/model/9")


def edited(key: str, value: Any) -> Callable[[str], str]:
    return lambda text: json.dumps({**json.loads(text), key: value})


def uneven(text: str) -> str:
    data = json.loads(text)
    data["effects"][0]["parameters"]["tether_stiffness"]["draws"].pop()
    return json.dumps(data)


def in_pounds(text: str) -> str:
    data = json.loads(text)
    data["parameters"]["mass"]["unit"] = "lb"
    return json.dumps(data)


def twice(text: str) -> str:
    data = json.loads(text)
    data["effects"] *= 2
    return json.dumps(data)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (cut_off, "expected JSON"),
        (other_format, "expected a model of format"),
        (lambda text: "[]", "got 'list'"),
        (lambda text: text.replace('"best": 20.0', '"best": NaN'), "parameters.mass.best"),
        (edited("effect", []), "unknown key; did you mean 'effects'?"),
        (edited("parameters", {}), "expected at least the mass"),
        (uneven, "as many of each"),
        (in_pounds, "expected kg, got 'lb'"),
        (twice, "expected each once"),
    ],
)
def test_a_spoilt_file_is_refused_in_one_line(tmp_path: Path, spoil: Callable[[str], str], said: str) -> None:
    path = tmp_path / "model.json"
    save_model(model(effects=(TETHER,)), path)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(ModelError) as caught:
        load_model(path)
    assert said in str(caught.value) and "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="expected a model's file"):
        load_model(tmp_path / "none.json")
