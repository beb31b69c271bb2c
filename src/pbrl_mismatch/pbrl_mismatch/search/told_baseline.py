"""A baseline that is told: a model from a file, repaired ones too, as the hypothesis that nothing more was left out."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.caster_swivel import HEADINGS
from pbrl_mismatch.effects.effect import Parameter
from pbrl_mismatch.effects.hidden_hinge import AT_REST
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.repaired import load_repaired, rows_of
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import LearnedParameter, SavedModel
from pbrl_model.parameters import KERNEL_COLUMNS, POSITIVE
from pbrl_model.posterior import Posterior

Array = NDArray[np.float64]

MODEL_FILES = (".json", ".nc")
"""Endings of files that hold a model: what `diagnose` writes, and what `fit` writes."""
LEAST_SPREAD = 1e-4
"""A posterior is not taken to be narrower: the climb takes steps of a share of it."""
ANY_TURN = 1.5
"""Spread of an angle that says nothing of the next recording [rad]."""
OF_THE_MOMENT = {
    **dict.fromkeys(HEADINGS, ANY_TURN),
    "periodic_phase": ANY_TURN,
    "pivot_off_x": AT_REST,
    "pivot_off_y": AT_REST,
}
"""Columns that say how things stood when a recording began, not what they are: each anew, within so much of zero."""


@dataclass(frozen=True)
class ToldBaseline:
    """A model that counts as no mismatch.

    Attributes:
        object: that it is of.
        hypothesis: its posterior as the prior, its effects part of the body.
        effects: those effects, which are not to be looked for again.
    """

    object: str
    hypothesis: Hypothesis
    effects: tuple[str, ...]


def is_model_file(text: str) -> bool:
    """Tell whether a `--baseline` names a file and not a kind of body."""
    return Path(text).suffix in MODEL_FILES


def told_baselines(names: Collection[str], options: DiagnoseOptions) -> dict[str, ToldBaseline]:
    """Return the models that were told of objects, by object; models of other objects are for other recordings.

    Raises:
        ModelError: a file cannot be read.
        MismatchError: it is of something that cannot be simulated, two are of one object, or none is of any of these.
    """
    told: dict[str, ToldBaseline] = {}
    for path in options.models:
        each = baseline_from_model(path, inertia_spread=options.inertia_spread, delay_spread=options.delay_spread)
        if each.object in told:
            raise MismatchError(f"{path}: expected one model of {each.object!r}, got a second; leave one out")
        told[each.object] = each
    if told and not {*told} & {*names}:
        raise MismatchError(
            f"baseline: expected a model of what was held, {' or '.join(map(repr, names))}, got one of "
            f"{' and of '.join(map(repr, told))}"
        )
    return told


def baseline_from_model(path: Path, *, inertia_spread: float, delay_spread: float) -> ToldBaseline:
    """Read a model and make it a baseline.

    Args:
        path: of `pbrl_model.model_file` (".json") or of `pbrl_model.arviz_bridge` (".nc").
        inertia_spread: standard deviation of the logarithm of inertia over its nominal value, if the model is silent.
        delay_spread: standard deviation of the poses' delay that nobody would call a fault [s]; each recording has its
            own.

    Raises:
        MismatchError: the file is missing, of another form, or holds what cannot be simulated.
    """
    if path.suffix == ".nc":
        try:
            posterior = load_posterior(path)
        except ModelError as error:
            raise MismatchError(str(error)) from None
        return _finished(posterior.object, _of_posterior(posterior), inertia_spread, delay_spread, ())
    if path.suffix != ".json":
        raise MismatchError(f"{path}: expected a model's file ({' or '.join(MODEL_FILES)}), got another ending")
    model = load_repaired(path)
    return _finished(model.object, _of_model(model), inertia_spread, delay_spread, model.names)


def _of_model(model: SavedModel) -> tuple[list[Parameter], Array]:
    """Return what is free and the row of everything else."""
    base = rows_of(model)[0]
    parameters = [_believed(column, told) for column, told in model.all_parameters().items()]
    return parameters, base


def _believed(column: str, told: LearnedParameter) -> Parameter:
    """Return a posterior as a prior, Gaussian in the coordinate that it was learned in."""
    if column in OF_THE_MOMENT:
        return Parameter(column, 0.0, OF_THE_MOMENT[column])
    draws = np.log(told.draws) if told.positive else np.asarray(told.draws)
    spread = max(float(np.std(draws)), LEAST_SPREAD)
    return Parameter(column, told.best, spread, positive=told.positive)


def _of_posterior(posterior: Posterior) -> tuple[list[Parameter], Array]:
    base = neutral_row()
    for name in KERNEL_COLUMNS:
        base[COLUMN[name]] = getattr(posterior.base, name)
    parameters = []
    # A wheel's four descriptions are one: without this its angle would seem to be anything.
    for name, values in zip(posterior.names, posterior.canonical().flat.T, strict=True):
        positive = name in POSITIVE
        draws = np.log(np.maximum(values, 1e-12)) if positive else values
        centre = math.exp(float(np.median(draws))) if positive else float(np.median(draws))
        parameters.append(Parameter(name, centre, max(float(np.std(draws)), LEAST_SPREAD), positive=positive))
    return parameters, base


def _finished(
    name: str, made: tuple[list[Parameter], Array], inertia_spread: float, delay_spread: float, effects: tuple[str, ...]
) -> ToldBaseline:
    """Add what every baseline has; the delay is this recording's, not the model's."""
    parameters, base = made
    parameters = [parameter for parameter in parameters if parameter.column != "delay"]
    columns = {parameter.column for parameter in parameters}
    if "inertia_factor" not in columns and not {"hinge_x", "hinge_y"} <= columns:
        parameters.append(Parameter("inertia_factor", 1.0, inertia_spread, positive=True))
    parameters.append(Parameter("delay", 0.0, delay_spread))
    for parameter in parameters:
        base[COLUMN[parameter.column]] = parameter.centre
    told = " + ".join(("told", *effects))
    return ToldBaseline(name, Hypothesis((), told, tuple(parameters), base, effects), effects)
