"""What ArviZ is handed: the draws by name, with units, and how sure they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_model.arviz_import import az
from pbrl_model.errors import ModelError
from pbrl_model.inference.arviz_data import to_inference_data
from pbrl_model.inference.infer import Inference

FOUND = Inference(
    names=("mass", "log_scale"),
    draws=np.random.default_rng(0).normal([18.0, 0.0], [0.1, 0.01], (500, 2)),
    samples=np.zeros((1, 2)),
    log_weights=np.zeros(1),
    log_evidence=-3.0,
    log_evidence_sd=0.01,
    ess=400.0,
    pareto_k=0.2,
    modes=np.zeros((1, 2)),
    shares=np.ones(1),
    calls=1000,
    converged=False,
    notes=("why",),
)


def test_names_units_and_attributes_survive_a_file(tmp_path: Path) -> None:
    to_inference_data(FOUND).to_netcdf(str(tmp_path / "found.nc"))
    group = az().from_netcdf(str(tmp_path / "found.nc"))["posterior"]
    assert group["mass"].attrs["units"] == "kg"
    assert group["log_scale"].attrs["units"] == "1"
    assert group["mass"].values.ravel() == pytest.approx(FOUND.draws[:, 0])
    assert (group.attrs["log_evidence"], group.attrs["converged"]) == (-3.0, 0)
    assert group.attrs["notes"] == '["why"]'


def test_arviz_summarises_it() -> None:
    summary = az().summary(to_inference_data(FOUND), kind="stats")
    assert summary.loc["mass", "mean"] == pytest.approx(18.0, abs=0.05)


def test_no_draws_are_an_error_that_says_why() -> None:
    with pytest.raises(ModelError, match="why"):
        to_inference_data(replace(FOUND, draws=np.zeros((0, 2))))
