"""Learned models as the page draws them: where the wheel or hinge may be, and the numbers in a line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.errors import BringupError
from pbrl_bringup.view.models import told_model
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import IN_OUR_TERMS, load_model, posterior_of
from pbrl_model.posterior import Posterior


def model_files(paths: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Return what the page draws of learned models, by object.

    Args:
        paths: `posterior_NAME.nc` of fit, or `model_NAME.json` of diagnose.

    Raises:
        ModelError: a file is missing or none of a model.
        BringupError: two files are about one object.
    """
    found: dict[str, dict[str, Any]] = {}
    for path in paths:
        name, told = _model(path)
        if name in found:
            raise BringupError(f"--model {path}: expected one model of {name!r}, got a second one")
        found[name] = told
    return found


def told_of(posterior: Posterior) -> dict[str, Any]:
    """Return what the page draws of a posterior."""
    canonical = posterior.canonical()
    mean, sd = canonical.mean().tolist(), canonical.sd().tolist()
    numbers = zip(canonical.names, mean, sd, canonical.units, strict=True)
    draws = {name: canonical.column(name).ravel() for name in canonical.names}
    return told_model(canonical.model_class, [(name, m, s, unit) for name, m, s, unit in numbers], draws)


def _model(path: Path) -> tuple[str, dict[str, Any]]:
    if path.suffix.lower() != ".json":
        if not path.is_file():
            raise ModelError(f"{path}: expected a model's file, got nothing of that name")
        posterior = load_posterior(path)
        return posterior.object, told_of(posterior)
    model = load_model(path)
    if all(name in IN_OUR_TERMS for name in model.names):
        return model.object, told_of(posterior_of(model))
    learned = model.all_parameters()
    numbers = [(name, each.mean, each.sd, each.unit) for name, each in learned.items()]
    draws = {name: np.array(each.draws) for name, each in learned.items()}
    return model.object, told_model(" + ".join(("body", *model.names)), numbers, draws)
