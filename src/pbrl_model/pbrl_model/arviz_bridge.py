"""Posteriors to and from ArviZ, and to and from files (netCDF, which other tools read; no pickle)."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_model.arviz_import import az
from pbrl_model.errors import ModelError
from pbrl_model.model_file import FORMAT as MODEL_FORMAT
from pbrl_model.model_file import IN_OUR_TERMS, SavedModel, load_model, posterior_of
from pbrl_model.parameters import KERNEL_COLUMNS, UNITS, BodyParameters
from pbrl_model.posterior import Posterior

FORMAT = "pbrl_model/posterior/1"


def to_inference_data(posterior: Posterior) -> Any:
    """Return the posterior as ArviZ `InferenceData`: one variable a parameter, with its unit, over (chain, draw)."""
    data = az().from_dict(posterior={name: np.array(posterior.column(name)) for name in posterior.names})
    group = data["posterior"]
    for name in posterior.names:
        group[name].attrs["units"] = UNITS[name]
    group.attrs.update(
        {
            "format": FORMAT,
            "object": posterior.object,
            "model_class": posterior.model_class,
            "names": json.dumps(posterior.names),
            "base": json.dumps({name: _number(value) for name, value in asdict(posterior.base).items()}),
            "log_evidence": posterior.log_evidence,
            "log_evidence_sd": posterior.log_evidence_sd,
            "ess": posterior.ess,
            "heldout_rmse": posterior.heldout_rmse,
            "notes": json.dumps(posterior.notes),
        }
    )
    return data


def from_inference_data(data: Any) -> Posterior:
    """Return the posterior that `to_inference_data` wrote.

    Raises:
        ModelError: something is missing or of another form.
    """
    try:
        group = data["posterior"]
        attributes = group.attrs
        if attributes["format"] != FORMAT:
            raise ModelError(f"posterior: expected format {FORMAT}, got {attributes['format']!r}")
        names = tuple(json.loads(attributes["names"]))
        for name in names:
            if group[name].attrs["units"] != UNITS[name]:
                raise ModelError(f"posterior: expected {name} in {UNITS[name]}, got {group[name].attrs['units']}")
        base = {name: _value(json.loads(attributes["base"])[name]) for name in KERNEL_COLUMNS}
        return Posterior(
            object=str(attributes["object"]),
            model_class=str(attributes["model_class"]),
            names=names,
            draws=np.stack([group[name].values for name in names], axis=-1),
            base=BodyParameters(**base),
            log_evidence=float(attributes["log_evidence"]),
            heldout_rmse=float(attributes["heldout_rmse"]),
            notes=tuple(map(str, json.loads(attributes["notes"]))),
            log_evidence_sd=float(attributes.get("log_evidence_sd", math.nan)),
            ess=float(attributes.get("ess", math.nan)),
        )
    except (KeyError, TypeError, ValueError) as error:
        what = " ".join(str(error).split())
        raise ModelError(f"posterior: expected what save_posterior writes, got something else ({what})") from None


def save_posterior(posterior: Posterior, path: Path) -> None:
    """Write the posterior as netCDF; the file is there whole or not at all.

    Raises:
        ModelError: it cannot be written.
    """
    _write(to_inference_data(posterior), path)


def save_model_draws(model: SavedModel, path: Path) -> None:
    """Write the draws of a model's file as netCDF: as `save_posterior` where it has no effect of its own.

    Of others every parameter is a variable with its unit, those of effects too, for ArviZ; `load_posterior` says that
    they cannot be simulated.

    Raises:
        ModelError: it cannot be written.
    """
    if all(name in IN_OUR_TERMS for name in model.names):
        save_posterior(posterior_of(model), path)
        return
    parameters = model.all_parameters()
    data = az().from_dict(posterior={name: np.array(each.draws)[None] for name, each in parameters.items()})
    group = data["posterior"]
    for name, each in parameters.items():
        group[name].attrs["units"] = each.unit
    group.attrs.update({"format": MODEL_FORMAT, "object": model.object, "effects": json.dumps(model.names)})
    group.attrs.update({"fixed": json.dumps(model.all_fixed()), "notes": json.dumps(model.notes)})
    _write(data, path)


def _write(data: Any, path: Path) -> None:
    unfinished = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        data.to_netcdf(str(unfinished))
        unfinished.replace(path)
    except (OSError, ValueError) as error:  # netCDF has no text with a zero in it
        with suppress(OSError):  # where the folder is none, there is nothing to be taken away
            unfinished.unlink()
        raise ModelError(f"{path}: expected to write a posterior there, got {' '.join(str(error).split())}") from None


def load_posterior(path: Path) -> Posterior:
    """Read what `save_posterior` wrote, or a repaired model (`model_file`) that holds nothing which is not ours.

    Raises:
        ModelError: the file is missing, cut off or of another form, or it has an effect that is not simulated here.
    """
    if not path.is_file():
        raise ModelError(f"{path}: expected a posterior's file, got none")
    if path.suffix == ".json":
        model = load_model(path)
        try:
            return posterior_of(model)
        except ModelError as error:
            raise ModelError(f"{path}: {error}") from None
    try:
        with import_module("h5py").File(path, "r") as file:  # h5netcdf complains on stderr where this cannot be done
            file.attrs.get("_nc3_strict")
        data = az().from_netcdf(str(path))
        return from_inference_data(data)  # numbers are read from the file only now
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RuntimeError,
    ) as error:  # HDF5 fails in any way
        raise ModelError(f"{path}: expected netCDF, got {' '.join(str(error).split())}") from None


def _number(value: float) -> float | None:
    """NaN as JSON has it."""
    return None if math.isnan(value) else value


def _value(number: Any) -> float:
    return math.nan if number is None else float(number)
