"""A fit as a model's file: the same posterior comes back from it, and where it keeps its body is known."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import BodyGeometry
from pbrl_model.fitted_model import DRAWS, fitted_model
from pbrl_model.fitting.fit import ObjectFit
from pbrl_model.geometry import mass_properties
from pbrl_model.model_file import load_model, posterior_of, save_model
from pbrl_model.parameters import MODEL_CLASSES, BodyParameters
from pbrl_model.posterior import Posterior

OUTLINE = np.array([[-0.6, -0.35], [0.6, -0.35], [0.6, 0.35], [-0.6, 0.35]])
VALUES = {"mass": 20.0, "wheel_x": 0.3, "wheel_y": -0.2, "wheel_theta": 1.55, "mu_x": 0.02, "mu_y": 0.1,
          "mu_ground": 0.03, "hinge_x": 1.0, "hinge_y": 2.0, "hinge_radius": 0.3}  # fmt: skip


def found(model_class: str) -> ObjectFit:
    names = MODEL_CLASSES[model_class]
    draws = np.array([VALUES[name] for name in names]) * np.random.default_rng(2).normal(
        1.0, 0.03, (4, 100, len(names))
    )
    base = BodyParameters(mass=1.0, anchor_x=0.1 if model_class == "hinge" else 0.0)
    motion: Any = SimpleNamespace(time=np.array([1.5, 9.0]))
    posterior = Posterior("table", model_class, names, draws, base=base, notes=("a note",))
    return ObjectFit(posterior, np.zeros(0), np.zeros(0), np.zeros(0), None, (motion,), mass_properties(OUTLINE))


@pytest.mark.parametrize("model_class", list(MODEL_CLASSES))
@pytest.mark.parametrize("nominal", [25.0, math.nan])
def test_the_posterior_comes_back_from_the_file(model_class: str, nominal: float, tmp_path: Path) -> None:
    fit = found(model_class)
    geometry = BodyGeometry("table", OUTLINE, 0.7, nominal, True, np.zeros(3), 0.8 * OUTLINE)
    saved = fitted_model(np.random.default_rng(0), fit, geometry)
    save_model(saved, tmp_path / "model_table.json")
    model = load_model(tmp_path / "model_table.json")
    assert model == saved and model.clock == (1.5, 9.0) and model.notes == ("a note",)
    assert model.shape.nominal_mass == (None if math.isnan(nominal) else nominal)
    np.testing.assert_allclose(model.shape.feet, 0.8 * OUTLINE)
    again = posterior_of(model)
    assert again.model_class == model_class and again.names == fit.posterior.names
    assert len(again.flat) == DRAWS and again.base.anchor_x == fit.posterior.base.anchor_x
    for name, told in again.summary().items():
        whole = fit.posterior.summary()[name]
        apart = abs(float(told["mean"]) - float(whole["mean"]))
        apart = min(apart, math.pi - apart) if name == "wheel_theta" else apart
        assert apart < 0.3 * float(whole["sd"])
    again_kept = {tuple(row) for row in again.flat.tolist()}
    assert again_kept <= {tuple(row) for row in fit.posterior.canonical().flat.tolist()}
