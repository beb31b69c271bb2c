"""Posteriors to and from ArviZ and files: nothing is lost, broken files are refused, nothing is left half-written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrl_model.arviz_bridge import from_inference_data, load_posterior, save_posterior, to_inference_data
from pbrl_model.errors import ModelError
from pbrl_model.parameters import UNITS, BodyParameters, free_columns
from pbrl_model.posterior import Posterior

CLASSES = ["free", "wheel", "wheel+ground", "hinge"]


def posterior(name: str) -> Posterior:
    names = free_columns(name)
    draws = np.random.default_rng(0).normal(size=(3, 7, len(names)))
    base = BodyParameters(2.0, anchor_x=0.3, hinge_radius=0.5 if name == "hinge" else float("nan"))
    return Posterior("Tisch № 1", name, names, draws, base, -12.5, float("nan"), ("the data do not say µ",))


def same(one: Posterior, two: Posterior) -> bool:
    fields = ("object", "model_class", "names", "log_evidence", "notes")
    return (
        all(getattr(one, field) == getattr(two, field) for field in fields)
        and one.draws.tobytes() == two.draws.tobytes()
        and one.base.to_vector().tobytes() == two.base.to_vector().tobytes()
        and np.isnan(one.heldout_rmse) == np.isnan(two.heldout_rmse)
    )


@pytest.mark.parametrize("name", CLASSES)
def test_inference_data_round_trip_with_names_and_units(name: str) -> None:
    found = posterior(name)
    data = to_inference_data(found)
    assert set(data["posterior"].data_vars) == set(found.names)
    assert dict(data["posterior"].sizes) == {"chain": 3, "draw": 7}
    assert all(data["posterior"][parameter].attrs["units"] == UNITS[parameter] for parameter in found.names)
    assert same(from_inference_data(data), found)


@pytest.mark.parametrize("name", CLASSES)
def test_file_round_trip(name: str, tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "posterior.nc"
    save_posterior(posterior(name), path)
    assert same(load_posterior(path), posterior(name))
    assert [entry.name for entry in path.parent.iterdir()] == ["posterior.nc"]


def test_broken_files_are_refused_in_one_line(tmp_path: Path) -> None:
    whole = tmp_path / "whole.nc"
    save_posterior(posterior("wheel"), whole)
    path = tmp_path / "broken.nc"
    for content in (b"", b"no netCDF" * 100, whole.read_bytes()[:5000]):
        path.write_bytes(content)
        with pytest.raises(ModelError, match=r"broken\.nc") as caught:
            load_posterior(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match="got none"):
        load_posterior(tmp_path / "missing.nc")


def test_foreign_inference_data_is_refused() -> None:
    data = to_inference_data(posterior("wheel"))
    data["posterior"]["mass"].attrs["units"] = "lb"
    with pytest.raises(ModelError, match="expected mass in kg, got lb"):
        from_inference_data(data)
    del data["posterior"].attrs["names"]
    with pytest.raises(ModelError, match="names"):
        from_inference_data(data)
    data["posterior"].attrs["format"] = "other"
    with pytest.raises(ModelError, match="expected format"):
        from_inference_data(data)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelError, match="file"):
        save_posterior(posterior("free"), tmp_path / "file" / "posterior.nc")
