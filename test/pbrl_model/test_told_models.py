"""What files say of objects: the body's own parameters, without what `pbrl_model` has no word for, which is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, save_model
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.told_models import told_model, told_models

SQUARE = ((-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4))
SHAPE = Shape(footprint=SQUARE, feet=SQUARE, com=(0.0, 0.0), inertia_per_mass=0.64 / 6)


def column(unit: str, centre: float) -> Any:
    return learned(unit, centre * np.exp(0.1 * np.random.default_rng(0).standard_normal(40)), centre)


WHEEL = {"wheel_x": column("m", -0.3), "wheel_y": column("m", 0.2), "mu_x": column("1", 0.11)}
SECOND = LearnedEffect(
    effect="second_wheel", parameters={f"wheel2_{k.removeprefix('wheel_')}": WHEEL[k] for k in WHEEL}
)
TETHER = LearnedEffect(effect="tether", parameters={"tether_stiffness": column("N/m", 60.0)})
GROUND = LearnedEffect(effect="ground_friction", parameters={"slide_mu": column("1", 0.05)})
MASS = {"mass": column("kg", 20.0)}


def model(folder: Path, *effects: LearnedEffect, **changes: Any) -> Path:
    known: dict[str, Any] = {"object": "table", "shape": SHAPE, "parameters": MASS, "clock": (3.0, 9.5)}
    save_model(SavedModel(**{**known, "effects": effects, **changes}), folder / "model_table.json")
    return folder / "model_table.json"


def test_a_body_keeps_its_own_parameters_and_the_note_says_what_is_not_among_them(tmp_path: Path) -> None:
    told = told_model(model(tmp_path, TETHER, GROUND, notes=("a note",)))
    assert told.left_out == ("tether",) and told.until == 9.5
    assert told.posterior.names == ("mass", "mu_ground")
    assert np.array_equal(told.posterior.column("mass")[0], MASS["mass"].draws)
    assert np.array_equal(told.posterior.column("mu_ground")[0], GROUND.parameters["slide_mu"].draws)
    assert told.posterior.notes[0] == "a note"
    assert "tether" in told.posterior.notes[-1] and "ground_friction" not in told.posterior.notes[-1]


def test_of_two_wheels_the_body_s_own_is_told_and_one_alone_is_its_wheel(tmp_path: Path) -> None:
    both = told_model(model(tmp_path, SECOND, parameters=MASS | WHEEL, fixed={"mu_y": -1.0}))
    assert both.left_out == ("second_wheel",) and both.posterior.model_class == "wheel"
    alone = told_model(model(tmp_path, SECOND))
    assert alone.left_out == () and "wheel_x" in alone.posterior.names


def test_what_was_not_learned_is_in_the_draws_where_it_is_something(tmp_path: Path) -> None:
    names, draws = ("mass", "mu_x", "mu_y", "hinge_x", "hinge_y", "hinge_radius"), np.full((2, 5, 6), 0.4)
    base = BodyParameters(mass=1.0, anchor_x=0.3)
    save_posterior(Posterior("door", "hinge", names, draws, base), tmp_path / "posterior_door.nc")
    told = told_model(tmp_path / "posterior_door.nc")
    assert told.posterior.names == (*names, "anchor_x") and told.until == 0.0
    assert np.array_equal(told.posterior.column("anchor_x"), np.full((2, 5), 0.3))
    again = Posterior("door", "hinge", told.posterior.names, told.posterior.draws).rows()
    assert np.array_equal(again, Posterior("door", "hinge", names, draws, base).rows()), "without a base they are alike"


def test_half_a_place_is_made_whole_or_refused(tmp_path: Path) -> None:
    half = {name: column for name, column in WHEEL.items() if name != "wheel_y"}
    told = told_model(model(tmp_path, parameters=MASS | half)).posterior
    assert not told.column("wheel_y").any()
    path = model(tmp_path, parameters=MASS | {"hinge_x": column("m", 0.5)})
    with pytest.raises(ModelError, match=r"model_table\.json: expected hinge_radius beside mass, hinge_x, got none"):
        told_model(path)


def test_files_are_of_an_object_each(tmp_path: Path) -> None:
    path = model(tmp_path, TETHER)
    other = tmp_path / "posterior_desk.nc"
    save_posterior(Posterior("desk", "free", ("mass",), np.full((1, 4, 1), 12.0)), other)
    assert set(told_models([path, other])) == {"table", "desk"}
    (tmp_path / "again").mkdir()
    with pytest.raises(ModelError, match=r"again.*expected one file of an object, got a second of 'table' \(.*json\)"):
        told_models([path, model(tmp_path / "again")])


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("none.json", None, "expected a model's file, got FileNotFoundError"),
        ("none.nc", None, "expected a posterior's file, got none"),
        ("model.json", '{"format": "other"}', "expected a model of format"),
        ("posterior.nc", "no netCDF", "expected netCDF"),
        ("model.yaml", "a: 1", "expected netCDF"),
    ],
)
def test_a_file_that_is_none_is_one_line(tmp_path: Path, name: str, text: str | None, said: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ModelError) as caught:
        told_models([tmp_path / name])
    assert said in str(caught.value) and str(tmp_path / name) in str(caught.value) and "\n" not in str(caught.value)
